"""Figure of the ECDF test: samples of ranks or PIT values against the uniform distribution."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from ridgebayes.drawing.style import (
    COLOURS,
    OBSERVED,
    QUIET,
    TITLES,
    WIDTH,
    new_figure,
    styled,
    symbol,
)
from ridgebayes.errors import InputError
from studies.uniformity import Uniformity

_OUTSIDE = COLOURS["classic"]  # no form is drawn here; this is the palette's red


@styled()
def plot_uniformity(results: Mapping[str, Uniformity]) -> Figure:
    """Draw how far each ECDF is from uniform, with the band that holds all of it.

    Parameters
    ----------
    results : mapping of str to Uniformity
        By name: a parameter's or a form's symbol or title is shown, other text as it is.

    Returns
    -------
    matplotlib.figure.Figure
        A panel a name: ECDF minus the uniform distribution, joined between the evaluation points;
        points outside the band are marked. One scale for all if all samples are of one size.

    Raises
    ------
    InputError
        If there are no results.
    """
    if not results:
        raise InputError("results: expected at least one, got none")
    n_column = min(3, len(results))
    n_row = -(-len(results) // n_column)
    figure = new_figure(WIDTH, 1.3 + 2.1 * n_row)
    # The band of a small sample is wide: on its scale those of large ones would be flat.
    one_size = len({found.n for found in results.values()}) == 1
    panels = figure.subplots(n_row, n_column, squeeze=False, sharex=True, sharey=one_size)
    for axes, (name, found) in zip(panels.flat, results.items(), strict=False):
        _panel(axes, found)
        axes.set_title(
            f"{TITLES.get(name) or symbol(name)}\n{found.n:,} values, {_p(found.p_value)}",
            fontsize=9,
        )
    for axes in panels.flat[len(results) :]:
        axes.set_visible(False)
    for i in range(len(results)):
        if i + n_column >= len(results):
            panels.flat[i].tick_params(labelbottom=True)
            panels.flat[i].set_xlabel("rank or PIT value $z$")
        if i % n_column == 0:
            panels.flat[i].set_ylabel(r"ECDF$(z) - z$")
    probs = " or ".join(f"{100 * p:g} %" for p in sorted({r.prob for r in results.values()}))
    handles: list[Patch | Line2D] = [
        Line2D([], [], color=OBSERVED, linewidth=1.2, label="observed"),
        Patch(
            color=QUIET,
            alpha=0.3,
            linewidth=0,
            label=f"band of a uniform sample's whole ECDF, {probs}",
        ),
    ]
    if not all(found.inside for found in results.values()):
        handles.append(
            Line2D([], [], color=_OUTSIDE, marker=".", linestyle="none", label="outside")
        )
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))
    return figure


def _panel(axes: Axes, found: Uniformity) -> None:
    z = np.concatenate([[0.0], found.z, [1.0]])
    # At both ends every ECDF is the uniform distribution.
    observed, lower, upper = (
        np.concatenate([[0.0], y - found.z, [0.0]]) for y in (found.ecdf, found.lower, found.upper)
    )
    axes.fill_between(z, lower, upper, color=QUIET, alpha=0.3, linewidth=0)
    axes.axhline(0, color=QUIET, linewidth=0.8)
    axes.plot(z, observed, color=OBSERVED, linewidth=1.2)
    outside = (found.ecdf < found.lower) | (found.ecdf > found.upper)
    axes.plot(found.z[outside], observed[1:-1][outside], ".", color=_OUTSIDE, markersize=5)
    axes.set_xlim(0, 1)
    axes.set_xticks([0, 0.25, 0.5, 0.75, 1], ["0", "0.25", "0.5", "0.75", "1"])
    axes.yaxis.set_major_locator(MaxNLocator(5))


def _p(p_value: float) -> str:
    return "$p$ < 0.001" if p_value < 0.001 else f"$p$ = {p_value:.3f}"
