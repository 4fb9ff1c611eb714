"""Plots of single result objects, on given or new axes, in the user's matplotlib style.

New axes are created by pyplot, so that a notebook shows them.
"""

from itertools import islice
from typing import Any

import pandas as pd
from matplotlib import pyplot
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.drawing import MOST_TEXTURES
from ridgebayes.drawing.predictions import draw_band
from ridgebayes.drawing.scenes import draw_effects, draw_steps
from ridgebayes.drawing.style import (
    COLOURS,
    MOST_LEGEND,
    colour_of,
    draw_intervals,
    look_of,
    plain,
    rows_by_texture,
    title_of,
)

_COLOURS = [colour for name, colour in COLOURS.items() if name != "average"]
_LOAD, _COUNT = "load $p/E$", "edges in contact $Q$"


def axes_or_new(ax: Axes | None) -> Axes:
    """Return the given axes, or those of a new figure if `ax` is None."""
    return pyplot.subplots(layout="constrained")[1] if ax is None else ax


def load_label(unit: str | None) -> str:
    """Return the label of an axis of loads in a unit, or of ratios p/E without a unit."""
    return f"load ({plain(unit)})" if unit else _LOAD


def draw_curves(curves: dict[str, tuple[FloatArray, FloatArray]], n: int, ax: Axes | None) -> Axes:
    """Draw Q against load as steps, one line for each curve of a table.

    Parameters
    ----------
    curves : dict of str to (ndarray, ndarray)
        Loads p/E in rising order, and Q from each load on, by label.
    n : int
        Number of curves in the table.
    ax : matplotlib.axes.Axes or None
        Axes to draw on; None creates new axes.
    """
    axes = axes_or_new(ax)
    draw_steps(axes, curves)
    _add_legend(axes, len(curves), n)
    return axes


def draw_bands(bands: pd.DataFrame, ax: Axes | None) -> Axes:
    """Draw bands on Q against load in one colour per texture, grey where extrapolated.

    Parameters
    ----------
    bands : pandas.DataFrame
        Columns of the run folder's bands.csv. The first twelve textures are drawn.
    ax : matplotlib.axes.Axes or None
        Axes to draw on; None creates new axes.
    """
    axes, shown, label = axes_or_new(ax), *_by_texture(bands)
    for rows, look in shown:
        rows = rows.sort_values("p_over_E")
        draw_band(axes, rows, look["color"])
        (line,) = axes.step(rows["p_over_E"], rows["q_median"], where="post", linewidth=1.2, **look)
        if len(rows) == 1:  # a single step has no length and would be invisible
            line.set_marker(".")
    axes.set_xlim(0.0, max(float(rows["p_over_E"].max()) for rows, _ in shown))
    axes.set(xlabel=f"{label} (square-root scale)", ylabel=f"{_COUNT}, {_band_title(bands)}")
    _add_legend(axes, len(shown), len(rows_by_texture(bands)))
    return axes


def draw_probabilities(q: IntArray, pmf: FloatArray, ax: Axes | None) -> Axes:
    """Draw the probability of each count as a bar."""
    axes = axes_or_new(ax)
    axes.bar(q, pmf, width=1.2, color=COLOURS["modified"])
    axes.set(xlabel=_COUNT, ylabel="probability")
    axes.set_xticks(q)
    return axes


def draw_distribution(
    p: FloatArray, cdf: FloatArray, ax: Axes | None, unit: str | None = None
) -> Axes:
    """Draw the distribution function of a load, in a unit or as p/E."""
    axes = axes_or_new(ax)
    axes.plot(p, cdf, color=COLOURS["modified"])
    axes.set(xlabel=load_label(unit), ylabel="probability that the count is reached", ylim=(0, 1))
    return axes


