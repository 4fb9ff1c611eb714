# ruff: noqa: RUF001  (typographic minus, times and Greek are intended)
"""Sections on inputs and background: data, forms, run time, glossary and versions."""

from collections import Counter
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from typing import Any

from ridgebayes import drawing
from ridgebayes.checks.report_data import ReportData
from ridgebayes.report.blocks import MOST_ROWS, Block, Table, Text
from ridgebayes.report.wording import form_name, number, say
from ridgebayes.runtime.text import count, short_label, versions

_ERRORS = {
    "loads": "of a load, relative",
    "posterior": "of a mean, sd or quantile, in posterior sds",
    "evidence": "in ln Z",
}
_FORMULAS = {
    "classic": ("(h L + b/(2 R)) / c", "c"),
    "power-law": ("(Q − 2) / K", "K of each texture"),
    "modified": ("h L / c", "c"),
    "hybrid": ("h / (c₁/L + c₂ R/a)", "c₁, c₂"),
    "half-plane": ("s of the half-plane equation, without a fit, / c", "c (theory: 1)"),
}


def data_section(data: ReportData) -> list[Block]:
    """Return which rows were fitted, held out and left out."""
    table = data.comparison.table
    statuses = Counter(map(str, table.left_out.column("status")))
    left_out = "; ".join(f"{count(n, 'row')}: {status}" for status, n in statuses.items())
    frame = table.ok.frame
    parts = [*drawing.style.rows_by_texture(frame).items()]
    columns: dict[str, Callable[[Any], str]] = {
        "Texture": lambda row: short_label(str(row[1]["texture"].iloc[0])),
        "a/R": lambda row: f"{row[0][0]:g}",
        "b/R": lambda row: f"{row[0][1]:g}",
        "a/pitch": lambda row: number(row[0][0] / sum(row[0]), 3),
        "Rows": lambda row: str(len(row[1])),
        "Q": lambda row: _span(row[1]["Q"], str),
        "p/E": lambda row: _span(row[1]["p_over_E"]),
    }
    if len(table.held_out):
        columns["Role"] = lambda row: " and ".join(dict.fromkeys(row[1]["role"]))
    if (frame["solver"] != "").any():
        columns["Solver"] = lambda row: ", ".join(dict.fromkeys(row[1]["solver"].astype(str)))
    texts = [0, *(i for i, name in enumerate(columns) if name in ("Role", "Solver"))]
    n, shown = len(parts), parts[:MOST_ROWS]
    more = f"{len(shown)} of {n:,} textures shown; all are in table.csv."
    warning = f"Left out because their status is not ok: {left_out}."
    return [
        Text(_counted(data)),
        *([Text(warning, "warning")] if left_out else []),
        Table.of(shown, columns, text=texts),
        *([Text(more, "note")] if n > len(shown) else []),
    ]


def _span(values: Any, text: Callable[[Any], str] = lambda x: number(x, 3)) -> str:
    """Return the range of values as text, or the only value."""
    return " to ".join(dict.fromkeys((text(min(values)), text(max(values)))))


def _counted(data: ReportData) -> str:
    table = data.comparison.table
    used, name = table.calibration, Path(table.where).name
    return say(
        "rows_and_ranges",
        name=name if "." in name else name[:1].upper() + name[1:],
        table=table,
        fitted=f"{count(len(used), 'row')} of {count(len(used.textures), 'texture')}",
        Q=used.column("Q").max(),
        loads=_span(used.column("p_over_E")),
        ratios=_span([a / (a + b) for a, b in used.textures]),
        noise=data.comparison.noise.name,
    )


def forms_section(data: ReportData) -> list[Block]:
    """Return the formulas of the forms."""
    rows = [[form_name(name), *_FORMULAS[name]] for name in data.ranked if name in _FORMULAS]
    table = Table(["Form", "s(Q)", "Coefficients"], rows, text=(0, 1, 2))
    return [Text(say("forms")), table, *([Text(say("study"), "note")] * data.is_paper_sweep)]


def goal_section(data: ReportData) -> list[Block]:
    """Return the reason for a Bayesian analysis, and the rule of its verdict."""
    return [Text(say("why_bayesian")), Text(say("decision_rule"))]


def cost_section(data: ReportData) -> list[Block]:
    """Return the target errors and the run time of alternative methods on this machine."""
    costs = data.comparison.cost
    columns: dict[str, Callable[[dict[str, Any]], str]] = {
        "Quantity": lambda row: row["task"],
        "Method": lambda row: row["method"],
        "Preset": lambda row: row["preset"],
        "Target error": lambda row: number(row["target_error"], 2),
        "Error": lambda row: number(row["error"], 2),
        "Unit of the error": lambda row: _ERRORS.get(row["task"], ""),
        "CPU s": lambda row: number(row["cpu_s"], 2),
    }
    words = Text(say("accuracy", preset=data.preset, is_measured=len(costs) > 0))
    return [words, *([Table.of(costs, columns, text=(0, 1, 2, 5))] if len(costs) else [])]


def glossary() -> list[list[str]]:
    """Return units, symbols and terms with their meaning."""
    text = files("ridgebayes.report").joinpath("templates/glossary.txt").read_text("utf-8")
    return [line.split(": ", maxsplit=1) for line in text.splitlines()]


def glossary_section(_: ReportData) -> list[Block]:
    """Return the glossary as a table."""
    return [Table(["Word", "Meaning"], glossary(), text=(0, 1))]


def versions_section(_: ReportData) -> list[Block]:
    """Return the versions of the software."""
    names = ", ".join(f"{name} {version}" for name, version in versions().items())
    return [Text(say("run_folder"), "note"), Text(f"{names[0].upper()}{names[1:]}.", "note")]
