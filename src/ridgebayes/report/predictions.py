"""Sections on predictions: bands, held-out rows, coverage, percent errors, K, cross-validation."""

from typing import Any

import numpy as np
import pandas as pd

from ridgebayes.checks.report_data import ReportData
from ridgebayes.comparison.bands import AVERAGE
from ridgebayes.report.blocks import Block, Folded, Picture, Table, Text
from ridgebayes.report.wording import (
    ABSENT,
    decimals,
    form_name,
    number,
    percent,
    say,
    with_error,
)
from ridgebayes.runtime.text import count
from ridgebayes.table.table import ContactTable

MOST_ROWS = 30
_NEW = {
    "row": "one more row of a known texture",
    "texture": "a new texture",
    "step": "a new count of edges",
}


def bands_section(data: ReportData) -> list[Block]:
    """Return Q against load with bands, texture by texture."""
    if len(data.comparison.table.textures) <= 3 or not data.preset.extras:
        return []  # the first screen has them all, or is all that there is
    caption = say("bands_caption", shown=form_name(data.shown))
    alt = f"Q against load of every texture with the bands of {form_name(data.shown)}."
    picture = Picture("bands", caption, alt)
    return [Folded("Q against load of all textures", [picture], short=True)]


def held_out_section(data: ReportData) -> list[Block]:
    """Return the held-out rows beside their bands, inside or outside."""
    loads = data.held_out
    if not len(loads):
        return []
    band = f"{percent(loads['prob'].iloc[0])} band"
    n_row = len(data.comparison.table.held_out)
    caption = "Load error of each held-out prediction, with its band. Zero is a perfect prediction."
    if loads["prior_alone"].any():
        caption += " The power law has no K for a texture that was not fitted: it is not shown."
    rows = []
    for form in data.ranked if len(data.ranked) == 1 else (*data.ranked, AVERAGE):
        part = loads[loads["form"] == form]
        error = 100 * (part["p_over_E_median"] / part["p_over_E_observed"] - 1)
        inside = f"{int(part['inside'].sum())} of {len(part)}"
        if part["prior_alone"].all():
            rows.append([form_name(form), inside, ABSENT, "prior only"])
        else:
            far = "yes" if part["extrapolation"].any() else "no"
            rows.append([form_name(form), inside, _range(error), far])
    best = [
        [
            f"{row['a_over_R']:g}",
            f"{row['b_over_R']:g}",
            str(row["Q"]),
            number(row["p_over_E_observed"], 4),
            number(row["p_over_E_median"], 4),
            f"{number(row['p_over_E_lower'], 4)} to {number(row['p_over_E_upper'], 4)}",
            "inside" if row["inside"] else "outside",
        ]
        for row in loads[loads["form"] == data.shown].head(MOST_ROWS).to_dict("records")
    ]
    return [
        Text(f"{count(n_row, 'row')} not fitted, only predicted. Bands include the error model."),
        Picture("held-out", caption, f"Held-out loads inside the {band}: {_firsts(rows)}."),
        Table(["Form", f"Inside the {band}", "Load error, %", "Extrapolation"], rows, text=(0, 3)),
        Folded(
            "Row by row",
            [
                Table(
                    ["a/R", "b/R", "Q", "Observed p/E", "Median", band, "Observed is"],
                    best,
                    f"{form_name(data.shown)}, row by row.",
                    text=(6,),
                    badge=6,
                )
            ],
            short=True,
        ),
    ]


def _firsts(rows: list[list[str]]) -> str:
    """Return the first cell of each form, in words."""
    return ", ".join(f"{form} {first}" for form, first, *_ in rows)


def _range(errors: "pd.Series[float]") -> str:
    return f"{decimals(errors.min(), 1)} to {decimals(errors.max(), 1)}" if len(errors) else ABSENT


def coverage_section(data: ReportData) -> list[Block]:
    """Return how often bands hold textures left out, where that was counted."""
    counted = data.comparison.coverage
    if not len(counted):
        return []
    rows = [
        [
            row["noise"],
            percent(row["prob"]),
            f"{int(row['covered'])} of {int(row['n'])}",
            f"{with_error(100 * row['share'], 100 * row['share_se'], 0)} %",
            number(row["mean_width"], 2),
        ]
        for row in counted.to_dict("records")
    ]
    beyond = decimals(100 * counted["share_extrapolated"].max(), 0)
    blocks: list[Block] = [
        Text(
            say(
                "coverage",
                n_texture=int(counted["n_texture"].max()),
                form=form_name(str(counted["form"].iloc[0])),
                has_others=set(counted["noise"]) != {data.comparison.noise.name},
            )
        ),
        Picture(
            "coverage",
            say("coverage_caption"),
            _coverage_alt(data),
        ),
        Folded(
            "Coverage in numbers",
            [
                Table(
                    ["Error model", "Band", "Inside", "Share ± standard error", "Width, log load"],
                    rows,
                    say("coverage_table_caption", beyond=beyond),
                )
            ],
        ),
    ]
    failed = counted[counted["failed"] != ""]
    if len(failed):
        blocks.append(Text(f"Not fitted: {failed['failed'].iloc[0]}", "warning"))
    return blocks


def _coverage_alt(data: ReportData) -> str:
    """Say what the figure of coverage shows: the share inside the widest usual band."""
    counted = data.comparison.coverage
    usual = counted[counted["prob"] == 0.9]
    return "Share of left-out transitions inside 90 % bands: " + ", ".join(
        f"{row['noise']} {percent(round(row['share'], 2))}" for row in usual.to_dict("records")
    )


