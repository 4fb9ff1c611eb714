"""Figures of the forms against data: percent errors, the smooth cylinder, K against pitch."""

from collections.abc import Sequence
from typing import Any

import pandas as pd
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from ridgebayes.checks.smooth import SmoothCurve
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


def percent_error_figure(errors: pd.DataFrame) -> Figure:
    """Draw 100 (p_form/p_data - 1) against Q, a column a texture (the study's Figs 5 and 6).

    Parameters
    ----------
    errors : pandas.DataFrame
        As `ridgebayes.checks.load_errors.percent_errors` returns it.

    Returns
    -------
    matplotlib.figure.Figure
        Above all forms; below without Classic, whose errors hide the others, if it is there.
    """
    textures = list(dict.fromkeys(zip(errors["a_over_R"], errors["b_over_R"], strict=True)))
    forms = list(dict.fromkeys(errors["form"]))
    zoomed = [form for form in forms if form != "classic"]
    rows = [forms, zoomed] if zoomed and len(zoomed) < len(forms) else [forms]
    figure = new_figure(WIDTH, 1.3 + 2.4 * len(rows))
    panels = figure.subplots(len(rows), len(textures), squeeze=False, sharex="col")
    for j, (a, b) in enumerate(textures):
        here = errors[(errors["a_over_R"] == a) & (errors["b_over_R"] == b)]
        for i, shown in enumerate(rows):
            axes = panels[i, j]
            for form in shown:
                for coefficients, style in (("printed", "--"), ("calibrated", "-")):
                    part = here[(here["form"] == form) & (here["coefficients"] == coefficients)]
                    part = part.groupby("Q", as_index=False)["percent"].mean()
                    axes.plot(
                        part["Q"],
                        part["percent"],
                        style,
                        marker=MARKERS.get(form, "o"),
                        markersize=5,
                        markerfacecolor="#FFFFFF" if coefficients == "printed" else None,
                        color=COLOURS.get(form, QUIET),
                        linewidth=1.2,
                    )
            axes.axhline(0, color=OBSERVED, linewidth=0.8)
            axes.set_xticks(sorted(set(here["Q"]))[:: -(-here["Q"].nunique() // 8)])
        held_out = " (held out)" if (here["role"] == "held-out").all() else ""
        panels[0, j].set_title(texture_title(a, b) + held_out, fontsize=9)
        panels[-1, j].set_xlabel("edges in contact $Q$")
    for axes, words in zip(panels[:, 0], ("", "\n(without Classic)"), strict=False):
        axes.set_ylabel(f"load error, %{words}")
    handles = [
        Line2D([], [], color=COLOURS.get(f, QUIET), marker=MARKERS.get(f, "o"), label=title_of(f))
        for f in forms
    ]
    handles.append(Line2D([], [], color=QUIET, label="calibrated"))
    if (errors["coefficients"] == "printed").any():
        handles.append(
            Line2D(
                [],
                [],
                color=QUIET,
                linestyle="--",
                marker="o",
                markerfacecolor="#FFFFFF",
                label="printed",
            )
        )
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))
    return figure


def smooth_figure(curves: Sequence[SmoothCurve]) -> Figure:
    """Draw the smooth cylinder's contact length, in ridge units, against Hertz (Fig. 3).

    Parameters
    ----------
    curves : sequence of SmoothCurve
        As `ridgebayes.checks.smooth.smooth_cylinder` returns them.

    Returns
    -------
    matplotlib.figure.Figure
        Left Q' against load, right the error of Hertz in Q'.
    """
    looks: dict[str, dict[str, Any]] = {
        "half-plane": {"color": COLOURS["half-plane"], "linewidth": 1.6},
        "small-strain": {"color": COLOURS["modified"], "marker": "s", "linestyle": "none"},
        "neo-hooke": {"color": COLOURS["classic"], "marker": "o", "linestyle": "none"},
    }
    names = {
        "half-plane": "half-plane equation, no grooves",
        "small-strain": "finite elements, small strain",
        "neo-hooke": "finite elements, neo-Hookean",
    }
    figure = new_figure(WIDTH, 3.6)
    left, right = figure.subplots(1, 2)
    first = curves[0]
    for curve in curves:
        look = looks.get(curve.name, {})
        left.plot(curve.p_over_E, curve.count, label=names.get(curve.name, curve.name), **look)
        right.plot(curve.p_over_E, 100 * (curve.hertz / curve.count - 1), **look)
    left.plot(
        first.p_over_E, first.hertz, "--", color=OBSERVED, linewidth=1, label="Hertz, eq. (1)"
    )
    left.set_ylabel("contact length in ridges, $Q'$ of eq. (2)")
    right.set_ylabel("error of Hertz in $Q'$, %")
    right.axhline(0, color=OBSERVED, linestyle="--", linewidth=1)
    for axes in (left, right):
        axes.set_xlabel("$p/E$ (dimensionless)")
    right.set_ylim(min(-0.5, right.get_ylim()[0]), max(2.2, right.get_ylim()[1]))
    right.axhline(2, color=QUIET, linestyle=":", linewidth=1.2)
    right.annotate(
        "2 %: the study's largest error",
        (0.98, 2),
        xycoords=("axes fraction", "data"),
        xytext=(0, -4),
        textcoords="offset points",
        ha="right",
        va="top",
        fontsize=8,
        color="#555555",
    )
    handles, labels = left.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=2)
    return figure


def slope_figure(slopes: pd.DataFrame) -> Figure:
    """Draw K = dQ'/ds against pitch: the power law's beside what Modified and Hybrid predict.

    Parameters
    ----------
    slopes : pandas.DataFrame
        As `checks.load_errors.slopes_table` returns it, without Classic: its intercept differs.

    Returns
    -------
    matplotlib.figure.Figure
        Left K, right K times pitch over two: the c that a texture alone would ask for.
    """
    figure = new_figure(WIDTH, 3.9)
    left, right = figure.subplots(1, 2)
    step = 0.018 * (slopes["pitch"].max() - slopes["pitch"].min())
    for axes, scaled in ((left, False), (right, True)):
        for form in dict.fromkeys(slopes["form"]):
            rows = slopes[slopes["form"] == form].sort_values("pitch")
            colour, label = COLOURS.get(form, QUIET), title_of(form)
            if form == "modified":
                rows = rows.drop_duplicates("pitch")
            pitch = rows["pitch"].to_numpy()
            factor = pitch / 2 if scaled else 1.0
            k, low, high = (rows[c].to_numpy() * factor for c in ("K", "K_lower", "K_upper"))
            if form == "modified":  # one number for all textures: a line
                axes.plot(pitch, k, linewidth=1.4, color=colour, label=label)
                axes.fill_between(pitch, low, high, color=colour, alpha=0.2, linewidth=0)
                continue
            axes.errorbar(
                # Beside the power law's own, not on it.
                pitch + (step if form == "hybrid" else 0.0),
                k,
                yerr=[k - low, high - k],
                fmt=MARKERS.get(form, "o"),
                markersize=5,
                capsize=2,
                linewidth=1.1,
                color=colour,
                label=label,
            )
        axes.xaxis.set_major_locator(MaxNLocator(6))
        axes.set_xlabel("pitch $L = (a + b)/R$ (dimensionless)")
    left.set_ylabel("$K = dQ'/ds$ (dimensionless)")
    right.set_ylabel("$K L/2$ (dimensionless)")
    handles, labels = left.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
    return figure
