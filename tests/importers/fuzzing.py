"""Damaged files against importers: refused in words, or read as what then stands in them.

Run at length: ``python -m tests.importers.fuzzing --n 100000 --seed 1``. Another importer joins by
`register`.
"""

import argparse
import csv
import io
import re
import runpy
import tempfile
import time
import warnings
import zipfile
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pint
import pyarrow.parquet

from ridgebayes.errors import InputError
from ridgebayes.importers.abaqus_dat import read_abaqus_dat
from ridgebayes.importers.abaqus_rpt import read_abaqus_rpt
from ridgebayes.importers.calculix import read_calculix
from ridgebayes.importers.columns import read_columns
from ridgebayes.importers.levels import Body
from ridgebayes.importers.record import Imported

SLOWEST = 5.0  # seconds that any file of this size may take
_UNITS = pint.UnitRegistry()
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
    read: Callable[[Path], Imported]
    doubt: Callable[[bytes, Imported], str] = lambda content, found: ""
    mutate: Callable[[bytes, np.random.Generator], bytes] | None = None


TARGETS: dict[str, Target] = {}


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
            assert found.said, target.name
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


def plain_rows(content: bytes, said: str) -> list[dict[str, str]]:
    """Return the cells of a text file by header."""
    separator = {"tab": "\t", "';'": ";", "','": ","}[
        re.search(r"separator (tab|';'|',')", said).group(1)  # type: ignore[union-attr]
    ]
    text = content.decode("utf-8-sig").removeprefix("\ufeff")
    records = list(csv.reader(io.StringIO(text, newline=""), delimiter=separator))
    records = [one for one in records if any(cell.strip() for cell in one)]
    header = [" ".join(name.split()) for name in records[0]]
    return [dict(zip(header, one, strict=True)) for one in records[1:]]


def number(cell: str, said: str) -> float:
    mark = re.search(r"decimal (point|comma)", said).group(1)  # type: ignore[union-attr]
    assert not (mark == "point" and "," in cell), cell
    return float(cell.replace(",", ".")) if cell.strip() else float("nan")


def _value(row: dict[str, str], words: str, said: str) -> float:
    """Return a number in SI units by the header's unit in brackets."""
    if guess := re.search(rf"^{words}: column (['\"])(.*)\1, a guess$", said, re.M):
        words = guess.group(2)
    for header, cell in row.items():
        match = re.fullmatch(rf"{re.escape(words)}(?:\s*\[([^\]]*)\])?", header)
        if match is not None:
            unit = match.group(1) or "1"
            one = 1.0 if unit in ("1", "-") else _UNITS(unit).to_base_units().magnitude
            return number(cell, said) * float(one)
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
    said = "\n".join(found.said)
    rows = []
    for row in plain_rows(content, said):
        R, E, a, b, line = (
            _value(row, name, said) for name in ("Radius", "E", "Ridge", "Groove", "P")
        )
        rows.append((a / R, b / R, _value(row, "Q", said), line / (2 * R * E)))
    return _same(found, rows)


def _contract(content: bytes, found: Imported) -> str:
    said = "\n".join(found.said)
    names = ("a_over_R", "b_over_R", "Q", "p_over_E")
    rows = [tuple(_value(r, name, said) for name in names) for r in plain_rows(content, said)]
    return _same(found, rows)


def _wide(content: bytes, found: Imported) -> str:
    said = "\n".join(found.said)
    rows = []
    for row in plain_rows(content, said):
        loads = {
            int(m.group(1)): number(cell, said)
            for header, cell in row.items()
            if (m := re.fullmatch(r"Q[\s_]*=?[\s_]*(\d{1,6})", header)) and cell.strip()
        }
        a, b = (_value(row, name, said) for name in ("a_over_R", "b_over_R"))
        rows += [(a, b, Q, loads[Q]) for Q in sorted(loads)]
    return _same(found, rows)


def _history(content: bytes, found: Imported) -> str:
    said = "\n".join(found.said)
    loads = {_value(row, "p_over_E", said) for row in plain_rows(content, said)} | {0.0}
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
    return read_columns(path)


def _mapped(path: Path) -> Imported:
    return read_columns(path, _MAP)


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
        lambda path: read_columns(path, brackets=True),
        _history,
    ),
    Target("columns, Excel", "book.xlsx", _workbook(), _columns, _in_sheet, inside_zip),
    Target(
        "columns, Parquet",
        "rows.parquet",
        _parquet(),
        lambda path: read_columns(path, values={"R": "8 mm", "E": "60 kPa"}),
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
_BODY = Body(_RUN["a"], _RUN["b"])
_DECK = _WRITER["deck_text"](_RUN)
_SETS = {"surface": "RIM", "reaction": "TOP"}


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
    Target("calculix", "run.dat", _WRITER["calculix_text"](*_ARRAYS).encode(), _calculix),
    Target("deck", "run.inp", _DECK.encode(), _calculix_deck),
    Target("abaqus .dat", "run.dat", _WRITER["dat_text"](*_ARRAYS).encode(), _abaqus_dat),
    Target("abaqus .rpt", "run.rpt", _WRITER["rpt_text"](*_ARRAYS).encode(), _abaqus_rpt),
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
