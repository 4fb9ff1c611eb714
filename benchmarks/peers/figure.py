"""The figure of the comparison: draws per CPU second, and what an evidence costs."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ridgebayes.drawing.style import COLOURS, WIDTH, new_figure, styled

LOOKS = {
    "hybrid": ("Hybrid", COLOURS["hybrid"], "D"),
    "modified": ("Modified", COLOURS["modified"], "o"),
    "texture+step": ("Hybrid, texture+step", COLOURS["power-law"], "s"),
}


@styled()
def plot_peers(frame: pd.DataFrame) -> Figure:
    """Draw the rows of `peers.csv`.

    Parameters
    ----------
    frame : pandas.DataFrame
        Columns as `compare.COLUMNS`.

    Returns
    -------
    matplotlib.figure.Figure
        Effective draws per CPU second; where there is an evidence, its distance from the reference,
        with the stated error as a dash, and the CPU seconds it took.
    """
    rows = frame[frame["status"] == "ok"]
    weighed = rows[rows["ln_Z_off"].notna()]
    figure = new_figure(WIDTH, 1.4 + 0.28 * max(rows["peer"].nunique(), 5))
    panels = figure.subplots(1, 3, width_ratios=[4, 3, 3])
    draws, error, seconds = panels
    _dots(draws, rows, "ess_per_cpu_s", _places(rows, "ess_per_cpu_s", rising=True))
    draws.set(xlabel="effective draws\nper CPU second")
    by_error = _places(weighed, "ln_Z_off", rising=False)
    _dots(error, weighed, "ln_Z_off", by_error)
    _dots(error, weighed, "ln_Z_se", by_error, marker="|", markersize=11, markeredgewidth=1.6)
    error.set(xlabel="distance of ln Z from\nthe reference (bar: error stated)")
    _dots(seconds, weighed, "ln_Z_cpu_s", by_error)
    seconds.set(xlabel="CPU seconds\nfor ln Z", yticklabels=[])
    handles, labels = draws.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=len(LOOKS))
    return figure


def _places(rows: pd.DataFrame, column: str, *, rising: bool) -> dict[str, int]:
    """Return each peer's height: the best on top, by the geometric mean over the forms."""
    typical = np.log(rows[column].clip(lower=1e-12)).groupby(rows["peer"]).mean()
    return {peer: i for i, peer in enumerate(typical.sort_values(ascending=rising).index)}


def _dots(axes: Axes, rows: pd.DataFrame, column: str, places: dict[str, int], **changed) -> None:
    """Draw a column, a line for each peer and a marker for each form, a little apart."""
    for i, (form, (title, colour, marker)) in enumerate(LOOKS.items()):
        some = rows[rows["form"] == form]
        if some.empty:
            continue
        look = {"color": colour, "marker": marker, "linestyle": "none", "markersize": 5} | changed
        height = some["peer"].map(places) + 0.18 * (1 - i)
        axes.plot(some[column], height, label=title, **look)
    axes.set_xscale("log")
    axes.set_yticks(list(places.values()), list(places))
    axes.set_ylim(-0.6, max(len(places), 1) - 0.4)
