"""Recommend a texture, and mark textures beyond the calibrated range."""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from ridgebayes._types import Json
from ridgebayes.inference.posterior import Posterior
from ridgebayes.predict.extrapolation import CalibratedRange, names_of
from ridgebayes.predict.q_distribution import heavy_parts, shares
from ridgebayes.texture_design.goals import Goal

_MARGIN_TOL = 1e-4  # smaller differences between margins are ignored
_N_SE = 2.0  # standard errors by which margins have to differ from 0 and from each other


def _pitch(rows: pd.DataFrame) -> pd.Series:
    return rows["a_over_R"] + rows["b_over_R"]


OBJECTIVES = {
    "margin": _pitch,  # the coarsest texture among indistinguishable margins
    "max-pitch": _pitch,
    "min-pitch": lambda rows: -_pitch(rows),
    "max-ridge": lambda row: row["a_over_R"],
    "min-ridge": lambda row: -row["a_over_R"],
    "max-groove": lambda row: row["b_over_R"],
    "min-groove": lambda row: -row["b_over_R"],
    "min-load": _pitch,  # as margin, at the smallest feasible load
}


def mark_extrapolation(
    designs: pd.DataFrame,
    averaged: Sequence[tuple[Posterior, float]],
    goals: Sequence[Goal],
    largest: float,
    nu: float,
) -> None:
    """Add columns that name quantities beyond the calibrated range, as in `predict`."""
    a, b = designs["a_over_R"].to_numpy(), designs["b_over_R"].to_numpy()
    flags = np.zeros(len(designs), dtype=np.uint8)
    cases = [case for goal in goals for case in goal.cases]
    counts = [n for case in cases for n, _ in (*case.at_least, *case.below)]
    weights = shares([weight for _, weight in averaged])
    for (fit, _), is_heavy in zip(averaged, heavy_parts(weights), strict=True):
        if is_heavy:
            calibrated = CalibratedRange.of(fit)
            flags |= calibrated.texture_flags(a, b)
            flags |= calibrated.load_flags(largest, nu) | calibrated.count_flags(max(counts))
    place = designs.columns.to_list().index("feasible") + 1
    designs.insert(place, "extrapolation", flags != 0)
    designs.insert(place + 1, "extrapolation_of", names_of(flags).astype(str))


def chosen(designs: pd.DataFrame, objective: str) -> Json:
    """Return the recommended row."""
    rows = designs[designs["feasible"]]
    for preferred in (~rows["extrapolation"], rows["margin"] >= _N_SE * rows["probability_se"]):
        if preferred[rows.index].any():
            rows = rows[preferred[rows.index]]
    rows = tied(rows) if objective in ("margin", "min-load") else rows
    # `argmax` takes the first of equal rows, so rows are sorted by margin.
    rows = rows.sort_values("margin", ascending=False, kind="stable")
    return plain(rows, int(np.argmax(OBJECTIVES[objective](rows).to_numpy().round(12))))


def tied(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the rows whose margin equals the largest margin within errors."""
    least = rows["margin"].max() - _N_SE * (rows["probability_se"] + _MARGIN_TOL)
    return pd.DataFrame(rows[rows["margin"] >= least])


def plain(rows: pd.DataFrame, place: int) -> Json:
    """Return a row as a dict of plain values."""
    row = rows.iloc[place].to_dict()
    return {
        str(name): value.item() if isinstance(value, np.generic) else value
        for name, value in row.items()
    }
