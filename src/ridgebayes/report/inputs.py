# ruff: noqa: RUF001  (typographic minus, times and Greek are meant: readers see them)
"""Sections on what went in and how to read it: data, run time, glossary, versions."""

from collections import Counter
from pathlib import Path

from ridgebayes import drawing
from ridgebayes.checks.report_data import ReportData
from ridgebayes.report.blocks import Block, Table, Text
from ridgebayes.report.wording import form_name, number, say
from ridgebayes.runtime.text import count, short_label, versions

MOST_TEXTURES = 40
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
GLOSSARY = (
    ("a/R, b/R, pitch L", "Ridge width, groove width and their sum, over the body's radius R."),
    ("p/E", "Load per projected area over Young's modulus. The line load is 2 R p."),
    ("s", "√(p/E) at Poisson's ratio 0.5. Other ratios enter by the load (p/E)(1 − ν²)/0.75."),
    ("Q", "Proximal ridge edges in contact: 2 at first touch, then 4, 6, ..."),
    ("K", "dQ′/ds, the rate at which the count grows."),
    ("ln BF", "Natural logarithm of the ratio of evidences. Above 0 it favours the first form."),
    ("Reading", "2 ln BF of 2, 6, 10 begin positive, strong, very strong (Kass & Raftery 1995)."),
    ("Load error", "100 (p form / p data − 1). Above 0 the form predicts too high a load."),
    ("Curve band", "Uncertainty of the form's coefficients only."),
    (
        "Simulation band",
        "That and the error model: where a further simulation or measurement would lie.",
    ),
    (
        "Extrapolation",
        "A count, load, a/pitch, a/R or b/R beyond the calibrated range. The band does not include "
        "how the form fails there.",
    ),
)


def data_section(data: ReportData) -> list[Block]:
    """Return what was fitted, held out and left out."""
    table = data.comparison.table
    blocks: list[Block] = [Text(_counted(data))]
    statuses = Counter(map(str, table.left_out.column("status")))
    if statuses:
        listed = "; ".join(f"{count(n, 'row')}: {status}" for status, n in statuses.items())
        blocks.append(Text(f"Left out because their status is not ok: {listed}.", "warning"))
    frame = table.frame
    textures = drawing.style.rows_by_texture(frame[frame["status"] == "ok"])
    rows = [
        [
            short_label(str(part["texture"].iloc[0])),
            f"{a:g}",
            f"{b:g}",
            number(a / (a + b), 3),
            str(len(part)),
            _span(str(part["Q"].min()), str(part["Q"].max())),
            _span(number(part["p_over_E"].min(), 3), number(part["p_over_E"].max(), 3)),
            " and ".join(dict.fromkeys(part["role"])),
            ", ".join(dict.fromkeys(part["solver"].astype(str))),
        ]
        for (a, b), part in list(textures.items())[:MOST_TEXTURES]
    ]
    header = ("Texture", "a/R", "b/R", "a/pitch", "Rows", "Q", "p/E", "Role", "Solver")
    # The last two tell nothing where nothing was held out, and no solver is named.
    tells = [True] * 7 + [bool(len(table.held_out)), any(row[8] for row in rows)]
    kept = [i for i, it_does in enumerate(tells) if it_does]
    text = [j for j, i in enumerate(kept) if i in (0, 7, 8)]
    cells = [[row[i] for i in kept] for row in rows]
    blocks.append(Table([header[i] for i in kept], cells, text=text))
    n = len(table.textures)
    if n > len(rows):
        blocks.append(Text(f"{len(rows)} of {n:,} textures shown; all are in table.csv.", "note"))
    return blocks


def _span(low: str, high: str) -> str:
    return low if low == high else f"{low} to {high}"


def _counted(data: ReportData) -> str:
    table = data.comparison.table
    used = table.calibration
    ratios = [a / (a + b) for a, b in used.textures]
    loads = used.column("p_over_E")
    fitted = f"{count(len(used), 'row')} of {count(len(used.textures), 'texture')}"
    if len(used) == len(table):
        rows = f"{fitted}, all fitted"
    else:
        rows = say(
            "rows_used",
            n_row=count(len(table), "row"),
            fitted=fitted,
            n_held_out=f"{len(table.held_out):,}",
            n_left_out=f"{len(table.left_out):,}",
        )
    name = Path(table.where).name
    return say(
        "rows_and_ranges",
        name=name[:1].upper() + name[1:] if "." not in name else name,
        rows=rows,
        Q=used.column("Q").max(),
        loads=_span(number(loads.min(), 3), number(loads.max(), 3)),
        ratios=_span(number(min(ratios), 3), number(max(ratios), 3)),
        noise=data.comparison.noise.name,
    )


def forms_section(data: ReportData) -> list[Block]:
    """Return the model in formulas."""
    rows = [[form_name(name), *_FORMULAS[name]] for name in data.ranked if name in _FORMULAS]
    study = Text(
        say("study"),
        "note",
    )
    return [
        Text(say("forms")),
        Table(["Form", "s(Q)", "Coefficients"], rows, text=(0, 1, 2)),
        *([study] if data.is_paper_sweep else []),
    ]


def goal_section(data: ReportData) -> list[Block]:
    """Return why the analysis is Bayesian, and the rule of its verdict."""
    return [
        Text(say("why_bayesian")),
        Text(say("decision_rule")),
    ]


def cost_section(data: ReportData) -> list[Block]:
    """Return the target errors, and the cost of a few ways to the answer on the run's machine."""
    costs, wanted = data.comparison.cost, data.preset
    moment, evidence = f"{wanted.moment_error:g}", f"{wanted.evidence_error:g}"
    words = [say("accuracy", name=wanted.name, moment=moment, evidence=evidence)]
    if not wanted.extras:
        words.append(say("quick_run", n_kept=f"{wanted.n_kept:,}"))
    if not len(costs):
        return [Text(" ".join(words))]
    words.append(say("cpu_seconds"))
    rows = [
        [
            row["task"],
            row["method"],
            row["preset"],
            number(row["target_error"], 2),
            number(row["error"], 2),
            _ERRORS.get(row["task"], ""),
            number(row["cpu_s"], 2),
        ]
        for row in costs.to_dict("records")
    ]
    found = Table(
        ["Quantity", "Method", "Preset", "Target error", "Error", "Unit of the error", "CPU s"],
        rows,
        text=(0, 1, 2, 5),
    )
    return [Text(" ".join(words)), found]


def glossary_section(_: ReportData) -> list[Block]:
    """Return units, signs and words."""
    return [Table(["Word", "Meaning"], GLOSSARY, text=(0, 1))]


def versions_section(_: ReportData) -> list[Block]:
    """Return the versions of what made the report."""
    found = [f"{name} {version}" for name, version in versions().items()]
    found[0] = found[0].capitalize()
    return [
        Text(
            say("run_folder"),
            "note",
        ),
        Text(", ".join(found) + ".", "note"),
    ]
