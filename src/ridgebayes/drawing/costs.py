"""Figures of what accuracy costs: error against CPU time, and the settings worth their price."""

from collections.abc import Sequence

import pandas as pd
from matplotlib.figure import Figure

from ridgebayes.drawing.style import COLOURS, MARKERS, WIDTH, new_figure, styled

_LEAST = 1e-12  # errors of zero are drawn here


@styled()
def plot_cost(frame: pd.DataFrame, task: str, levels: Sequence[float]) -> Figure:
    """Draw one task's errors against CPU seconds.

    Parameters
    ----------
    frame : pandas.DataFrame
        Columns of cost.csv.
    task : str
        Which rows.
    levels : sequence of float
        Errors to draw dotted lines at.

    Returns
    -------
    matplotlib.figure.Figure
        Logarithmic; a panel for each quantity, a line along its Pareto front.
    """
    rows = frame[(frame["task"] == task) & (frame["status"] == "ok")]
    quantities = list(dict.fromkeys(rows["quantity"]))
    figure = new_figure(WIDTH, 3.6)
    panels = figure.subplots(1, len(quantities), sharey=True, squeeze=False)[0]
    methods = list(dict.fromkeys(rows["method"]))
    colours, markers = list(COLOURS.values()), list(MARKERS.values())
    for axes, quantity in zip(panels, quantities, strict=True):
        some = rows[rows["quantity"] == quantity]
        best = some[some["pareto"]].sort_values("cpu_s")
        axes.plot(best["cpu_s"], best["error"].clip(lower=_LEAST), color="#000000", linewidth=0.8)
        for i, method in enumerate(methods):
            one = some[some["method"] == method]
            axes.errorbar(
                one["cpu_s"],
                one["error"].clip(lower=_LEAST),
                xerr=one["cpu_s_spread"],
                # Another marker when colours come round again: no two methods look alike.
                fmt=markers[(i + i // len(colours)) % len(markers)],
                color=colours[i % len(colours)],
                markersize=5,
                linewidth=0.8,
                label=method if axes is panels[0] else None,
            )
        axes.set(xscale="log", yscale="log", xlabel="CPU seconds", title=quantity)
        for level in levels:
            axes.axhline(level, color="#000000", linewidth=0.6, linestyle=":")
    panels[0].set_ylabel("error")
    figure.legend(loc="outside upper center", ncols=3)
    return figure
