"""Files of loads as strangers keep them, each with the truth that it was made from.

Three textures of a cylinder of 8 mm and 60 kPa, written in many ways. What a file does not say is
in `Foreign.said`. `python -m tests.foreign_files [-o DIR]` writes them.
"""

import argparse
import io
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import openpyxl
import pandas as pd

import ridgebayes as rb

R, E, NU = 8.0, 0.06, 0.49  # mm, N/mm^2
TEXTURES = ((0.24, 0.08), (0.1, 0.08), (0.16, 0.24))  # mm
COUNTS = (4, 6, 8, 10)
BODY = {"R": "8 mm", "E": "60 kPa", "thickness": "20 mm"}
SCALE = 2 * R * E  # N/mm for p/E = 1


@dataclass(frozen=True)
class Foreign:
    """A file, and what is true of it.

    Parameters
    ----------
    name : str
        Of the file.
    content : bytes
        All of it.
    said : mapping of str to str
        What the file does not say: options by name.
    truth : DataFrame
        Columns a_over_R, b_over_R, Q, p_over_E and, of increments, p_over_E_lower.
    digits : float
        Relative rounding of the loads in the file.
    mistakes : tuple of str
        What the message has to name, all at once, of a file that breaks rules.
    """

    name: str
    content: bytes
    said: Mapping[str, str] = field(default_factory=dict)
    truth: pd.DataFrame = field(default_factory=pd.DataFrame)
    digits: float = 1e-9
    mistakes: tuple[str, ...] = ()


def true_rows(textures: Iterable[tuple[float, float]] = TEXTURES) -> pd.DataFrame:
    """Return the loads, of nine decimals in N/mm."""
    rows = []
    for a, b in textures:
        load = rb.Hybrid().load(np.array(COUNTS), a / R, b / R, np.array((1.348, 0.01583)), NU)
        for Q, p in zip(COUNTS, np.round(load * SCALE, 9), strict=True):
            rows.append((a, b, Q, float(p)))
    return pd.DataFrame(rows, columns=["a", "b", "Q", "line"])


def _truth(rows: pd.DataFrame) -> pd.DataFrame:
    return pd.DataFrame(
        {
            "a_over_R": rows["a"] / R,
            "b_over_R": rows["b"] / R,
            "Q": rows["Q"],
            "p_over_E": rows["line"] / SCALE,
        }
    )


def text(
    header: Sequence[str], rows: Iterable[Sequence[object]], separator: str = ",", mark: str = "."
) -> str:
    """Return lines of cells, numbers with a decimal mark."""

    def cell(value: object) -> str:
        return value if isinstance(value, str) else f"{value:.12g}".replace(".", mark)

    lines = [separator.join(header), *(separator.join(map(cell, row)) for row in rows)]
    return "\n".join(lines) + "\n"


def _long(
    name: str,
    header: str,
    *,
    separator: str = ",",
    mark: str = ".",
    width: float = 1.0,
    load: float = 1.0,
    count: float = 1.0,
    before: str = "",
    said: Mapping[str, str] = BODY,
    encoding: str = "utf-8",
    change: Callable[[str], str] = str,
    decimals: int | None = None,
) -> Foreign:
    """Return a file with a row for each load: widths, loads and counts in other units."""
    rows = true_rows()
    loads = rows["line"] * load
    if decimals is not None:
        loads = loads.round(decimals)
        rows["line"] = loads / load
    cells = zip(rows["a"] * width, rows["b"] * width, rows["Q"] * count, loads, strict=True)
    body = text(header.split("|"), cells, separator, mark)
    content = change(before + body).encode(encoding)
    return Foreign(name, content, said, _truth(rows), digits=1e-9)


def _wide(
    name: str,
    header: Sequence[str],
    *,
    separator: str = ",",
    mark: str = ".",
    units: str = "",
    before: str = "",
    said: Mapping[str, str] = BODY,
    empty: str = "",
    scale: float = 1.0,
) -> Foreign:
    """Return a file with a row for each texture; the last load of the last one is not there."""
    rows = true_rows()
    table = rows.pivot_table(index=["a", "b"], columns="Q", values="line", sort=False) * scale
    cells = [
        [a, b, *loads] for (a, b), loads in zip(table.index, table.to_numpy().tolist(), strict=True)
    ]
    cells[-1][-1] = empty
    body = text(header, cells, separator, mark)
    head, rest = body.split("\n", 1)
    content = f"{before}{head}\n{units}{rest}".encode()
    return Foreign(name, content, said, _truth(rows.iloc[:-1]))


