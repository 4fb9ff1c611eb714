"""Damaged files against importers: refused in words, or read as what then stands in them.

Run at length: ``python -m tests.fea.fuzzing --n 100000 --seed 1``. Another importer joins by
`register`.
"""

import argparse
import base64
import contextlib
import csv
import functools
import html
import io
import math
import os
import re
import runpy
import tempfile
import time
import warnings
import zipfile
import zlib
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import h5py
import meshio
import numpy as np
import pandas as pd
import pint
import pyarrow.parquet

from ridgebayes.errors import InputError
from ridgebayes.fea.given import Given
from ridgebayes.fea.history import RunBody
from ridgebayes.fea.read import import_files
from ridgebayes.fea.record import Imported
from tests.fea.runs import read_abaqus_dat, read_abaqus_rpt, read_calculix, read_series
from tests.fea.runs import read_calculix as read_calculix_contact
from tests.fea.tables import imported

SLOWEST = 5.0  # seconds that any file of this size may take
_SCRAPS = (
    *("1e400", "-1e400", "1e-400", "nan", "inf", "NaN", "true", "FALSE", "0x10", "1_0", "١", "-"),
    *("=1+1", "+1", "1,234", "1.234,5", "1 000", "0,5", "'", '"', '""', "\t", ";", ",", "\n", "\r"),
    *("\n\n", "\0", "\ufeff", "é", "%", " ", "  ", "E", "e", "#DIV/0!", "[um]", "(m)", "9" * 400),
    *("9" * 5000, "Q", "*", "\\", "\x0b", "\x1a", "\u2028", "null", "1d5", "<", "&", "]]>"),
)


@dataclass(frozen=True)
class Target:
    """A file that an importer reads, and what is wrong with a table read from a mutant of it.

    `doubt` returns words for what cannot be right; it gets the mutant and what was read.
    """

    name: str
    file_name: str
    content: bytes
    read: Callable[[Path], Any]
    doubt: Callable[[bytes, Any], str] = lambda content, found: ""
    mutate: Callable[[bytes, np.random.Generator], bytes] | None = None


TARGETS: dict[str, Target] = {}


@functools.cache  # reading its definitions takes as long as collecting a hundred tests
def _units() -> pint.UnitRegistry:
    return pint.UnitRegistry()


def register(target: Target) -> None:
    TARGETS[target.name] = target


def mutants(content: bytes, rng: np.random.Generator) -> bytes:
    """Return the content with one to three damages."""
    for _ in range(int(rng.integers(1, 4))):
        content = _DAMAGES[int(rng.integers(len(_DAMAGES)))](content, rng)
    return content


def attack(target: Target, n: int, rng: np.random.Generator, folder: Path) -> Counter[str]:
    """Read n mutants; AssertionError at the first wrong one, which stays in the folder."""
    counts: Counter[str] = Counter()
    path = folder / target.file_name
    for _ in range(n):
        mutant = (target.mutate or mutants)(target.content, rng)
        path.write_bytes(mutant)
        began = time.perf_counter()
        try:
            found = target.read(path)
        except InputError as error:
            counts["refused"] += 1
            text = str(error)
            assert target.file_name in text, f"{target.name}: no file in {text!r}"
            assert text.strip() == text, f"{target.name}: {text!r}"
            assert "\n\n" not in text, f"{target.name}: {text!r}"
        else:
            counts["same bytes" if mutant == target.content else "read"] += 1
            assert len(found.table), target.name
            assert found.messages, target.name
            doubt = target.doubt(mutant, found)
            assert not doubt, f"{target.name}: {doubt}"
        took = time.perf_counter() - began
        assert took < SLOWEST, f"{target.name}: {took:.1f} s"
    return counts


# --- damages ----------------------------------------------------------------------------------


def _place(content: bytes, rng: np.random.Generator) -> int:
    return int(rng.integers(len(content) + 1))


def _truncate(content: bytes, rng: np.random.Generator) -> bytes:
    return content[: _place(content, rng)]


def _cut(content: bytes, rng: np.random.Generator) -> bytes:
    at = _place(content, rng)
    return content[:at] + content[at + int(rng.integers(1, 30)) :]


