"""Sections on predictions: bands, held-out rows, coverage, load errors, slopes and scores."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from ridgebayes.checks.report_data import ReportData
from ridgebayes.comparison.bands import AVERAGE
from ridgebayes.report.blocks import MOST_ROWS, Block, Folded, Picture, Table, Text
from ridgebayes.report.wording import ABSENT, decimals, form_name, number, percent, say, with_error
from ridgebayes.table.table import ContactTable

_NEW = {
    "row": "one more row of a known texture",
    "texture": "a new texture",
    "step": "a new count of edges",
}


def bands_section(data: ReportData) -> list[Block]:
    """Return Q against load with bands for all textures."""
    if len(data.comparison.table.ok.textures) <= 3 or not data.preset.extras:
        return []  # the first screen shows all bands that are drawn
    shown = form_name(data.shown)
    alt = f"Q against load of every texture with the bands of {shown}."
    picture = Picture("bands", say("bands_caption", shown=shown), alt)
    return [Folded("Q against load of all textures", [picture], short=True)]


def held_out_section(data: ReportData) -> list[Block]:
    """Return the held-out rows beside their bands."""
    loads = data.held_out
    if not len(loads):
        return []
    band = f"{percent(loads['prob'].iloc[0])} band"
    errors = 100 * (loads["p_over_E_median"] / loads["p_over_E_nearest"] - 1)
    by_form = dict(list(loads.assign(error=errors).groupby("form")))
    forms = data.ranked if len(data.ranked) == 1 else (*data.ranked, AVERAGE)
    sums = Table.of(
        [by_form[form] for form in forms if form in by_form],
        {
            "Form": lambda part: form_name(part["form"].iloc[0]),
            f"Inside the {band}": lambda part: f"{part['inside'].sum()} of {len(part)}",
            "Load error, %": lambda part: (
                ABSENT if part["prior_alone"].all() else _range(part["error"])
            ),
            "Extrapolation": _extrapolation,
        },
        text=(0, 3),
    )
    row_by_row = Table.of(
        loads[loads["form"] == data.shown].head(MOST_ROWS),
        {
            "a/R": lambda row: f"{row['a_over_R']:g}",
            "b/R": lambda row: f"{row['b_over_R']:g}",
            "Q": lambda row: str(row["Q"]),
            "Observed p/E": _observed,
            "Median": lambda row: number(row["p_over_E_median"]),
            band: lambda row: f"{number(row['p_over_E_lower'])} to {number(row['p_over_E_upper'])}",
            "Observed is": lambda row: "inside" if row["inside"] else "outside",
        },
        f"{form_name(data.shown)}, row by row.",
        text=(6,),
        badge=6,
    )
    alt = f"Held-out loads inside the {band}: {_firsts(sums.rows)}."
    n, has_prior = loads.groupby(["a_over_R", "b_over_R"]).ngroups, loads["prior_alone"].any()
    return [
        Text(say("held_out", n_row=len(data.comparison.table.held_out))),
        Picture("held-out", say("held_out_caption", n=n, has_prior=has_prior), alt),
        sums,
        Folded("Row by row", [row_by_row], short=True),
    ]


def _observed(row: dict[str, Any]) -> str:
    """Return an observed load, or both ends of its bracket."""
    ends = row["p_over_E_observed_lower"], row["p_over_E_observed"]
    return " to ".join(number(end) for end in ends if pd.notna(end))


def _extrapolation(part: pd.DataFrame) -> str:
    if part["prior_alone"].all():
        return "prior only"
    return "yes" if part["extrapolation"].any() else "no"


def _firsts(rows: Sequence[Sequence[str]]) -> str:
    """Return the first cell of each form as text."""
    return ", ".join(" ".join(row[:2]) for row in rows)


def _range(errors: "pd.Series[float]") -> str:
    return f"{decimals(errors.min(), 1)} to {decimals(errors.max(), 1)}"


def coverage_section(data: ReportData) -> list[Block]:
    """Return how often bands contain left-out textures, if coverage was computed."""
    counted = data.comparison.coverage
    if not len(counted):
        return []
    rows = Table.of(
        counted,
        {
            "Error model": lambda row: row["noise"],
            "Band": lambda row: percent(row["prob"]),
            "Inside": lambda row: f"{row['covered']:.0f} of {row['n']:.0f}",
            "Share ± standard error": lambda row: (
                f"{with_error(100 * row['share'], 100 * row['share_se'], 0)} %"
            ),
            "Width, log load": lambda row: number(row["mean_width"], 2),
        },
        say("coverage_table_caption", beyond=100 * counted["share_extrapolated"].max()),
    )
    words = say(
        "coverage",
        n_texture=int(counted["n_texture"].max()),
        form=form_name(str(counted["form"].iloc[0])),
        has_others=set(counted["noise"]) != {data.comparison.noise.name},
    )
    usual = counted[counted["prob"] == 0.9].to_dict("records")
    picture = Picture("coverage", say("coverage_caption"), say("coverage_alt", usual=usual))
    failed = counted["failed"][counted["failed"] != ""].head(1)
    notes = [Text(f"Not fitted: {why}", "warning") for why in failed]
    return [Text(words), picture, Folded("Coverage in numbers", [rows]), *notes]


def errors_section(data: ReportData) -> list[Block]:
    """Return the load errors of each form in per cent (the study's Figs 5 and 6)."""
    if not data.textures:
        return []
    errors = data.percent_errors[data.percent_errors["coefficients"] == "calibrated"]
    cells = {
        key: _range(part["percent"])
        for key, part in errors.groupby(["form", "a_over_R", "b_over_R"], sort=False)
    }
    titles = [f"a/R = {a:.4g}, b/R = {b:.4g}" for a, b in data.textures]
    rows = [
        [form_name(form), *(cells.get((form, *texture), ABSENT) for texture in data.textures)]
        for form in data.ranked
    ]
    table = Table(["Form", *titles], rows, say("load_errors_table_caption"))
    caption = say("load_errors_caption", is_study=data.is_paper_sweep)
    alt = f"Load errors in per cent at {titles[0]}: {_firsts(rows)}"
    return [Picture("percent-error", caption, alt), Folded("Load errors in numbers", [table])]


def slopes_section(data: ReportData) -> list[Block]:
    """Return K against pitch; the figure exists if the power law was fitted to several textures."""
    return [Picture("slopes", say("slopes_caption"))]


def score_section(data: ReportData) -> list[Block]:
    """Return cross-validation scores and stacking weights, and where they disagree."""
    loo, left_out = data.comparison.loo, data.comparison.left_out
    blocks: list[Block] = []
    leaders = {}
    if len(loo):
        scores = loo.sort_values("elpd", ascending=False)
        if len(reliable := scores[scores["n_bad_k"] == 0]) > 1:
            leaders["row"] = _leaders(reliable, "elpd")
        note = Text(say("pareto_k", has_refits=len(left_out) > 0), "note")
        blocks += [_rows_table(scores), *([note] if scores["n_bad_k"].sum() else [])]
    if len(left_out):
        for leave, part in left_out.groupby("leave", sort=False):
            if part["log_score"].notna().any():
                leaders[str(leave)] = _leaders(part, "log_score")
        scored = _left_out_table(left_out, data.comparison.table.calibration)
        blocks.append(Folded("Textures and steps left out", [scored]))
    words = Text(say("scores", agreement=_agreement(data, leaders)))
    return [words, *blocks] if blocks else []


def _leaders(scores: pd.DataFrame, column: str) -> tuple[str, str]:
    """Return the form of the highest score and the form of the highest weight."""
    by_form = scores.set_index("form")[[column, "stacking_weight"]].astype(float)
    by_score, by_weight = by_form.fillna(-np.inf).idxmax()
    return str(by_score), str(by_weight)


def _agreement(data: ReportData, leaders: dict[str, tuple[str, str]]) -> str:
    if data.best is None or len(data.ranked) < 2 or not leaders:
        return ""
    against = [
        (_NEW[leave], *ahead) for leave, ahead in leaders.items() if set(ahead) != {data.best}
    ]
    is_open = (verdict := data.comparison.verdict) is not None and verdict.grade == "undecided"
    return say("agreement", best=form_name(data.best), against=against, is_open=is_open)


def _rows_table(scores: pd.DataFrame) -> Table:
    def weight(row: dict[str, Any], name: str, places: int) -> str:
        return ABSENT if row["n_bad_k"] else decimals(row[name], places)

    return Table.of(
        scores,
        {
            "Form": lambda row: form_name(row["form"]),
            "elpd ± standard error": lambda row: (
                "not reliable" if row["n_bad_k"] else with_error(row["elpd"], row["se"], 1)
            ),
            "Effective parameters": lambda row: weight(row, "p", 1),
            "Rows with k > 0.7": lambda row: f"{row['n_bad_k']:.0f}",
            "Weight": lambda row: weight(row, "stacking_weight", 3),
        },
        say("loo_caption"),
    )


def _left_out_table(scores: pd.DataFrame, fitted: ContactTable) -> Table:
    n_step = len(np.unique(fitted.column("Q")))
    n_left = {"texture": len(fitted.textures), "step": n_step, "row": len(fitted)}

    def left_out(row: dict[str, Any]) -> str:
        n = n_left[row["leave"]]
        how = "in turn" if row["n_fold"] == n else f"in {row['n_fold']:.0f} groups"
        return f"{n} {row['leave']}s {how}"

    failed = scores[scores["failed"] != ""].to_dict("records")
    return Table.of(
        scores,
        {
            "Left out": left_out,
            "Form": lambda row: form_name(row["form"]),
            "Log score ± standard error": lambda row: with_error(
                row["log_score"], row["log_score_se"], 1
            ),
            "CRPS of log load": lambda row: number(row["mean_crps"], 2),
            "Weight": lambda row: (
                ABSENT if pd.isna(row["log_score"]) else decimals(row["stacking_weight"], 3)
            ),
        },
        say("left_out_caption", failed=failed),
        text=(0, 1),
    )
