"""Damaged files against importers: refused in words, or read as what then stands in them.

Run at length: ``python -m tests.fea.fuzzing --n 100000 --seed 1``. Another importer joins by
a kind of `tests.fea.runs`, or a `Target`.
"""

import argparse
import base64
import csv
import functools
import html
import io
import math
import re
import tempfile
import time
import warnings
import zipfile
import zlib
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pint
import pyarrow.parquet

from ridgebayes import InputError
from ridgebayes.fea.read import import_files
from ridgebayes.fea.record import Given, Imported
from ridgebayes.runtime.text import count
from tests.fea import runs

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
    doubt: Callable[[bytes, Any], str]
    mutate: Callable[[bytes, np.random.Generator], bytes] | None = None


@functools.cache  # reading its definitions takes as long as collecting a hundred tests
def _units() -> pint.UnitRegistry:
    return pint.UnitRegistry()


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
            assert str(folder) in text, f"{target.name}: no file in {text!r}"
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


def _any(some: Any, rng: np.random.Generator) -> Any:
    return some[int(rng.integers(len(some)))]


def _cut(content: bytes, rng: np.random.Generator) -> bytes:
    start = int(rng.integers(len(content) + 1))
    return content[:start] + content[start + _any((1, 5, 30, len(content)), rng) :]


def _flip(content: bytes, rng: np.random.Generator) -> bytes:
    changed = bytearray(content or b" ")
    for _ in range(int(rng.integers(1, 4))):
        changed[int(rng.integers(len(changed)))] = int(rng.integers(256))
    return bytes(changed)


def _digit(content: bytes, rng: np.random.Generator) -> bytes:
    at = _any([m.start() for m in re.finditer(rb"\d", content)] or [0], rng)
    return content[:at] + bytes([48 + int(rng.integers(10))]) + content[at + 1 :]


def _scrap(content: bytes, rng: np.random.Generator) -> bytes:
    at = int(rng.integers(len(content) + 1))
    return content[:at] + _any(_SCRAPS, rng).encode() + content[at:]


