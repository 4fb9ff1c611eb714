"""Map of designs: probability of a goal over ridge and groove width."""

from functools import partial

import numpy as np
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke

from ridgebayes._types import FloatArray
from ridgebayes.drawing import PROBS

_BEST = "#D55E00"


def draw_designs(
    axes: Axes,
    designs: pd.DataFrame,
    best: tuple[float, float],
    label: str,
    *,
    is_met: bool,
) -> None:
    """Draw a map of designs on axes.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
        Axes to draw on.
    designs : pandas.DataFrame
        Rows of designs.csv on a lattice.
    best : (float, float)
        Recommended texture, or the texture nearest to the goals.
    label : str
        Quantity shown by the colour: ``margin``, or the quantity in column ``probability``.
    is_met : bool
        Whether `best` meets the goals.
    """
    shown = "margin" if label == "margin" else "probability"
    map_of = partial(
        designs.astype({"extrapolation": float}).pivot_table,
        index="b_over_R",
        columns="a_over_R",
        aggfunc="first",
    )
    grid, margin, outside = (map_of(values=name) for name in (shown, "margin", "extrapolation"))
    x, y = grid.columns.to_numpy(float), grid.index.to_numpy(float)
    mesh = axes.pcolormesh(_edges(x), _edges(y), grid.to_numpy(float), cmap="Blues")
    axes.figure.colorbar(mesh, ax=axes, label=label)
    handles: list[Artist] = []
    if min(len(x), len(y)) > 1:
        values = margin.to_numpy(float)
        levels = [p for p in PROBS if _within(p, grid.to_numpy(float))]
        if levels and label == "probability":
            lines = axes.contour(x, y, grid, levels=levels, colors="#8A8A8A", linewidths=0.8)
            for text in axes.clabel(lines, fontsize=8, colors="black"):
                text.set_path_effects([withStroke(linewidth=2.5, foreground="white")])
        if _within(0.0, values):
            met = axes.contour(x, y, values, levels=[0.0], colors="black", linewidths=1.8)
            met.set_path_effects([withStroke(linewidth=3.5, foreground="white")])
            handles.append(Line2D([], [], color="black", linewidth=1.8, label="goal just met"))
        if outside.to_numpy().mean() > 0:
            beyond = outside.to_numpy(float)
            if beyond.min() < beyond.max():
                marked = axes.contourf(
                    x, y, beyond, levels=[0.5, 1.5], colors="none", hatches=["///"]
                )
                marked.set(edgecolor="#8A8A8A", linewidth=0)
            name = "beyond what was calibrated" if beyond.min() < 1 else "all beyond calibration"
            handles.append(Patch(facecolor="none", edgecolor="grey", hatch="///", label=name))
    (point,) = axes.plot(best[0], best[1], marker="*", color=_BEST, markersize=14)
    point.set(linestyle="none", markeredgecolor="white", clip_on=False, zorder=5)
    point.set_label("recommended" if is_met else "nearest to the goal")
    axes.set_xlabel("ridge width $a/R$")
    axes.set_ylabel("groove width $b/R$")
    axes.grid(visible=False)
    axes.legend(handles=[*handles, point], loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=2)


def _edges(widths: FloatArray) -> FloatArray:
    """Return cell edges of evenly spaced widths; a single width gets a narrow cell."""
    half = 0.5 * np.diff(widths).min() if len(widths) > 1 else 0.05 * widths[0]
    return np.append(widths - half, widths[-1] + half)


def _within(level: float, values: FloatArray) -> bool:
    return bool(values.min() < level <= values.max())
