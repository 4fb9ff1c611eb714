"""Figures of a posterior: its marginals and its predictive checks."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.path import Path
from matplotlib.ticker import MaxNLocator

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.drawing.style import (
    OBSERVED,
    WIDTH,
    colour_of,
    panel_grid,
    plain,
    shared_legend,
    styled,
    symbol,
    title_of,
)
from ridgebayes.runtime.quiet import import_arviz
from ridgebayes.runtime.text import short_label

_MAX_IQRS_SHOWN = 4  # interquartile ranges around the middle; outliers would squeeze the rest


@styled()
def plot_corner(
    form: str,
    names: Sequence[str],
    draws: FloatArray,
    published: Mapping[str, float],
    *,
    n_parameter: int,
) -> Figure:
    """Draw all one- and two-parameter marginals of a posterior.

    Parameters
    ----------
    form : str
        Name of the form.
    names : sequence of str, shape (n_shown,)
        Parameters to show.
    draws : ndarray of float, shape (n_draw, n_shown), any unit
        Draws of these parameters.
    published : mapping of str to float
        Coefficients published in the study, by parameter, drawn as solid lines; may be empty.
    n_parameter : int
        Number of parameters of the posterior.

    Returns
    -------
    matplotlib.figure.Figure
    """
    import_arviz()  # corner imports ArviZ, which would print its announcement
    import corner  # slow to import, and used by this figure only

    powers = _powers(draws)
    draws = draws * 10.0**powers
    n = len(names)
    size = min(1.6 + 1.1 * n, WIDTH)
    figure = Figure(figsize=(size, size))
    FigureCanvasAgg(figure)
    colour = colour_of(form)
    # Draws far out in the tails must not squeeze the panels.
    span = [tuple(np.quantile(x, [0.0005, 0.9995])) for x in draws.T]
    truths = np.array([published.get(name, np.nan) for name in names]) * 10.0**powers
    inside = [t if low < t < high else None for t, (low, high) in zip(truths, span, strict=True)]
    corner.corner(
        draws,
        fig=figure,
        range=span,
        bins=24,
        smooth=1.0,
        color=colour,
        labels=[_label(name, power) for name, power in zip(names, powers.tolist(), strict=True)],
        truths=inside,
        truth_color="#000000",
        plot_datapoints=False,
        plot_density=False,
        fill_contours=True,
        no_fill_contours=True,  # no white area below them
        levels=(0.39, 0.86),  # one and two standard deviations of a normal in two dimensions
        quantiles=(0.05, 0.5, 0.95),
        max_n_ticks=3,
        labelpad=0.12 if n < 4 else 0.3,
        label_kwargs={"fontsize": 9},
        hist_kwargs={"linewidth": 1.2},
    )
    for axes in figure.axes:
        axes.grid(False)
        axes.tick_params(labelsize=9)
        for line in axes.lines:
            line.set_linewidth(0.9)
        areas: list[Any] = [c for c in axes.collections if getattr(c, "filled", False)]
        for area in areas:  # outside the contours it is transparent
            area.get_paths()[0] = Path(np.empty((0, 2)))
    left = 1.1 / size
    figure.subplots_adjust(left=left, bottom=left, right=1 - 0.3 / size, top=1 - 0.45 / size)
    note = "" if n == n_parameter else f" ({n} of {n_parameter} parameters)"
    figure.suptitle(f"{title_of(form)}: posterior{note}", y=1 - 0.1 / size, va="top")
    return figure


@styled()
def plot_posterior_checks(
    form: str, quantities: Mapping[str, tuple[FloatArray, FloatArray, float]]
) -> Figure:
    """Draw each test quantity for replicated and for observed rows.

    Parameters
    ----------
    form : str
        Name of the form.
    quantities : mapping of str to (ndarray, ndarray, float)
        Values for the observed and the replicated rows at each draw, both of shape (n_draw,), and
        the p-value, by title.

    Returns
    -------
    matplotlib.figure.Figure
        Each quantity has a panel with its two distributions over the draws and the p-value.
    """
    figure, panels = panel_grid(len(quantities), 1.55, 0.9)
    for axes, (title, values) in zip(panels, quantities.items(), strict=True):
        observed, replicated, p_value = values
        first, third = np.quantile(replicated, [0.25, 0.75])
        near = np.abs(replicated - (first + third) / 2) <= _MAX_IQRS_SHOWN * (third - first)
        span = np.quantile(observed, [0.05, 0.95])
        shown = [*replicated[near], *span]
        low, high = min(shown), max(shown)
        look: dict[str, Any] = {"color": colour_of(form), "alpha": 0.5, "label": "replicated"}
        ends = low, high if high > low else low + 1
        axes.hist(replicated, "auto", range=ends, density=True, **look)
        # The observed quantity hardly varies: its histogram would tower over the other.
        axes.axvline(float(observed.mean()), color=OBSERVED, linewidth=1.4, label="observed: mean")
        axes.axvspan(
            *span, color=OBSERVED, alpha=0.18, linewidth=0, label="observed: 90 % of the draws"
        )
        axes.set_title(f"{title}\n{_p(p_value)}", fontsize=9)
        axes.set_yticks([])
        axes.grid(visible=False)
        axes.spines["left"].set_visible(False)
        axes.xaxis.set_major_locator(MaxNLocator(4))
        axes.margins(x=0.03)
    shared_legend(figure, panels[0], at="upper")
    return figure


def _p(p_value: float) -> str:
    if p_value < 0.01:
        return "$p$ < 0.01"
    return "$p$ > 0.99" if p_value > 0.99 else f"$p$ = {p_value:.2f}"


def _powers(draws: FloatArray) -> IntArray:
    """Return the power of ten that scales each column, because small numbers need long labels."""
    sizes = np.quantile(np.abs(draws), 0.5, axis=0)
    small = (sizes > 0) & (sizes < 1e-3)
    return np.where(small, -np.floor(np.log10(np.where(small, sizes, 1))), 0).astype(np.int64)


def _label(name: str, power: int) -> str:
    """Return a parameter's symbol; the texture of a K goes on a second line to fit the panel."""
    words = f"$10^{{{power}}}$\N{NO-BREAK SPACE}{symbol(name)}" if power else symbol(name)
    if name.startswith("K["):
        return f"{words.partition(' ')[0]}\n{plain(short_label(name[2:-1], 3), 15)}"
    return words