def _cell(content: bytes, rng: np.random.Generator) -> bytes:
    """Put a scrap in place of a whole cell."""
    parts = re.split(rb"([,;\t\n])", content)
    parts[2 * int(rng.integers((len(parts) + 1) // 2))] = _any(_SCRAPS, rng).encode()
    return b"".join(parts)


def _lines(content: bytes, rng: np.random.Generator) -> bytes:
    lines = content.split(b"\n")
    i, j, kind = (int(rng.integers(n)) for n in (len(lines), len(lines), 4))
    if kind == 0:
        lines[i], lines[j] = lines[j], lines[i]
    elif kind == 1:
        lines.insert(i, lines[j])
    elif kind == 2:
        del lines[i]
    else:
        lines = [lines[k] for k in rng.permutation(len(lines))]
    return b"\n".join(lines)


def _encode(content: bytes, rng: np.random.Generator) -> bytes:
    text = content.decode("utf-8", "replace") + "é"
    return text.encode(_any(("utf-16", "utf-16-le", "utf-32", "latin-1", "utf-7"), rng), "replace")


def _ends(content: bytes, rng: np.random.Generator) -> bytes:
    line_end = _any((b"\r", b"\r\n"), rng)
    ends = b"\n|\r\n|  \n|,,,,\n|;;;;\n".split(b"|")
    return _any(
        (
            b"\xef\xbb\xbf" + content,
            content + _any(ends, rng) * 3,
            b"\n \n" + content,
            content.replace(b"\r\n", b"\n").replace(b"\n", line_end),
        ),
        rng,
    )


def _locale(content: bytes, rng: np.random.Generator) -> bytes:
    return _any(
        (
            content.replace(b",", b";").replace(b".", b","),
            content.replace(b";", b","),
            content.replace(b".", b",", int(rng.integers(1, 9))),
            content.replace(b",", _any((b";", b"\t", b"|", b", "), rng)),
        ),
        rng,
    )


_DAMAGES = (_cut, _flip, _digit, _scrap, _cell, _cell, _lines, _encode, _ends, _ends, _locale)


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
    if content[:2] in (b"\xff\xfe", b"\xfe\xff"):
        encoding = "utf-16"
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
    messages, names = "\n".join(found.messages), ("Ridge", "Groove", "Radius", "E", "Q", "P")
    rows = [
        [_value(row, name, messages) for name in names] for row in plain_rows(content, messages)
    ]
    return _same(found, [(a / R, b / R, Q, P / (2 * R * E)) for a, b, R, E, Q, P in rows])


def _contract(content: bytes, found: Imported) -> str:
    messages = "\n".join(found.messages)
    names = ("a_over_R", "b_over_R", "Q", "p_over_E")
    rows = [
        tuple(_value(r, name, messages) for name in names) for r in plain_rows(content, messages)
    ]
    rows, low = [row for row in rows if row[2] not in (0, 2)], [row[2] in (0, 2) for row in rows]
    if sum(low) and f"{count(sum(low), 'row')} of Q under 4 ignored" not in messages:
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
_CONTRACT = "a_over_R,b_over_R,Q,p_over_E,nu,series\n" + "".join(
    f"{a},{b},{Q},{p},0.49,s1\n" for a, b in _TEXTURES for Q, p in _P.items()
)
_WIDE = "a_over_R,b_over_R,Q=4,Q=6,Q=8\n" + "".join(
    f"{a},{b},0.001,0.004,{last}\n"
    for (a, b), last in zip(_TEXTURES, ("", "0.01", ""), strict=True)
)
_HISTORY = "a_over_R,b_over_R,p_over_E,status Q=4,status Q=6\n" + "".join(
    f"{a},{b},{i / 1000},{int(i > 3)},{'open' if i < 6 else 'closed'}\n"
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


def _table(**given: Any) -> Callable[[Path], Imported]:
    return lambda path: import_files([path], Given(**given), program="table")


_EURO = _LONG.replace(",", ";").replace(".", ",").encode()
_MAPPED = _table(map=("a=Ridge", "b=Groove", "R=Radius", "E=E", "line=P"))
_TABLES = (
    Target("columns, units", "long.csv", _LONG.encode(), _MAPPED, _long),
    Target("columns, decimal commas", "euro.csv", _EURO, _MAPPED, _long),
    Target("columns, tabs", "long.tsv", _LONG.replace(",", "\t").encode(), _MAPPED, _long),
    Target("columns, contract", "rows.csv", _CONTRACT.encode(), _table(), _contract),
    Target("columns, wide", "wide.csv", _WIDE.encode(), _table(), _wide),
    Target("columns, history", "h.csv", _HISTORY.encode(), _table(), _history),
    Target("columns, Excel", "book.xlsx", _workbook(), _table(), _in_sheet, inside_zip),
    Target("columns, Parquet", "r.parquet", _parquet(), _table(R="8 mm", E="60 kPa"), _as_pyarrow),
)


# --- runs: what they print of a rim ------------------------------------------------------------
# A damaged digit of a displacement makes another run that is as good: it is only asked that no
# mutant ends otherwise than in a table or in words. Ridges are wide under few faces: each mutant
# is read line by line.

RUN = runs.pressed(a=0.12, b=0.05, n_level=8, depth=0.12, n_node=21)


def _doubt_run(content: bytes, found: Imported) -> str:
    """Return words for rows that no run could give."""
    frame = found.table.frame
    load, Q = frame["p_over_E"].to_numpy(), frame["Q"].to_numpy()
    is_rising = bool((np.diff(load) > 0).all()) and bool((np.diff(Q) > 0).all())
    is_one = is_rising and np.isfinite(load).all() and len(found.table.textures) == 1
    return "" if is_one and (Q % 2 == 0).all() else f"Q = {Q.tolist()} at {load.tolist()}"


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


def _read_run(path: Path, kind: str, files: dict[str, bytes]) -> Imported:
    """Read a run of which a file is damaged."""
    return runs.imported(path.parent, kind, run=RUN, files=files | {path.name: path.read_bytes()})


def _of_run(name: str, kind: str, hit: int, files: dict[str, Any]) -> Target:
    whole = {key: v if isinstance(v, bytes) else v.encode() for key, v in files.items()}
    file_name = list(whole)[hit]
    read = functools.partial(_read_run, kind=kind, files=whole)
    is_xml = file_name.endswith((".xdmf", ".vtu", ".pvd"))
    return Target(
        name, file_name, whole[file_name], read, _doubt_run, inside_xml if is_xml else mutants
    )


def _run_targets() -> list[Target]:
    files = {kind: make(RUN) for kind, make in runs.KINDS.items()}
    targets = [_of_run(kind, kind, 0, files[kind]) for kind in files]
    status = files["calculix"] | {"run.sta": runs.sta(RUN)}
    ascii_, plain, packed = (
        runs.vtus(RUN, np.float32, binary=False),
        runs.vtus(RUN, compression=None),
        {name: _appended(content) for name, content in runs.vtus(RUN).items()},
    )
    return [
        *targets,
        _of_run("deck", "calculix", 1, files["calculix"]),
        _of_run("status", "calculix", 2, status),
        _of_run("febio, force", "febio", 1, files["febio"]),
        _of_run("ansys, force", "ansys", 1, files["ansys"]),
        _of_run("ansys, places", "ansys", 2, files["ansys"]),
        _of_run("series, HDF5", "series", 1, files["series"]),
        *(
            _of_run(f"series, VTU {name}", "series, VTU", 1, states)
            for name, states in (("ascii", ascii_), ("binary", plain), ("appended", packed))
        ),
    ]


TARGETS = {target.name: target for target in (*_TABLES, *_run_targets())}


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