def _increments(n: int = 25) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return loads and counts of load-stepped runs, and the brackets that they tell."""
    rows, truth = [], []
    for (a, b), some in true_rows().groupby(["a", "b"], sort=False):
        at = some["line"].to_numpy()
        loads = np.round(np.linspace(0, at[-1] * 1.02, n + 1)[1:], 6)
        counts = 2 + 2 * (loads[:, None] >= at).sum(axis=1)
        rows += [(a, b, p, int(Q)) for p, Q in zip(loads, counts, strict=True)]
        seen = 2
        for i, Q in enumerate(counts):
            if seen < Q:
                low = loads[i - 1] if i else 0.0
                truth.append((a / R, b / R, seen + 2, loads[i] / SCALE, low / SCALE))
                seen = Q
    names = ["a_over_R", "b_over_R", "Q", "p_over_E", "p_over_E_lower"]
    return pd.DataFrame(rows, columns=["a", "b", "line", "Q"]), pd.DataFrame(truth, columns=names)


def workbook(**sheets: Iterable[Sequence[object]]) -> bytes:
    """Return an Excel file."""
    book = openpyxl.Workbook()
    book.remove(book.active)
    for name, rows in sheets.items():
        sheet = book.create_sheet(name)
        for row in rows:
            sheet.append(list(row))
    out = io.BytesIO()
    book.save(out)
    return out.getvalue()


def _books() -> list[Foreign]:
    rows = true_rows()
    cells = [list(row) for row in rows.itertuples(index=False)]
    words = ["Ridge width", "Groove width", "Proximal edges", "Line load"]
    units = ["mm", "mm", None, "N/mm"]
    merged = [["Pressversuch vom 4. Mai", None, None, None], ["Geometrie", None, "Ergebnis", None]]
    title = [["Silicone cylinder on ridges"], [], ["Radius", 8, "mm"], ["E-Modul", 60, "kPa"], []]
    wide = rows.pivot_table(index=["a", "b"], columns="Q", values="line", sort=False)
    table = [
        [a, b, *loads] for (a, b), loads in zip(wide.index, wide.to_numpy().tolist(), strict=True)
    ]
    truth = _truth(rows)
    other = [["Name", "Note"], ["me", "calibrated 2024"]]
    moved = [
        [None, None, *row]
        for row in ([words[0] + " [mm]", words[1] + " [mm]", "Q", "Line load [N/mm]"], *cells)
    ]
    return [
        Foreign("titles.xlsx", workbook(Data=[*title, words, units, *cells]), BODY, truth),
        Foreign(
            "two-sheets.xlsx", workbook(About=other, Loads=[words, units, *cells]), BODY, truth
        ),
        Foreign(
            "wide.xlsx",
            workbook(Results=[["a [mm]", "b [mm]", *(f"P(Q={Q}) [N/mm]" for Q in COUNTS)], *table]),
            BODY,
            truth,
        ),
        Foreign(
            "merged.xlsx",
            workbook(Info=other, Messung=[*merged, words, units, *cells]),
            BODY,
            truth,
        ),
        Foreign("moved.xlsx", workbook(S=[[], [], *moved]), BODY, truth),
        Foreign(
            "same-sheets.xlsx",
            workbook(June=[words, units, *cells], July=[words, units, *cells]),
            {**BODY},
            truth,
        ),
    ]


def _histories() -> list[Foreign]:
    rows, truth = _increments()
    long = text(["Ridge [mm]", "Groove [mm]", "Force [N/mm]", "Contacts"], rows.to_numpy().tolist())
    one = rows[rows["a"] == TEXTURES[0][0]]
    edges = text(
        ["Inc", "Time", "Last (N/mm)", "Anzahl Stege"],
        [(i, i / 10, p, Q) for i, (p, Q) in enumerate(one[["line", "Q"]].to_numpy().tolist(), 1)],
        ";",
        ",",
    )
    of_one = truth[np.isclose(truth["a_over_R"], TEXTURES[0][0] / R)]
    return [
        Foreign("increments.csv", long.encode(), BODY, truth),
        Foreign("increments-one.csv", edges.encode(), {**BODY, "texture": "0.03,0.01"}, of_one),
    ]


def _broken() -> list[Foreign]:
    good = _long("x", "Ridge [mm]|Groove [mm]|Q|Line load [N/mm]").content.decode().splitlines()
    cells = [line.split(",") for line in good]
    for i, j, cell in (
        (2, 3, "oops"),
        (3, 0, "-0.24"),
        (5, 2, "7"),
        (6, 3, "inf"),
        (10, 3, "1e-9"),
    ):
        cells[i][j] = cell
    cells[11] = cells[11][:3]
    several = "\n".join(map(",".join, cells)) + "\n"
    many = "\n".join([good[0], *(f"{line.rsplit(',', 1)[0]},bad" for line in good[1:])]) + "\n"
    german = "Steg [mm];Nut [mm];Kanten;Last [kg]\n0,24;0,08;4;0,1\n0,24;0,08;5;0,2\n"
    german += "0,24;x;6;0,3\n-0,1;0,08;4;0,1\n0,1;0,08;6\n"
    formula = good[0] + "\n" + "\n".join([*good[1:4], "=1+1,0.08,4,0.1", "0.3,,4,0.2"]) + "\n"
    return [
        Foreign(
            "mistakes.csv",
            several.encode(),
            mistakes=(
                "oops",
                "-0.24",
                "Q = 7",
                "inf",
                "must rise",
                "3 cells",
                "R is missing",
                "E is missing",
            ),
        ),
        Foreign(
            "same-mistake.csv",
            many.encode(),
            mistakes=("12 cells", "line 2", "line 4", "and 9 more"),
        ),
        Foreign(
            "mistakes-german.csv",
            german.encode(),
            mistakes=("3 cells", "'x'", "a comma for decimals", "-0,1", "Q = 5", "'kg' is no unit"),
        ),
        Foreign(
            "formula.csv", formula.encode(), mistakes=("formulas", "not empty", "line 5", "line 6")
        ),
    ]


def foreign_files() -> list[Foreign]:
    """Make all files."""
    english = "Ridge width [mm]|Groove width [mm]|Q|Line load [N/mm]"
    german = "Stegbreite [mm]|Rillenbreite [mm]|Anzahl Kanten|Linienlast [N/mm]"
    titles = "Pressversuche, Juni\nRadius R = 8 mm; E = 60 kPa\n\n"
    gf = 9.80665e-3  # N
    return [
        _long("long.csv", english),
        _long("parentheses.csv", "Land (um)|Groove (um)|Q|Load (N/m)", width=1e3, load=1e3),
        _long("german.csv", german, separator=";", mark=","),
        _long("german-titles.csv", german, separator=";", mark=",", before=titles),
        _long(
            "german-excel.csv",
            german.replace("mm", "µm", 2),
            separator=";",
            mark=",",
            width=1e3,
            encoding="cp1252",
        ),
        _long("ridges.csv", "Ridge [mm]|Groove [mm]|Ridges in contact|Force [N/mm]"),
        _long("contacts.csv", "ridge width [mm]|groove width [mm]|contacts|force [N/mm]"),
        _long("half-model.csv", "ridge [mm]|groove [mm]|edges per side|load [N/mm]", count=0.5),
        _long(
            "segments.tsv",
            "Ridge [mm]\tGroove [mm]\tSegments\tLoad [N/mm]".replace("\t", "|"),
            separator="\t",
        ),
        _long(
            "pipes.txt",
            english.replace("|", "#"),
            separator="|",
            change=lambda one: one.replace("#", "|"),
        ),
        _long("utf16.csv", german, separator="\t", mark=",", encoding="utf-16"),
        _long("bom.csv", english, encoding="utf-8-sig"),
        _long("quoted.csv", '"Ridge, width [mm]"|"Groove, width [mm]"|"Q"|"Line load [N/mm]"'),
        _long(
            "psi.csv",
            "Ridge [in]|Groove [in]|Q|Pressure [psi]",
            width=1 / 25.4,
            load=1 / (2 * R) / 0.006894757293168361,
        ),
        _long("kpa-cm.csv", "ridge [cm]|groove [cm]|Q|p [kPa]", width=0.1, load=1000 / (2 * R)),
        _long("mpa.csv", "Steg in mm|Nut in mm|Q|Druck in MPa", load=1 / (2 * R)),
        _long("grams.csv", "Ridge [mm]|Groove [mm]|Q|Load [gf/mm]", load=1 / gf),
        _long("newtons.csv", "Ridge [mm]|Groove [mm]|Q|Force [N]", load=20),
        _long("ratios.csv", "a/R|b/R|Q|p/E", width=1 / R, load=1 / SCALE, said={}),
        _long(
            "percent.csv",
            "a/R [%]|b/R [%]|edges|p/E [1e-3]",
            width=100 / R,
            load=1000 / SCALE,
            said={},
        ),
        _long(
            "thousands.csv",
            "Steg [µm]|Nut [µm]|Kanten|Last [µN/mm]",
            separator=";",
            mark=",",
            width=1e3,
            load=1e6,
            change=_grouped,
            decimals=1,
        ),
        _long("no-words.csv", "w1 [mm]|w2 [mm]|n1|F1 [N/mm]"),
        _long(
            "no-units.csv",
            "Ridge|Groove|Q|Load",
            said={**BODY, "a": "mm", "b": "mm", "load": "N/mm"},
        ),
        _long(
            "twice.csv",
            english + "|Line load [N/mm]",
            change=lambda one: (
                "\n".join(
                    f"{line}{',' + line.rsplit(',', 1)[1] if i else ''}"
                    for i, line in enumerate(one.splitlines())
                )
                + "\n"
            ),
        ),
        _wide("wide.csv", ["Ridge [mm]", "Groove [mm]", *(f"P at Q={Q} [N/mm]" for Q in COUNTS)]),
        _wide(
            "wide-units.csv",
            ["Ridge", "Groove", *map(str, COUNTS)],
            units="mm,mm,N/mm,N/mm,N/mm,N/mm\n",
            before="Loads of edges\nmy rig\n",
        ),
        _wide(
            "wide-german.csv",
            ["Steg [mm]", "Nut [mm]", *(f"Kraft bei {Q} Kanten [N/mm]" for Q in COUNTS)],
            separator=";",
            mark=",",
            empty="-",
        ),
        *_repeats(),
        _long("own-names.csv", "w1|w2|cnt|q_lin", said=BODY | {"load": "N/mm"}),
        _long(
            "comments.csv",
            "# ridge width [mm]|groove width [mm]|proximal edges|line load [N/mm]",
            change=lambda content: content.replace("\n", "\n# mesh 3, fine\n", 3),
        ),
        _long(
            "french.csv",
            "Largeur de la strie|Largeur de la rainure|Nombre d'arêtes|Force linéique",
            separator=";",
            mark=",",
            before="# Essais de juin\n# Cylindre en silicone\n",
            change=lambda one: one.replace("linéique\n", "linéique\nmm;mm;-;N/mm\n"),
        ),
        _long(
            "spanish.csv",
            "Ancho de cresta [mm]|Ancho de surco [mm]|Bordes|Carga lineal [N/mm]",
            separator=";",
            mark=",",
        ),
        _long(
            "percent-cells.csv",
            "a/R|b/R|Q|p/E",
            width=100 / R,
            load=100 / SCALE,
            said={},
            change=_percents,
        ),
        _long("same-names.csv", "width [mm]|width [mm]|Q|load [N/mm]"),
        _long(
            "columns.dat",
            "ridge_mm|groove_mm|edges|load_N_per_mm",
            separator="   ",
        ),
        *_histories(),
        *_books(),
        *_broken(),
    ]


def _percents(content: str) -> str:
    """Put a percent sign after each number but the counts."""
    header, *rows = (line.split(",") for line in content.splitlines())
    told = [[f"{a}%", f"{b}%", Q, f"{p}%"] for a, b, Q, p in rows]
    return "\n".join(map(",".join, [header, *told])) + "\n"


def _grouped(content: str) -> str:
    """Put points between thousands."""
    lines = [line.split(";") for line in content.splitlines()]
    for row in lines[1:]:
        whole, _, rest = row[3].partition(",")
        row[3] = f"{int(whole):,}".replace(",", ".") + (f",{rest}" if rest else "")
    return "\n".join(map(";".join, lines)) + "\n"


def _repeats() -> list[Foreign]:
    """Return loads measured twice, in the rows and in the columns of a file."""
    rows = true_rows()
    again = rows.assign(line=(rows["line"] * 1.01).round(9))
    both = pd.concat([rows, again], ignore_index=True)
    truth = _truth(both).sort_values(["a_over_R", "b_over_R", "Q"], kind="stable")
    header = ["Specimen", "Wdh.", "Steg [mm]", "Rille [mm]", "Kanten", "Last [N/mm]"]
    cells = [
        [f"S{a:g}", f"{1 + i // len(rows)}", a, b, Q, line]
        for i, (a, b, Q, line) in enumerate(both.itertuples(index=False))
    ]
    wide = ["Ridge [mm]", "Groove [mm]", "Edges", "Load 1 [N/mm]", "Load 2 [N/mm]"]
    two = rows.assign(again=again["line"]).itertuples(index=False)
    return [
        Foreign("repeats.csv", text(header, cells).encode(), BODY, truth),
        Foreign("repeats-columns.csv", text(wide, two).encode(), BODY, truth),
    ]


def main() -> None:
    """Write the files."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--out", type=Path, default=Path("foreign-files"))
    out = parser.parse_args().out
    out.mkdir(parents=True, exist_ok=True)
    for one in foreign_files():
        (out / one.name).write_bytes(one.content)
        print(out / one.name)


if __name__ == "__main__":
    main()
