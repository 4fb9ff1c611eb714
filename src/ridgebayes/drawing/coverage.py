"""Figure of the coverage: nominal and actual coverage of bands, and their mean widths."""

from typing import Any

import matplotlib
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from ridgebayes._types import FloatArray
from ridgebayes.drawing.style import QUIET, WIDTH, new_figure, plain, styled, title_of
from ridgebayes.errors import InputError


@styled()
def plot_coverage(frame: pd.DataFrame) -> Figure:
    """Draw nominal and actual coverage, and mean widths, by form, error model and probability.

    Parameters
    ----------
    frame : pandas.DataFrame
        Columns of coverage.csv.

    Returns
    -------
    matplotlib.figure.Figure
        Each form has a column. The upper panel shows the share of transitions inside each band
        with two standard errors, clipped to 0 and 1, and a line at the nominal probability. The
        lower panel shows the mean width of the bands on a logarithmic axis. The row of an error
        model without finite values is blank.

    Raises
    ------
    InputError
        If the frame has no rows.
    """
    if frame.empty:
        raise InputError("frame: no rows; expected at least one form and error model")
    forms, noises = (list(dict.fromkeys(frame[name])) for name in ("form", "noise"))
    probs = sorted(set(frame["prob"].tolist()))
    shades = matplotlib.colormaps["viridis"](np.linspace(0.85, 0.0, len(probs)))
    # Heights of the rows: a dot for each probability above, a line of text below.
    above, below = 0.5 + 0.085 * len(probs) * len(noises), 0.5 + 0.2 * len(noises)
    figure = new_figure(WIDTH, 1.0 + above + below)
    heights = {"height_ratios": [above, below]}
    shared: Any = {"sharey": True, "sharex": "row", "gridspec_kw": heights}
    panels = figure.subplots(2, len(forms), squeeze=False, **shared)
    for (top, bottom), form in zip(panels.T, forms, strict=True):
        of_form = frame[frame["form"] == form]
        for i, (prob, shade) in enumerate(zip(probs, shades, strict=True)):
            part = of_form[of_form["prob"] == prob].set_index("noise").reindex(noises)
            top.axvline(prob, color=shade, linewidth=0.9, alpha=0.8)
            _shares(top, part, (i + 1) / (len(probs) + 1) - 0.5, shade)
            widths = part["mean_width"].to_numpy(float)
            shown = np.isfinite(widths) & (widths > 0)
            rows = np.arange(len(noises))
            bottom.plot(widths[shown], rows[shown], "o", color=shade, markersize=4)
        top.set_title(title_of(form))
    _axes(panels, noises)
    handles = [
        Line2D([], [], color=shade, marker="o", markersize=4, label=f"{100 * prob:g} % band")
        for prob, shade in zip(probs, shades, strict=True)
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=min(len(handles), 5))
    return figure


def _shares(axes: Axes, part: pd.DataFrame, dodge: float, shade: FloatArray) -> None:
    share, se = part["share"].to_numpy(float), part["share_se"].to_numpy(float)
    shown = np.isfinite(share)
    share, reach = share[shown], 2 * np.nan_to_num(se[shown])
    ends = [np.minimum(reach, share), np.minimum(reach, 1 - share)]
    look: dict[str, Any] = {"fmt": "o", "color": shade, "markersize": 3, "linewidth": 1.0}
    axes.errorbar(share, np.flatnonzero(shown) + dodge, xerr=ends, **look)


def _axes(panels: np.ndarray, noises: list[str]) -> None:
    for (top, bottom), first in zip(panels.T, [True] + [False] * len(panels.T), strict=False):
        top.set(xlim=(-0.02, 1.02), xlabel="share inside")
        top.set_xticks([0, 0.5, 1], ["0", "0.5", "1"])
        bottom.set(xscale="log", xlabel="width in log load")
        if not np.isfinite(bottom.dataLim.intervalx).all():  # no data to set the limits
            bottom.set_xlim(0.01, 1.0)
        low, high = bottom.get_xlim()
        bottom.xaxis.set_major_locator(LogLocator(10, (1, 3) if high < 100 * low else (1,)))
        bottom.xaxis.set_minor_locator(NullLocator())
        bottom.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
        for axes in (top, bottom):
            axes.set_ylim(len(noises) - 0.5, -0.5)
            axes.set_yticks(range(len(noises)), [plain(name) for name in noises])
            axes.tick_params(axis="y", length=0, labelleft=first)
            axes.grid(visible=False, axis="y")
            for line in range(1, len(noises)):
                axes.axhline(line - 0.5, color=QUIET, linewidth=0.4, alpha=0.5)
