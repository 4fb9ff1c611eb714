"""Figures of predictions: Q against load with bands, and observed loads beside their bands."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from ridgebayes._types import FloatArray
from ridgebayes.drawing.style import (
    COLOURS,
    MARKERS,
    OBSERVED,
    QUIET,
    WIDTH,
    new_figure,
    texture_title,
    title_of,
)

MOST_TEXTURES = 12


def bands_figure(
    bands: pd.DataFrame, table: pd.DataFrame, form: str, *, n_texture: int | None = None
) -> Figure:
    """Draw Q against load with the bands of one form, a panel a texture.

    Parameters
    ----------
    bands : pandas.DataFrame
        As `ridgebayes.comparison.bands.bands_table` returns it.
    table : pandas.DataFrame
        Rows of the contact table with status ok: the observed steps.
    form : str
        Form, or ``average``.
    n_texture : int, optional
        How many textures there are, if not all are in `bands`.

    Returns
    -------
    matplotlib.figure.Figure
        Simulation band light, curve band dark, where extrapolated hatched and grey.
    """
    bands = bands[bands["form"] == form]
    textures = list(
        dict.fromkeys(zip(bands["a_over_R"], bands["b_over_R"], strict=True)),
    )
    shown = textures[:MOST_TEXTURES]
    n_column = min(3, len(shown))
    n_row = -(-len(shown) // n_column)
    figure = new_figure(WIDTH, 1.2 + 2.15 * n_row)
    panels = figure.subplots(n_row, n_column, squeeze=False)
    for axes, (a, b) in zip(panels.flat, shown, strict=False):
        here = bands[(bands["a_over_R"] == a) & (bands["b_over_R"] == b)]
        rows = table[(table["a_over_R"] == a) & (table["b_over_R"] == b)]
        _panel(axes, here, rows, COLOURS.get(form, QUIET))
        held_out = " (held out)" if len(rows) and (rows["role"] == "held-out").all() else ""
        axes.set_title(texture_title(a, b) + held_out, fontsize=9)
    for axes in panels.flat[len(shown) :]:
        axes.set_visible(False)
    for i in range(len(shown)):
        if i + n_column >= len(shown):
            panels.flat[i].set_xlabel("$p/E$ (dimensionless)")
        if i % n_column == 0:
            panels.flat[i].set_ylabel("edges in contact $Q$")
    _legend(figure, COLOURS.get(form, QUIET), float(bands["prob"].iloc[0]))
    total = n_texture or len(textures)
    more = f", {len(shown)} of {total} textures" if len(shown) < total else ""
    figure.suptitle(f"{title_of(form)}: Q against load{more}", fontsize=11)
    return figure


def _panel(axes: Axes, bands: pd.DataFrame, rows: pd.DataFrame, colour: str) -> None:
    for kind, alpha in (("simulation", 0.30), ("curve", 0.75)):
        part = bands[bands["kind_of_band"] == kind].sort_values("p_over_E")
        p, lower, upper = (part[c].to_numpy(float) for c in ("p_over_E", "q_lower", "q_upper"))
        outside = part["extrapolation"].to_numpy(bool)
        for is_outside in (False, True):
            # A band one value high would be no area at all: it is given a little height.
            axes.fill_between(
                p,
                lower - 0.25,
                upper + 0.25,
                where=(outside == is_outside).tolist(),
                step="post",
                linewidth=0,
                color="#9A9A9A" if is_outside else colour,
                hatch="////" if is_outside and kind == "simulation" else None,
                edgecolor="#FFFFFF" if is_outside else None,
                alpha=alpha,
            )
    for _, curve in rows.groupby(["nu", "solver", "series"], dropna=False, sort=False):
        rise = curve.sort_values("p_over_E")
        load, q = rise["p_over_E"].to_numpy(), rise["Q"].to_numpy()
        axes.step(
            np.concatenate([[0.0], load]),
            np.concatenate([[q[0] - 2], q]),
            where="post",
            color=OBSERVED,
            linewidth=1.0,
        )
        axes.plot(load, q, ".", color=OBSERVED, markersize=6)
    # Q grows with the root of the load: on this axis its steps are equally wide.
    axes.set_xscale("function", functions=(_root, np.square))
    axes.set_xlim(0.0, float(bands["p_over_E"].max()))
    axes.xaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))
    axes.yaxis.set_major_locator(MaxNLocator(6, integer=True, steps=[2, 4, 10]))


def _root(p: FloatArray) -> FloatArray:
    return np.sqrt(np.maximum(p, 0.0))


def _legend(figure: Figure, colour: str, prob: float) -> None:
    handles = [
        Line2D([], [], color=OBSERVED, marker=".", markersize=7, linewidth=1, label="observed"),
        Patch(color=colour, alpha=0.75, linewidth=0, label=f"curve, {100 * prob:.0f} %"),
        Patch(color=colour, alpha=0.30, linewidth=0, label=f"simulation, {100 * prob:.0f} %"),
        Patch(
            facecolor="#9A9A9A", alpha=0.5, hatch="////", edgecolor="#FFFFFF", label="extrapolation"
        ),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=4)


def held_out_figure(loads: pd.DataFrame) -> Figure:
    """Draw predicted over observed load of held-out transitions, form by form.

    Parameters
    ----------
    loads : pandas.DataFrame
        Rows of `comparison.bands.loads_table` that were held out, kind_of_band simulation.

    Returns
    -------
    matplotlib.figure.Figure
        In per cent of the observed load; the bands have the probability of the table.
    """
    textures = list(dict.fromkeys(zip(loads["a_over_R"], loads["b_over_R"], strict=True)))[:3]
    forms = list(dict.fromkeys(loads["form"]))
    figure = new_figure(WIDTH, 3.6)
    panels = figure.subplots(1, len(textures), squeeze=False)
    for axes, (a, b) in zip(panels.flat, textures, strict=True):
        here = loads[(loads["a_over_R"] == a) & (loads["b_over_R"] == b)]
        for k, form in enumerate(forms):
            rows = here[here["form"] == form]
            observed = rows["p_over_E_observed"].to_numpy()
            middle, low, high = (
                100 * (rows[f"p_over_E_{name}"].to_numpy() / observed - 1)
                for name in ("median", "lower", "upper")
            )
            axes.errorbar(
                rows["Q"].to_numpy() + 1.4 * ((k + 0.5) / len(forms) - 0.5),
                middle,
                yerr=[middle - low, high - middle],
                fmt=MARKERS.get(form, "o"),
                color=COLOURS.get(form, QUIET),
                markersize=5,
                capsize=2.5,
                linewidth=1.3,
                label=title_of(form),
            )
        axes.axhline(0, color=OBSERVED, linewidth=1)
        axes.set_xticks(sorted(set(here["Q"])))
        axes.set_xlabel("edges in contact $Q$")
        axes.set_title(texture_title(a, b))
    panels[0, 0].set_ylabel("load error of the prediction, %")
    handles, labels = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(forms))
    return figure
