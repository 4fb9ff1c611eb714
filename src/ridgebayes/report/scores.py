"""The section on predictive scores: rows, textures and steps left out, and how to read them."""

from typing import Any

import numpy as np
import pandas as pd

from ridgebayes.comparison.comparison import Comparison
from ridgebayes.comparison.ranking import best_form
from ridgebayes.report.blocks import Picture, Section, Table, Text, table
from ridgebayes.report.names import form_name
from ridgebayes.report.numbers import ABSENT, decimals, number, with_error

_ASKS = {
    "row": "one more row of a texture it has already seen",
    "texture": "a texture it has never seen",
    "step": "a count of edges it has never seen",
}


def score_section(comparison: Comparison) -> Section:
    """Return scores of whatever was left out, stacking weights, and where they disagree."""
    title, anchor = "Prediction of what is left out", "loo"
    blocks: list[Text | Table | Picture] = []
    leaders = {}
    if len(comparison.loo):
        scores = comparison.loo.sort_values("elpd", ascending=False)
        leaders["row"] = _leaders(scores, "elpd")
        blocks.append(_rows_table(scores))
        if scores["n_bad_k"].sum():
            blocks.append(
                Text(
                    "Rows with a Pareto k above 0.7 weigh so much on the posterior that their "
                    "score is a rough estimate; they are counted in the table.",
                    "note",
                )
            )
    if len(comparison.left_out):
        for leave, part in comparison.left_out.groupby("leave", sort=False):
            if part["log_score"].notna().any():
                leaders[str(leave)] = _leaders(part, "log_score")
        blocks.append(_left_out_table(comparison.left_out))
    if not blocks:
        return Section(title, anchor, ())
    first = Text(
        "Expected log predictive density of what a form was not shown, given all else, and the "
        "weights of the mixture of forms that would predict it best. "
        + _reading(comparison, leaders)
    )
    return Section(title, anchor, (first, *blocks))


def _leaders(scores: pd.DataFrame, column: str) -> tuple[str, str]:
    """Return the form of the highest score and that of the highest weight."""
    by_score, by_weight = (
        scores["form"].iloc[int(scores[name].astype(float).fillna(-np.inf).argmax())]
        for name in (column, "stacking_weight")
    )
    return str(by_score), str(by_weight)


def _reading(comparison: Comparison, leaders: dict[str, tuple[str, str]]) -> str:
    best = best_form(comparison)
    if best is None or len(comparison.fits) < 2:
        return ""
    against = {leave: found for leave, found in leaders.items() if set(found) != {best}}
    if not against:
        return f"All agree with the Bayes factors: {form_name(best)} leads."
    parts = []
    for leave, (by_score, by_weight) in against.items():
        heads = form_name(by_score)
        if by_weight != by_score:
            heads += f" by score and {form_name(by_weight)} by weight"
        parts.append(f"{heads} for {_ASKS[leave]}")
    return (
        f"They do not all agree with the Bayes factors, which favour {form_name(best)}: "
        + "; ".join(parts)
        + ". The questions differ: a Bayes factor asks which form with its prior made all rows "
        "likely, a score which fitted form predicts best what is new in that one way. For a new "
        "design read the scores of textures; for what is true of contact, the Bayes factors."
    )


def _rows_table(scores: pd.DataFrame) -> Table:
    return table(
        [
            "Form",
            "elpd ± standard error",
            "Effective parameters",
            "Rows with k > 0.7",
            "Stacking weight",
        ],
        [
            [
                form_name(row["form"]),
                with_error(row["elpd"], row["se"], 2),
                decimals(row["p"], 1),
                str(int(row["n_bad_k"])),
                decimals(row["stacking_weight"], 3),
            ]
            for row in scores.to_dict("records")
        ],
        "Row by row, by Pareto-smoothed importance sampling of p(row | all other rows).",
    )


def _left_out_table(scores: pd.DataFrame) -> Table:
    rows = [_left_out_row(row) for row in scores.to_dict("records")]
    failed = [
        f"{row['form']}, {row['failed']}"
        for row in scores[scores["failed"] != ""].to_dict("records")
    ]
    return table(
        [
            "Left out",
            "Form",
            "Log score ± standard error",
            "CRPS of log load",
            "Stacking weight",
        ],
        rows,
        "Exact: every texture, every count of edges left out in turn, all else fitted anew. Log "
        "score: the density of a fold's rows together. CRPS: 0.01 is about 1 % in load."
        + (f" Not fitted: {'; '.join(failed)}." if failed else ""),
        text=(0, 1),
    )


def _left_out_row(row: dict[Any, Any]) -> list[str]:
    what = [f"{int(row['n_fold'])} {row['leave']}s in turn", form_name(row["form"])]
    if pd.isna(row["log_score"]):
        return [*what, ABSENT, ABSENT, ABSENT]
    return [
        *what,
        with_error(row["log_score"], row["log_score_se"], 2),
        number(row["mean_crps"], 2),
        decimals(row["stacking_weight"], 3),
    ]