def _flip(content: bytes, rng: np.random.Generator) -> bytes:
    if not content:
        return content
    changed = bytearray(content)
    for _ in range(int(rng.integers(1, 4))):
        changed[int(rng.integers(len(changed)))] = int(rng.integers(256))
    return bytes(changed)


def _digit(content: bytes, rng: np.random.Generator) -> bytes:
    places = [m.start() for m in re.finditer(rb"\d", content)]
    if not places:
        return content
    at = places[int(rng.integers(len(places)))]
    return content[:at] + bytes([48 + int(rng.integers(10))]) + content[at + 1 :]


def _scrap(content: bytes, rng: np.random.Generator) -> bytes:
    at = _place(content, rng)
    return content[:at] + _SCRAPS[int(rng.integers(len(_SCRAPS)))].encode() + content[at:]


def _cell(content: bytes, rng: np.random.Generator) -> bytes:
    """Put a scrap in place of a whole cell."""
    parts = re.split(rb"([,;\t\n])", content)
    at = 2 * int(rng.integers((len(parts) + 1) // 2))
    parts[at] = _SCRAPS[int(rng.integers(len(_SCRAPS)))].encode()
    return b"".join(parts)


def _lines(content: bytes, rng: np.random.Generator) -> bytes:
    lines = content.split(b"\n")
    i, j = (int(rng.integers(len(lines))) for _ in range(2))
    kind = int(rng.integers(4))
    if kind == 0:
        lines[i], lines[j] = lines[j], lines[i]
    elif kind == 1:
        lines.insert(i, lines[j])
    elif kind == 2:
        del lines[i]
    else:
        lines = [lines[k] for k in rng.permutation(len(lines))]
    return b"\n".join(lines)


def _shuffle(content: bytes, rng: np.random.Generator) -> bytes:
    at = _place(content, rng)
    some = bytearray(content[at : at + 40])
    rng.shuffle(some)  # type: ignore[arg-type]
    return content[:at] + bytes(some) + content[at + 40 :]


def _encode(content: bytes, rng: np.random.Generator) -> bytes:
    name = ("utf-16", "utf-16-le", "utf-32", "latin-1", "utf-7")[int(rng.integers(5))]
    text = content.decode("utf-8", "replace") + "é"
    return text.encode(name, "replace")


def _ends(content: bytes, rng: np.random.Generator) -> bytes:
    kind = int(rng.integers(6))
    if kind == 0:
        return b"\xef\xbb\xbf" + content
    if kind == 1:
        return content + (b"\n", b"\r\n", b"  \n", b",,,,\n", b";;;;\n")[int(rng.integers(5))] * 3
    if kind == 2:
        return content.replace(b"\r\n", b"\n").replace(b"\n", b"\r")
    if kind == 3:
        return b"\n \n" + content
    return content.replace(b"\r\n", b"\n").replace(b"\n", b"\r\n")


def _locale(content: bytes, rng: np.random.Generator) -> bytes:
    kind = int(rng.integers(4))
    if kind == 0:
        return content.replace(b",", b";").replace(b".", b",")
    if kind == 1:
        return content.replace(b";", b",")
    if kind == 2:
        return content.replace(b".", b",", int(rng.integers(1, 9)))
    return content.replace(b",", (b";", b"\t", b"|", b", ")[int(rng.integers(4))])


_DAMAGES = (
    *(_truncate, _cut, _flip, _digit, _digit, _scrap, _scrap, _cell, _cell, _cell, _lines),
    *(_shuffle, _encode, _ends, _ends, _locale, _locale),
)


def inside_zip(content: bytes, rng: np.random.Generator) -> bytes:
    """Damage one member of a zip archive, or the archive."""
    if rng.integers(4) == 0:
        return mutants(content, rng)
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as old, zipfile.ZipFile(out, "w") as new:
        names = old.namelist()
        sheets = [i for i, name in enumerate(names) if "sheet" in name or "shared" in name]
        which = sheets if rng.integers(4) else range(len(names))
        hit = names[which[int(rng.integers(len(which)))]]
        for name in names:
            data = old.read(name)
            new.writestr(name, mutants(data, rng) if name == hit else data)
    return out.getvalue()


# --- what stands in a mutant, read as plainly as can be ----------------------------------------


def plain_rows(content: bytes, messages: str) -> list[dict[str, str]]:
    """Return the cells of a text file by header."""
    separator = {"tab": "\t", "';'": ";", "','": ",", "'|'": "|"}[
        re.search(r"separator (tab|';'|','|'\|')", messages).group(1)  # type: ignore[union-attr]
    ]
    encoding = "cp1252" if "read as Windows-1252" in messages else "utf-8-sig"
    text = content.decode(encoding).lstrip("\ufeff")
    records = list(csv.reader(io.StringIO(text, newline=""), delimiter=separator))
    records = [one for one in records if any(cell.strip() for cell in one)]
    header = [" ".join(name.split()) for name in records[0]]
    beyond = [cell for one in records[1:] for cell in one[len(header) :] if cell.strip()]
    assert not beyond, f"cells beyond the header: {beyond}"
    return [dict(zip(header, one[: len(header)], strict=True)) for one in records[1:]]


def number(cell: str, messages: str) -> float:
    mark = re.search(r"decimal (point|comma)", messages).group(1)  # type: ignore[union-attr]
    if thousands := re.search(r"decimal \w+, '(.)' between thousands", messages):
        cell = cell.replace(thousands.group(1), "")
    assert not (mark == "point" and "," in cell), cell
    return float(cell.replace(",", ".")) if cell.strip() else float("nan")


def _value(row: dict[str, str], words: str, messages: str) -> float:
    """Return a number in SI units by the header's unit in brackets."""
    if guess := re.search(
        rf"^{words}: column (['\"])(.*)\1, guessed from its header$", messages, re.M
    ):
        words = guess.group(2)
    for header, cell in row.items():
        match = re.fullmatch(rf"{re.escape(words)}(?:\s*\[([^\]]*)\])?", header)
        if match is not None:
            unit = match.group(1) or "1"
            one = 1.0 if unit in ("1", "-") else _units()(unit).to_base_units().magnitude
            return number(cell, messages) * float(one)
    return float("nan")


def _same(found: Imported, plain: list[tuple[float, ...]]) -> str:
    names = ["a_over_R", "b_over_R", "Q", "p_over_E"]
    table = np.column_stack([found.table.column(name) for name in names]).astype(float)
    want = np.array(plain, dtype=float)
    # The exact quotient of decimals against floats in sequence: 1e-12.
    if table.shape != want.shape or not np.allclose(table, want, rtol=1e-12, atol=0):
        return f"the file has {plain[:3]}, the table {table[:3].tolist()}"
    return ""


def _long(content: bytes, found: Imported) -> str:
    messages = "\n".join(found.messages)
    rows = []
    for row in plain_rows(content, messages):
        R, E, a, b, line = (
            _value(row, name, messages) for name in ("Radius", "E", "Ridge", "Groove", "P")
        )
        rows.append((a / R, b / R, _value(row, "Q", messages), line / (2 * R * E)))
    return _same(found, rows)


def _contract(content: bytes, found: Imported) -> str:
    messages = "\n".join(found.messages)
    names = ("a_over_R", "b_over_R", "Q", "p_over_E")
    rows = [
        tuple(_value(r, name, messages) for name in names) for r in plain_rows(content, messages)
    ]
    rows, low = [row for row in rows if row[2] not in (0, 2)], [row[2] in (0, 2) for row in rows]
    if sum(low) and f"{sum(low)} rows of Q under 4 ignored" not in messages:
        return f"{sum(low)} rows of Q under 4 are dropped in silence"
    return _same(found, rows)


def _wide(content: bytes, found: Imported) -> str:
    messages = "\n".join(found.messages)
    rows = []
    for row in plain_rows(content, messages):
        loads = {
            int(m.group(1)): number(cell, messages)
            for header, cell in row.items()
            if (m := re.fullmatch(r"Q[\s_]*=?[\s_]*(\d{1,6})", header)) and cell.strip()
        }
        a, b = (_value(row, name, messages) for name in ("a_over_R", "b_over_R"))
        rows += [(a, b, Q, loads[Q]) for Q in sorted(loads)]
    return _same(found, rows)


def _history(content: bytes, found: Imported) -> str:
    messages = "\n".join(found.messages)
    loads = {_value(row, "p_over_E", messages) for row in plain_rows(content, messages)} | {0.0}
    ends = {
        *found.table.column("p_over_E").tolist(),
        *found.table.column("p_over_E_lower").tolist(),
    }
    return f"{ends - loads} are no loads of the file" if not ends <= loads else ""


def _as_pyarrow(content: bytes, found: Imported) -> str:
    rows = [
        (row["a [mm]"] / 8, row["b [mm]"] / 8, row["Q"], row["p [kPa]"] / 60)
        for row in pyarrow.parquet.read_table(io.BytesIO(content)).to_pylist()
    ]
    return _same(found, rows)


def _in_sheet(content: bytes, found: Imported) -> str:
    """Every number of the table stands in some member of the workbook."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        text = b"\n".join(archive.read(name) for name in archive.namelist() if "xl/" in name)
    there = set()
    for token in re.findall(rb"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?", text):
        there.add(float(token))
    for name in ("a_over_R", "b_over_R", "Q", "p_over_E"):
        for value in found.table.column(name):
            if float(value) not in there:
                return f"{name} = {value} is not in the file"
    return ""


# --- the files --------------------------------------------------------------------------------

_P = {4: "0.0021", 6: "0.0087", 8: "0.0195"}
_TEXTURES = (("0.24", "0.08"), ("0.256", "0.1"), ("0.1", "0.3"))
_LONG = "Ridge [mm],Groove [mm],Radius [mm],E [kPa],Q,P [N/mm],Note\n" + "".join(
    f"{a},{b},8,60,{Q},{p},x{Q}\n" for a, b in _TEXTURES for Q, p in _P.items()
)
_MAP = {"a": "Ridge", "b": "Groove", "R": "Radius", "E": "E", "line": "P"}
_CONTRACT = "a_over_R,b_over_R,Q,p_over_E,nu,series\n" + "".join(
    f"{a},{b},{Q},{p},0.49,s1\n" for a, b in _TEXTURES for Q, p in _P.items()
)
_WIDE = "a_over_R,b_over_R,Q=4,Q=6,Q=8\n" + "".join(
    f"{a},{b},0.001,0.004,{last}\n"
    for (a, b), last in zip(_TEXTURES, ("", "0.01", ""), strict=True)
)
_HISTORY = "a_over_R,b_over_R,p_over_E,gap Q=4,status Q=6\n" + "".join(
    f"{a},{b},{i / 1000},{0.01 - 0.003 * i:.4g},{'open' if i < 6 else 'closed'}\n"
    for a, b in _TEXTURES
    for i in range(1, 9)
)


def _workbook() -> bytes:
    import openpyxl

    book = openpyxl.Workbook()
    rows = list(csv.reader(io.StringIO(_CONTRACT)))
    book.active.append(rows[0])
    for row in rows[1:]:
        book.active.append([*map(float, row[:5]), row[5]])
    out = io.BytesIO()
    book.save(out)
    return out.getvalue()


def _parquet() -> bytes:
    rows = [
        {"a [mm]": float(a), "b [mm]": float(b), "Q": Q, "p [kPa]": float(p), "series": "s1"}
        for a, b in _TEXTURES
        for Q, p in _P.items()
    ]
    out = io.BytesIO()
    pd.DataFrame(rows).to_parquet(out, index=False)
    return out.getvalue()


def _columns(path: Path) -> Imported:
    return imported(path)


def _mapped(path: Path) -> Imported:
    return imported(path, _MAP)


_EURO = _LONG.replace(",", ";").replace(".", ",").encode()
for _one in (
    Target("columns, units", "long.csv", _LONG.encode(), _mapped, _long),
    Target("columns, decimal commas", "euro.csv", _EURO, _mapped, _long),
    Target("columns, tabs", "long.tsv", _LONG.replace(",", "\t").encode(), _mapped, _long),
    Target("columns, contract", "rows.csv", _CONTRACT.encode(), _columns, _contract),
    Target("columns, wide", "wide.csv", _WIDE.encode(), _columns, _wide),
    Target(
        "columns, history",
        "history.csv",
        _HISTORY.encode(),
        lambda path: imported(path, brackets=True),
        _history,
    ),
    Target("columns, Excel", "book.xlsx", _workbook(), _columns, _in_sheet, inside_zip),
    Target(
        "columns, Parquet",
        "rows.parquet",
        _parquet(),
        lambda path: imported(path, R="8 mm", E="60 kPa"),
        _as_pyarrow,
    ),
):
    register(_one)


# --- runs: what they print of a rim ------------------------------------------------------------
# A damaged digit of a displacement makes another run that is as good: it is only asked that no
# mutant ends otherwise than in a table or in words.

_WRITER = runpy.run_path(str(Path(__file__).with_name("abaqus_writer.py")))
_RUN = _WRITER["pressed"](n_level=12, n_node=41)
_ARRAYS = (_RUN["force"], _RUN["nodes"], _RUN["position"])
_BODY = RunBody(_RUN["a"], _RUN["b"])
_DECK = _WRITER["deck_text"](_RUN)
_SETS = {"surface": "RIM", "reaction": "TOP"}


def _doubt_run(content: bytes, found: Imported) -> str:
    """Return words for rows that no run could give."""
    frame = found.table.frame
    load, Q = frame["p_over_E"].to_numpy(), frame["Q"].to_numpy()
    is_rising = bool((np.diff(load) > 0).all()) and bool((np.diff(Q) > 0).all())
    is_one = is_rising and np.isfinite(load).all() and len(found.table.textures) == 1
    return "" if is_one and (Q % 2 == 0).all() else f"Q = {Q.tolist()} at {load.tolist()}"


def _beside(path: Path, name: str, text: str) -> Path:
    other = path.with_name(name)
    other.write_text(text)
    return other


def _calculix(path: Path) -> Imported:
    return read_calculix(path, _BODY, deck=_beside(path, "whole.inp", _DECK), **_SETS)


def _calculix_deck(path: Path) -> Imported:
    run = _beside(path, "whole.dat", _WRITER["calculix_text"](*_ARRAYS))
    try:
        return read_calculix(run, _BODY, deck=path, **_SETS)
    except InputError as error:
        # What a damaged deck does to a run may be told of the run.
        raise InputError(str(error).replace("whole.dat", path.name)) from None


def _abaqus_dat(path: Path) -> Imported:
    return read_abaqus_dat(path, _BODY, deck=_beside(path, "whole.inp", _DECK), **_SETS)


def _abaqus_rpt(path: Path) -> Imported:
    return read_abaqus_rpt(path, _BODY, deck=_beside(path, "whole.inp", _DECK))


for _one in (
    Target(
        "calculix", "run.dat", _WRITER["calculix_text"](*_ARRAYS).encode(), _calculix, _doubt_run
    ),
    Target("deck", "run.inp", _DECK.encode(), _calculix_deck, _doubt_run),
    Target(
        "abaqus .dat", "run.dat", _WRITER["dat_text"](*_ARRAYS).encode(), _abaqus_dat, _doubt_run
    ),
    Target(
        "abaqus .rpt", "run.rpt", _WRITER["rpt_text"](*_ARRAYS).encode(), _abaqus_rpt, _doubt_run
    ),
):
    register(_one)


# --- deformed meshes ---------------------------------------------------------------------------
# Small, and laid out as meshio does it: a rim to the mid-plane, and nodes inside.


_STATES = [4, 5, 6, 7]  # of eight: two ends of brackets, and a load between the last two


def _deformed() -> dict[str, Any]:
    run = _WRITER["pressed"](n_level=8, n_node=41)
    outer = np.linspace(0.9, np.pi / 2, 5)[1:]
    outer = run["R"] * np.column_stack([np.sin(outer), -np.cos(outer)])
    points = np.vstack([run["nodes"], outer, 0.5 * run["nodes"][::8]])
    moved = np.zeros((len(_STATES), *points.shape))
    moved[:, : len(run["nodes"])] = (run["position"] - run["nodes"])[_STATES]
    p = run["force"][_STATES] / (run["R"] * run["E"])
    return {**run, "points": points, "moved": moved, "p": p}


_SERIES = _deformed()
_CORNERED = RunBody(_SERIES["a"], _SERIES["b"], top=_SERIES["top"])
_HIT = 1  # the state whose file is damaged


def _in_space(plane: np.ndarray) -> np.ndarray:
    return np.column_stack([plane, np.zeros(len(plane))])


def _xdmf_files(data_format: str) -> tuple[bytes, bytes]:
    """Return an XDMF series, and the HDF5 file beside it."""
    here = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)  # the writer puts its .h5 into the current folder
        try:
            with meshio.xdmf.TimeSeriesWriter("run.xdmf", data_format=data_format) as writer:
                cells = [("line", np.array([[0, 1]]))]
                writer.write_points_cells(_in_space(_SERIES["points"]), cells)
                for p, moved in zip(_SERIES["p"], _SERIES["moved"], strict=True):
                    writer.write_data(float(p), point_data={"displacement": _in_space(moved)})
            beside = b""
            if data_format == "HDF":
                with h5py.File("run.h5", "r+") as file:  # some as they come, some packed
                    for name in ("data3", "data5"):
                        values = file.pop(name)[()]
                        file.create_dataset(name, data=values, compression="gzip")
                beside = Path("run.h5").read_bytes()
            return Path("run.xdmf").read_bytes(), beside
        finally:
            os.chdir(here)


def _vtu(state: int, dtype: type = float, **options: Any) -> bytes:
    data = {"displacement": _in_space(_SERIES["moved"][state]).astype(dtype)}
    cells = [("line", np.array([[0, 1]]))]
    mesh = meshio.Mesh(_in_space(_SERIES["points"]), cells, point_data=data)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "one.vtu"
        with contextlib.redirect_stderr(io.StringIO()):  # a warning of ASCII's size
            meshio.vtu.write(path, mesh, **options)
        return path.read_bytes()


def _appended(content: bytes) -> bytes:
    """Return a VTU file with points and displacements behind the mesh, as ParaView has them."""
    packed = b""
    for name in (b"Points", b"displacement"):
        found = re.search(rb'(Name="%b"[^>]*format=)"binary">\s*([^<\s]+)\s*<' % name, content)
        assert found is not None
        new = b'%b"appended" offset="%d"><' % (found[1], len(packed))
        content, packed = content.replace(found[0], new), packed + found[2]
    data = b'<AppendedData encoding="base64">_%b</AppendedData>\n</VTKFile>' % packed
    return content.replace(b"</VTKFile>", data)


def inside_xml(content: bytes, rng: np.random.Generator) -> bytes:
    """Damage text, an attribute, or an array under base64, which seldom outlives other damage."""
    return (mutants, mutants, _attribute, _array)[int(rng.integers(4))](content, rng)


def _attribute(content: bytes, rng: np.random.Generator) -> bytes:
    """Put another attribute's value, a number or a scrap in place of an attribute's."""
    places = list(re.finditer(rb'="([^"]*)"', content))
    if not places:
        return content
    at, other = (places[int(rng.integers(len(places)))] for _ in range(2))
    words = b"0|1|2|3|4|-1|8|0 3|999999999999|Float32|UInt8|UInt64|Int32|BigEndian|XY|1e308".split(
        b"|"
    )
    scrap = html.escape(_SCRAPS[int(rng.integers(len(_SCRAPS)))]).encode()
    new = (other[1], words[int(rng.integers(len(words)))], scrap)[int(rng.integers(3))]
    return content[: at.start(1)] + new + content[at.end(1) :]


def _array(content: bytes, rng: np.random.Generator) -> bytes:
    """Change numbers that are packed, and pack them again; or letters of the package."""
    heads = list(re.finditer(rb"[\w+/]{22}==", content)) if b"compressor=" in content else []
    if heads and rng.integers(3):
        head = heads[int(rng.integers(len(heads)))]
        sizes = np.frombuffer(base64.b64decode(head[0]), dtype="<u4").copy()
        to = head.end() + 4 * math.ceil(int(sizes[3]) / 3)
        try:
            plain = zlib.decompress(base64.b64decode(content[head.end() : to]))
        except (ValueError, zlib.error):  # what looked like a header was none
            return mutants(content, rng)
        packed = zlib.compress(mutants(plain, rng))
        sizes[3] = len(packed)
        new = base64.b64encode(sizes.tobytes()) + base64.b64encode(packed)
        return content[: head.start()] + new + content[to:]
    places = [m.span() for m in re.finditer(rb"[\w+/]{40,}", content)]
    if not places:
        return mutants(content, rng)
    changed = bytearray(content)
    for _ in range(int(rng.integers(1, 4))):
        start, end = places[int(rng.integers(len(places)))]
        letters = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/="
        changed[int(rng.integers(start, end))] = letters[int(rng.integers(65))]
    return bytes(changed)


def _series_beside(path: Path) -> Imported:
    """Read a series whose HDF5 file is damaged."""
    series = path.with_name("run.xdmf")
    if not series.exists():
        series.write_bytes(_XDMF)
    try:
        return read_series(series, _CORNERED)
    except InputError as error:
        # What damaged numbers make of a series may be told of the series.
        raise InputError(str(error).replace("run.xdmf", path.name)) from None


def _xdmf(path: Path) -> Imported:
    beside = path.with_name("run.h5")
    if not beside.exists():
        beside.write_bytes(_H5)
    try:
        # States of a whole file rest on the ridges: with the numbers beside, that is the same top.
        return read_series(path, _CORNERED if path.stem == "text" else replace(_CORNERED, top=None))
    except InputError as error:
        # A path into the HDF5 file that is none is told of that file.
        raise InputError(str(error).replace("run.h5", path.name)) from None


def _vtus(path: Path, others: Sequence[bytes]) -> Imported:
    """Read a list of which one file is damaged."""
    paths = [path.with_name(f"{k}.vtu") for k in range(len(others))]
    for k, (one, content) in enumerate(zip(paths, others, strict=True)):
        if k != _HIT and not one.exists():
            one.write_bytes(content)
    try:
        return read_series(paths, _CORNERED, loads=_SERIES["p"].tolist())
    except InputError as error:
        # What states make together is told of the first file; what is in one file, of that.
        alone = "displacement" in str(error) or "numbers" in str(error)
        raise InputError(str(error) if alone else str(error).replace("0.vtu", path.name)) from None


_XDMF, _H5 = _xdmf_files("HDF")
_VTUS = {
    "series, VTU ascii": [_vtu(k, np.float32, binary=False) for k in range(len(_STATES))],
    "series, VTU binary": [_vtu(k, compression=None) for k in range(len(_STATES))],
    "series, VTU appended": [_appended(_vtu(k)) for k in range(len(_STATES))],
}
for _one in (
    Target("series, XDMF", "run.xdmf", _XDMF, _xdmf, _doubt_run, inside_xml),
    Target(
        "series, XDMF of text", "text.xdmf", _xdmf_files("XML")[0], _xdmf, _doubt_run, inside_xml
    ),
    Target("series, HDF5", "run.h5", _H5, _series_beside, _doubt_run),
    *(
        Target(
            name,
            f"{_HIT}.vtu",
            files[_HIT],
            functools.partial(_vtus, others=files),
            _doubt_run,
            inside_xml,
        )
        for name, files in _VTUS.items()
    ),
):
    register(_one)


def _pvd_text() -> bytes:
    """Return a collection of the states' files, with their loads."""
    lines = [
        f'<DataSet timestep="{p!r}" part="0" file="{k}.vtu"/>'
        for k, p in enumerate(_SERIES["p"].tolist())
    ]
    head = '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1"><Collection>'
    return "\n".join([head, *lines, "</Collection></VTKFile>\n"]).encode()


def _pvd(path: Path) -> Imported:
    for k, content in enumerate(_VTUS["series, VTU binary"]):
        if not (one := path.with_name(f"{k}.vtu")).exists():
            one.write_bytes(content)
    texture = (_SERIES["a"], _SERIES["b"])
    given = Given(texture=texture, nu="0.5", top=_SERIES["top"], time="p_over_E")
    try:
        return import_files([path], given)
    except InputError as error:  # a file that is not there, or states in another order
        raise InputError(re.sub(r"\b[^/\s]*\.vtu\b", path.name, str(error))) from None


register(Target("series, PVD", "run.pvd", _pvd_text(), _pvd, _doubt_run, inside_xml))


# --- CalculiX's contact print and status ---------------------------------------------------------

_TESTS = Path(__file__).parent
# Wide ridges under few faces: each mutant is read line by line.
_FEW = _WRITER["pressed"](a=0.12, b=0.05, n_level=8, depth=0.12, n_node=21)
_FEW_DECK = _WRITER["deck_text"](_FEW)
_CONTACT_PRINT = runpy.run_path(str(_TESTS / "test_calculix_contact.py"))["dat_text"](_FEW)
_STA = "".join(
    f"     1 {k:10d}     1     9  {time}  {time}  0.100000E+00\n"
    for k, time in enumerate(dict.fromkeys(re.findall(r"time +(\S+)", _CONTACT_PRINT)), start=1)
)


def _contact(path: Path, sta: Path | None = None) -> Imported:
    deck = path.with_name("whole.inp")
    if not deck.exists():
        deck.write_text(_FEW_DECK)
    try:
        return read_calculix_contact(
            path, RunBody(_FEW["a"], _FEW["b"]), deck=deck, sta=sta, **_SETS
        )
    except InputError as error:
        # An element that is not in the deck is told of the deck.
        raise InputError(str(error).replace("whole.inp", (sta or path).name)) from None


# --- FEBio's logs, ANSYS's listings, CalculiX's .frd ----------------------------------------------

_PROGRAMS = runpy.run_path(str(_TESTS / "test_programs.py"))
_FEW_NODES = range(1, len(_FEW["nodes"]) + 1)
_FEW_GIVEN = Given(texture=(_FEW["a"], _FEW["b"]), nu="0.5", E="1", R="1", top=_FEW["top"])
_FEBIO = _PROGRAMS["febio"](_FEW["position"], "x;y") + _PROGRAMS["febio"](
    -_FEW["force"][:, None, None], "Fy"
)
_REACTIONS = np.stack([0 * _FEW["force"], -_FEW["force"]], axis=1)[:, None]
_ANSYS = (
    _PROGRAMS["listing"](_FEW_NODES, _FEW["position"] - _FEW["nodes"], ("UX", "UY"))
    + _PROGRAMS["listing"]([900], _REACTIONS, ("FX", "FY"))
    + _PROGRAMS["places"](_FEW_NODES, _FEW["nodes"])
)


_NODES = "step,load,node,x,gap\n" + "".join(
    f"{k},{-force:.9g},{node},{x:.9g},{y - _FEW['top']:.9g}\n"
    for k, (force, at) in enumerate(zip(_FEW["force"], _FEW["position"], strict=True), start=1)
    for node, (x, y) in enumerate(at.tolist(), start=1)
)


def _program(path: Path) -> Imported:
    if path.suffix == ".frd":
        path.with_suffix(".inp").write_text(_FEW_DECK)
        given = replace(_FEW_GIVEN, surface="RIM", reaction="TOP", top=None)
    else:
        given = replace(_FEW_GIVEN, top=None) if path.suffix == ".csv" else _FEW_GIVEN
    names = {".frd": "calculix", ".txt": "febio", ".lis": "ansys", ".csv": "nodes"}
    name = names[path.suffix]
    return import_files([path], given, program=name)


for _one in (
    Target("nodes", "nodes.csv", _NODES.encode(), _program, _doubt_run),
    Target("febio", "run.txt", _FEBIO.encode(), _program, _doubt_run),
    Target("ansys", "run.lis", _ANSYS.encode(), _program, _doubt_run),
    Target("frd", "run.frd", _PROGRAMS["frd"](run=_FEW).encode(), _program, _doubt_run),
):
    register(_one)


def _status(path: Path) -> Imported:
    run = _beside(path, "whole.dat", _CONTACT_PRINT)
    return _contact(run, sta=path)


for _one in (
    Target("contact print", "run.dat", _CONTACT_PRINT.encode(), _contact, _doubt_run),
    Target("status", "run.sta", _STA.encode(), _status, _doubt_run),
):
    register(_one)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--n", type=int, default=100_000, help="mutants in all")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="targets whose names hold this")
    options = parser.parse_args()
    warnings.simplefilter("error")
    chosen = [one for one in TARGETS.values() if options.only in one.name]
    for i, target in enumerate(chosen):
        rng = np.random.default_rng([options.seed, i])
        folder = Path(tempfile.mkdtemp())
        try:
            counts = attack(target, options.n // len(chosen), rng, folder)
        except BaseException:
            print(f"{target.name}: see {folder / target.file_name}")
            raise
        print(f"{target.name}: {dict(counts)}")


if __name__ == "__main__":
    main()
