"""Figures of a scene: Q against load, and the sizes of its effects."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, MaxNLocator, NullLocator

from ridgebayes._types import FloatArray
from ridgebayes.drawing.style import COLOURS, WIDTH, new_figure, plain, styled
from ridgebayes.runtime.text import short_label

_BODY = COLOURS["modified"]


@styled()
def plot_counts(curves: dict[str, tuple[FloatArray, FloatArray]]) -> Figure:
    """Draw Q against load as steps, one line for each solver or set of effects.

    Parameters
    ----------
    curves : dict of str to (ndarray, ndarray)
        Loads p/E in rising order, and Q from each load on, by name.

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure = new_figure(WIDTH, 4.2)
    draw_steps(figure.subplots(), curves)
    figure.legend(loc="outside upper center", ncols=min(len(curves), 3))
    return figure


def draw_steps(axes: Axes, curves: dict[str, tuple[FloatArray, FloatArray]]) -> None:
    """Draw the steps of `plot_counts` on axes."""
    colours = [*COLOURS.values()]
    top = max(float(p[-1]) for p, _ in curves.values())
    for i, (name, (p, Q)) in enumerate(curves.items()):
        first = Q[0] - (Q[1] - Q[0] if len(Q) > 1 else 2)
        axes.step(
            np.concatenate([[0.0], p, [1.05 * top]]),
            np.concatenate([[first], Q, Q[-1:]]),
            where="post",
            color=colours[i % len(colours)],
            linewidth=1.3,
            linestyle=("-", "--", ":", "-.")[i % 4],
            label=plain(short_label(name, most=60), 60),
        )
    axes.set(xlabel="load $p/E$", ylabel="edges in contact $Q$")
    axes.yaxis.set_major_locator(MaxNLocator(integer=True))


@styled()
def plot_effects(table: pd.DataFrame, relative: float | None) -> Figure:
    """Draw the relative change of a transition load by each effect, against the required accuracy.

    Parameters
    ----------
    table : pandas.DataFrame
        Rows of one texture with the columns of the CSV written by the command plan.
    relative : float or None
        Wanted relative accuracy.

    Returns
    -------
    matplotlib.figure.Figure
        One bar for each effect of known size; a hollow bar marks an effect that is not simulated.
    """
    figure = new_figure(WIDTH, 1.2 + 0.36 * int(table["estimated_rel_change"].notna().sum()))
    draw_effects(figure.subplots(), table, relative)
    return figure


def draw_effects(axes: Axes, table: pd.DataFrame, relative: float | None) -> Axes:
    """Draw the bars of `plot_effects` on axes, and return these."""
    sized = table[table["estimated_rel_change"].notna()]
    least = 1e-6
    for row, effect in enumerate(sized.to_dict("records")):
        size = max(float(effect["estimated_rel_change"]), least)
        if effect["estimated_rel_change"] == 0:
            axes.text(1.3 * least, row, "0", va="center", fontsize=8)
            continue
        fill = _BODY if effect["simulated"] else "none"
        axes.barh(row, size, left=0, color=fill, edgecolor=_BODY, height=0.6)
    top = max(2.0, 2 * float(sized["estimated_rel_change"].max()))
    axes.set(xscale="log", xlim=(least, top))
    axes.xaxis.set_major_locator(LogLocator(10))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_yticks(range(len(sized)), [plain(name, 40) for name in sized["effect"]])
    axes.set_ylim(len(sized) - 0.5, -0.5)  # the first on top, and space for a 0 in the last row
    axes.grid(visible=False, axis="y")
    if relative is not None:
        axes.axvline(relative, color="#000000", linewidth=1, linestyle=":")
    dotted = "" if relative is None else "; dotted: target"
    axes.set_xlabel(f"relative change of a transition load (filled: simulated{dotted})")
    return axes
