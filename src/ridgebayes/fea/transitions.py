"""Transition loads of load-stepped runs: the load at which each corner was reached."""

import math
from decimal import Decimal
from typing import Any

import numpy as np
import pandas as pd

from ridgebayes._types import BoolArray, FloatArray, IntArray
from ridgebayes.errors import InputError
from ridgebayes.fea.record import MOST, SHOWN
from ridgebayes.fea.words import MOST_DISTINCT
from ridgebayes.runtime.text import count, some_of
from ridgebayes.table.columns import SHOWN as MOST_SHOWN
from ridgebayes.table.rules import row_codes

_GAP_ROUNDING = 1e-12  # gap over R of a body that touches a corner, by rounding errors


def transitions_of(
    load: FloatArray,
    gap: FloatArray,
    Q: IntArray,
    *,
    brackets: bool = False,
    gap_error: FloatArray | float = 0.0,
    digits: float = 0.0,
) -> tuple[pd.DataFrame, list[str]]:
    """Find the load at which each corner was reached in a run.

    Parameters
    ----------
    load : ndarray of float, shape (n_increment,), dimensionless
        p/E of each converged increment, in the order of the run.
    gap : ndarray of float, shape (n_increment, n_corner), over R
        Distance of the body from each corner, 0 or less in contact. -inf or inf if only contact or
        no contact is known, NaN if nothing is known.
    Q : ndarray of int, shape (n_corner,)
        Number of ridges in contact when the corner is reached.
    brackets : bool, optional
        Whether to return all loads as intervals, ``p_over_E_lower < load <= p_over_E``, even if the
        gaps allow extrapolation to contact.
    gap_error : float or ndarray of float, shape (n_increment, n_corner), over R, optional
        Error of the gaps, such as the overlap of penalty contact or rounding of printed digits.
    digits : float, over R, optional
        Rounding of printed gaps: a gap up to this value counts as closed.

    Returns
    -------
    DataFrame
        One row per corner that was reached, with columns ``Q``, ``p_over_E``, ``p_over_E_lower``
        (NaN if the load is extrapolated) and ``rel_se`` (0 for an interval).
    list of str
        Messages about ignored increments and doubtful transitions.

    Raises
    ------
    InputError
        If no corner was reached, or an outer corner before an inner one that was known to be open:
        columns were exchanged, or positions are not measured from the body's axis.

    Notes
    -----
    *Validity.* Increments whose load does not exceed all previous loads (repeats, cut-backs and
    unloading) are ignored. The gap is extrapolated linearly to 0 from the last two increments
    before contact, since a penalty changes gaps in contact. The interval is returned instead if the
    extrapolated load lies outside of it, if the last three gaps before contact do not decrease, or
    if a parabola through them changes the load by more than the width of the interval.

    *Accuracy.* `rel_se` is the difference between the linear and the parabolic extrapolation,
    combined with the gap's error.

    Examples
    --------
    >>> import numpy as np
    >>> load = np.array([0.1, 0.2, 0.3, 0.4])
    >>> gap = np.array([[0.25], [0.15], [0.05], [-0.001]])
    >>> rows, _ = transitions_of(load, gap, np.array([4]))
    >>> round(float(rows["p_over_E"].iloc[0]), 12)
    0.35
    """
    load, gap = np.asarray(load, dtype=float), np.asarray(gap, dtype=float)
    error = np.broadcast_to(np.asarray(gap_error, dtype=float), gap.shape)
    closed_gap = max(_GAP_ROUNDING, digits)
    order, messages = _rising(load)
    load, gap, error = load[order], gap[order], error[order]
    rows: list[dict[str, Any]] = []
    not_reached: list[int] = []
    inner: list[tuple[int, BoolArray]] = []  # Q, and whether the corner is open, before contact
    for j in np.argsort(Q):
        is_known = ~np.isnan(gap[:, j])
        touched = is_known & (gap[:, j] <= closed_gap)
        inner.append((int(Q[j]), is_known & ~np.logical_or.accumulate(touched)))
        if not touched.any():
            not_reached.append(int(Q[j]))
            continue
        first = int(np.argmax(touched))
        if later := [q for q, is_open in inner if is_open[first]]:
            early = f"Q = {Q[j]} is touched at p/E = {load[first]:.5g}, before Q = {later[0]}"
            raise InputError(f"{early}; expected inner corners first, from the axis outwards")
        lost = load[first:][gap[first:, j] > closed_gap]
        if lost.size:
            at = some_of([f"{at:.5g}" for at in lost], SHOWN)
            messages.append(f"Q = {Q[j]}: contact is lost again at p/E = {at}")
        before = np.flatnonzero(is_known[:first])
        lower = float(load[before[-1]]) if before.size else 0.0
        upper, rel_se = float(load[first]), 0.0
        if not brackets:
            zero = _extrapolated(load, gap[:, j], error[:, j], before, upper)
            if zero is not None:
                (upper, rel_se), lower = zero, math.nan
            elif np.isfinite(gap[before, j]).any():
                messages.append(
                    f"Q = {Q[j]}: the gap before contact is not smooth enough: bracketed"
                )
        if rows and upper <= rows[-1]["p_over_E"]:
            # An increment in which two corners are reached gives the load of the first only.
            messages.append(
                f"Q = {Q[j]} ignored: reached in the same increment as Q = {rows[-1]['Q']}"
            )
            continue
        rows.append({"Q": int(Q[j]), "p_over_E": upper, "p_over_E_lower": lower, "rel_se": rel_se})
    if not_reached:
        to = f" to {not_reached[-1]}" if len(not_reached) > 1 else ""
        messages.append(f"Q = {not_reached[0]}{to}: not reached")
    if not rows:
        top = f"the highest load is p/E = {load[-1]:.5g}" if load.size else "no increment is left"
        raise InputError(f"no corner is reached: {top}; {'; '.join(messages)}")
    return pd.DataFrame(rows), messages