def draw_loads(loads: pd.DataFrame, ax: Axes | None) -> Axes:
    """Draw intervals of the load against Q in one colour per texture.

    Parameters
    ----------
    loads : pandas.DataFrame
        Columns of the run folder's loads.csv. The first twelve textures are drawn.
    ax : matplotlib.axes.Axes or None
        Axes to draw on; None creates new axes.
    """
    axes, shown, label = axes_or_new(ax), *_by_texture(loads)
    for i, (rows, look) in enumerate(shown):
        place = rows["Q"] + 1.2 * ((i + 0.5) / len(shown) - 0.5)
        draw_intervals(axes, place, rows, marker="o", markersize=4, capsize=2.5, **look)
    axes.set(xlabel=_COUNT, ylabel=f"{label}, {_band_title(loads)}", yscale="log")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True, steps=[2, 4, 10]))
    _add_legend(axes, len(shown), len(rows_by_texture(loads)))
    return axes


def draw_errors(loads: pd.DataFrame, form: str, ax: Axes | None) -> Axes:
    """Draw the deviation of predicted from observed loads in per cent, with bands.

    Parameters
    ----------
    loads : pandas.DataFrame
        Columns of the run folder's loads.csv, including p_over_E_observed.
    form : str
        Name of the form.
    ax : matplotlib.axes.Axes or None
        Axes to draw on; None creates new axes.
    """
    axes = axes_or_new(ax)
    observed = loads["p_over_E_observed"]
    draw_intervals(axes, observed, loads, observed, markersize=4, **look_of(form))
    axes.axhline(0, color="#000000", linewidth=1)
    label = f"load error of the prediction, %, {_band_title(loads)}"
    axes.set(xscale="log", xlabel=f"observed {_LOAD}", ylabel=label, title=title_of(form))
    return axes


def draw_forms(forms: pd.DataFrame, ax: Axes | None) -> Axes:
    """Draw the log Bayes factor of each form over the best one as a bar, with its probability.

    Parameters
    ----------
    forms : pandas.DataFrame
        Columns form, ln_bf, model_probability.
    ax : matplotlib.axes.Axes or None
        Axes to draw on; None creates new axes.
    """
    axes = axes_or_new(ax)
    weighed = forms[forms["ln_bf"].notna()]
    names = weighed["form"].tolist()
    axes.barh(range(len(names)), weighed["ln_bf"], color=[colour_of(name) for name in names])
    for place, share in enumerate(weighed["model_probability"]):
        axes.annotate(
            f"probability {share:.3g}", (0, place), (4, 0), textcoords="offset points", va="center"
        )
    axes.set_yticks(range(len(names)), [title_of(name) for name in names])
    axes.invert_yaxis()
    axes.margins(x=0.35)
    axes.set_xlabel("ln Bayes factor over the most probable form")
    return axes


def draw_plan(table: pd.DataFrame, relative: float | None, ax: Axes | None) -> Axes:
    """Draw the size of each effect as a bar; see `drawing.scenes.plot_effects`."""
    return draw_effects(axes_or_new(ax), table, relative)


def _by_texture(frame: pd.DataFrame) -> tuple[list[tuple[pd.DataFrame, dict[str, Any]]], str]:
    """Return the rows of the first textures with their looks, and the label of the load axis.

    Loads in a unit take the place of ratios p/E.
    """
    unit = str(frame["load_unit"].iloc[0]) if "load_unit" in frame else None
    if unit is not None:
        loads = frame.filter(regex="^load(_|$)").drop(columns="load_unit")
        frame = frame.assign(**loads.rename(columns=lambda x: x.replace("load", "p_over_E", 1)))
    by_texture = islice(rows_by_texture(frame).items(), MOST_TEXTURES)
    return [
        (rows, {"color": _COLOURS[i % len(_COLOURS)], "label": f"a/R {a:.4g}, b/R {b:.4g}"})
        for i, ((a, b), rows) in enumerate(by_texture)
    ], load_label(unit)


def _band_title(frame: pd.DataFrame) -> str:
    return f"{100 * frame['prob'].iloc[0]:g} % {frame['kind_of_band'].iloc[0]}"


def _add_legend(axes: Axes, n_shown: int, n: int) -> None:
    outside: Any = {"loc": "upper left", "bbox_to_anchor": (1.01, 1.0)}
    # A long legend would cover the data: it stands beside the axes.
    many = len(axes.get_legend_handles_labels()[1]) > MOST_LEGEND
    axes.legend(fontsize="small", **(outside if many else {}))
    if n_shown < n:
        axes.set_title(f"the first {n_shown} of {n:,}")