def errors_section(data: ReportData) -> list[Block]:
    """Return the percent errors of each form (the study's Figs 5 and 6)."""
    if not data.textures:
        return []
    errors = data.percent_errors
    errors = errors[errors["coefficients"] == "calibrated"]
    cells = {
        key: _range(part["percent"])
        for key, part in errors.groupby(["form", "a_over_R", "b_over_R"], sort=False)
    }
    rows = [
        [form_name(form), *(cells.get((form, a, b), ABSENT) for a, b in data.textures)]
        for form in data.ranked
    ]
    caption = say("load_errors_caption") + (
        "; dashed, hollow: those of the study." if data.is_paper_sweep else "."
    )
    a, b = data.textures[0]
    alt = f"Load errors in per cent at a/R = {a:g}, b/R = {b:g}: {_firsts(rows)}"
    return [
        Picture("percent-error", caption, alt),
        Folded(
            "Load errors in numbers",
            [
                Table(
                    ["Form", *(f"a/R = {a:g}, b/R = {b:g}" for a, b in data.textures)],
                    rows,
                    "Smallest to largest load error in per cent, calibrated coefficients.",
                )
            ],
        ),
    ]


def slopes_section(data: ReportData) -> list[Block]:
    """Return K against pitch, where the power law was fitted to several textures."""
    caption = say("slopes_caption")
    return [Picture("slopes", caption)]


def score_section(data: ReportData) -> list[Block]:
    """Return scores of whatever was left out, stacking weights, and where they disagree."""
    loo, left_out = data.comparison.loo, data.comparison.left_out
    blocks: list[Block] = []
    leaders = {}
    if len(loo):
        scores = loo.sort_values("elpd", ascending=False)
        if len(reliable := scores[scores["n_bad_k"] == 0]) > 1:
            leaders["row"] = _leaders(reliable, "elpd")
        blocks.append(_rows_table(scores))
        if scores["n_bad_k"].sum():
            words = say("pareto_k", has_refits=len(left_out) > 0)
            blocks.append(Text(words, "note"))
    if len(left_out):
        for leave, part in left_out.groupby("leave", sort=False):
            if part["log_score"].notna().any():
                leaders[str(leave)] = _leaders(part, "log_score")
        scored = _left_out_table(left_out, data.comparison.table.calibration)
        blocks.append(Folded("Textures and steps left out", [scored]))
    if blocks:
        words = say("scores", agreement=_agreement(data, leaders))
        blocks.insert(0, Text(words))
    return blocks


def _leaders(scores: pd.DataFrame, column: str) -> tuple[str, str]:
    """Return the form of the highest score and that of the highest weight."""
    by_score, by_weight = (
        scores["form"].iloc[int(scores[name].astype(float).fillna(-np.inf).argmax())]
        for name in (column, "stacking_weight")
    )
    return str(by_score), str(by_weight)


def _agreement(data: ReportData, leaders: dict[str, tuple[str, str]]) -> str:
    if data.best is None or len(data.ranked) < 2 or not leaders:
        return ""
    against = [
        (_NEW[leave], *ahead) for leave, ahead in leaders.items() if set(ahead) != {data.best}
    ]
    is_open = data.verdict is not None and data.verdict.grade == "undecided"
    return say("agreement", best=form_name(data.best), against=against, is_open=is_open)


def _rows_table(scores: pd.DataFrame) -> Table:
    return Table(
        ["Form", "elpd ± standard error", "Effective parameters", "Rows with k > 0.7", "Weight"],
        [
            [
                form_name(row["form"]),
                "not reliable" if row["n_bad_k"] else with_error(row["elpd"], row["se"], 1),
                ABSENT if row["n_bad_k"] else decimals(row["p"], 1),
                str(int(row["n_bad_k"])),
                ABSENT if row["n_bad_k"] else decimals(row["stacking_weight"], 3),
            ]
            for row in scores.to_dict("records")
        ],
        "Single rows left out, by Pareto-smoothed importance sampling. Weight: stacking weight.",
    )


def _left_out_table(scores: pd.DataFrame, fitted: ContactTable) -> Table:
    records = scores.to_dict("records")
    n_step = len(np.unique(fitted.column("Q")))
    n_left = {"texture": len(fitted.textures), "step": n_step, "row": len(fitted)}
    failed = "; ".join(f"{row['form']}, {row['failed']}" for row in records if row["failed"])
    return Table(
        ["Left out", "Form", "Log score ± standard error", "CRPS of log load", "Weight"],
        [_left_out_row(row, n_left[str(row["leave"])]) for row in records],
        say("left_out_caption") + (f" Not fitted: {failed}." if failed else ""),
        text=(0, 1),
    )


def _left_out_row(row: dict[Any, Any], n_left: int) -> list[str]:
    n_fold = int(row["n_fold"])
    how = "in turn" if n_fold == n_left else f"in {n_fold} groups"
    what = [f"{n_left} {row['leave']}s {how}", form_name(row["form"])]
    if pd.isna(row["log_score"]):
        return [*what, ABSENT, ABSENT, ABSENT]
    return [
        *what,
        with_error(row["log_score"], row["log_score_se"], 1),
        number(row["mean_crps"], 2),
        decimals(row["stacking_weight"], 3),
    ]