def _rising(load: FloatArray) -> tuple[IntArray, list[str]]:
    """Return the increments whose load exceeds all previous loads, and messages about the rest."""
    finite = np.isfinite(load) & (load > 0)
    above = np.maximum.accumulate(np.where(finite, load, 0.0))
    before = np.concatenate([[0.0], above[:-1]])
    ignored = {
        "no load above 0": ~finite,
        "they repeat a load": finite & (load == before),
        "the load decreases or was cut back": finite & (load < before),
    }
    counts = {why: int(mask.sum()) for why, mask in ignored.items()}
    messages = [f"{count(n, 'increment')} ignored: {why}" for why, n in counts.items() if n]
    return np.flatnonzero(finite & (load > before)), messages


def _extrapolated(
    load: FloatArray, gap: FloatArray, error: FloatArray, before: IntArray, upper: float
) -> tuple[float, float] | None:
    """Return the load of zero gap and its relative error; None if extrapolation is not reliable."""
    last = before[-3:]
    g, p = gap[last], load[last]
    if last.size < 3 or not np.isfinite(g).all() or not (np.diff(g) < 0).all():
        return None
    slope = (g[2] - g[1]) / (p[2] - p[1])
    straight = p[2] - g[2] / slope
    from scipy.interpolate import krogh_interpolate  # slow import that tables do not need

    # Inverse quadratic extrapolation: the load as a parabola of the gap, at gap 0.
    curved = float(krogh_interpolate(g, p, 0.0))
    doubt = math.hypot(curved - straight, error[last[-1]] / abs(slope))
    is_inside = p[2] < straight <= upper * (1 + 1e-12) + doubt
    # A NaN or infinite error is refused, too.
    if not (is_inside and abs(curved - straight) < upper - p[2] and math.isfinite(doubt)):
        return None
    zero = min(straight, upper)
    return zero, max(doubt / zero, 1e-12)


def half_digit(values: FloatArray, *, near_0: bool = False) -> float:
    """Return half a unit in the last printed digit of the largest numbers; 0 if all are 0.

    With `near_0`, small numbers count too, whose digits are finer in formats with an exponent.

    Examples
    --------
    >>> printed = np.array([0.25, 0.913, 0.0004])
    >>> half_digit(printed), half_digit(printed, near_0=True), half_digit(np.zeros(2))
    (0.0005, 5e-05, 0.0)
    """
    size = np.abs(values)
    most = float(size.max(initial=0.0))
    if most == 0.0:
        return 0.0
    least = 0.0 if near_0 else 10.0 ** math.floor(math.log10(most))
    some = np.unique(size[(size >= least) & (size > 0)])[:MOST_DISTINCT]
    places = [int(Decimal(repr(number)).as_tuple().exponent) for number in some.tolist()]
    return 10.0 ** min(places) / 2


def transitions_of_runs(
    curve: pd.DataFrame,
    load: FloatArray,
    gap: FloatArray,
    Q: IntArray,
) -> tuple[pd.DataFrame, list[str]]:
    """Find the transitions of several runs in one table of increments.

    Parameters
    ----------
    curve : DataFrame, n_row rows
        Columns that are constant in a run, by contract name. Equal rows belong to the same run.
    load : ndarray of float, shape (n_row,), dimensionless
        p/E of each increment.
    gap : ndarray of float, shape (n_row, n_corner)
        -inf in contact, inf without contact, NaN if nothing is known.
    Q : ndarray of int, shape (n_corner,)
        Q of each corner, rising.

    Returns
    -------
    DataFrame
        One row per run and corner that was reached.
    list of str
        Messages about the runs.

    Raises
    ------
    InputError
        If no corner of any run was reached, or there are over 2000 runs.
    """
    run = row_codes(*(curve[name] for name in curve))
    n_run = int(run.max()) + 1
    if n_run > MOST:
        raise InputError(
            f"increments of {n_run} runs; expected at most {MOST} (texture, nu, offset, series, "
            "solver and source are constant in a run)"
        )
    frames, messages, failed = [], [], []
    order = np.argsort(run, kind="stable")
    for rows in np.split(order, np.flatnonzero(np.diff(run[order])) + 1):
        constants = curve.iloc[int(rows[0])]
        name = "" if n_run == 1 else f"{_label(constants)}: "
        try:
            frame, odd = transitions_of(load[rows], gap[rows], Q, brackets=True)
        except InputError as error:
            failed.append(f"{name}{error}")
            continue
        messages += [f"{name}{text}" for text in odd]
        frames.append(frame.assign(**{str(key): constants[str(key)] for key in curve}))
    if not frames:
        raise InputError(failed[0])
    messages += [f"run ignored: {text}" for text in failed]
    if (n := len(messages) - MOST_SHOWN) > 0:
        messages = [*messages[:MOST_SHOWN], f"and {n} more remarks on runs"]
    return pd.concat(frames, ignore_index=True), [f"{count(n_run, 'run')} of increments", *messages]


def middle_loads(rows: pd.DataFrame) -> tuple[pd.DataFrame, int]:
    """Replace intervals by their middle with the sd of a uniform distribution; count them."""
    lower, upper = (rows[name].to_numpy() for name in ("p_over_E_lower", "p_over_E"))
    is_interval, middle = ~np.isnan(lower), (lower + upper) / 2
    sd = (upper - lower) / math.sqrt(12)
    return rows.assign(
        p_over_E=np.where(is_interval, middle, upper),
        rel_se=np.where(is_interval, sd / middle, rows["rel_se"]),
        p_over_E_lower=np.nan,
    ), int(is_interval.sum())


def _label(run: "pd.Series[Any]") -> str:
    texture = run.get("texture", "") or f"a/R = {run['a_over_R']:g}, b/R = {run['b_over_R']:g}"
    return ", ".join(filter(None, [texture, run.get("series", "")]))
