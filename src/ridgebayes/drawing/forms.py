"""Figures of the forms: load errors, slopes and Bayes factors."""

from collections.abc import Iterable
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from ridgebayes.drawing.style import (
    MOST_LEGEND,
    OBSERVED,
    QUIET,
    WIDTH,
    colour_of,
    look_of,
    new_figure,
    panel_grid,
    plain,
    rows_by_texture,
    shared_legend,
    styled,
    symbol,
    texture_title,
    title_of,
)
from ridgebayes.runtime.text import MINUS

_SUMMED = "summed out"  # Bayes factors over all error models instead of the selected one
_METHODS = {
    _SUMMED: "*",
    "bridge": "o",
    "importance": "s",
}
_PRIORS = {"c": "$c$ and $c_1$", "c2": "$c_2$", "K": "$K$", "sigma": r"$\sigma$"}


@styled()
def plot_percent_errors(errors: pd.DataFrame) -> Figure:
    """Draw 100 (p_form/p_data - 1) against Q, one column for each texture.

    Parameters
    ----------
    errors : pandas.DataFrame
        Columns form, coefficients (calibrated, published), a_over_R, b_over_R, Q, role, percent.

    Returns
    -------
    matplotlib.figure.Figure
        The upper panels show all forms. If Classic is among them, the lower panels leave it out,
        because its errors hide the others.
    """
    textures = rows_by_texture(errors)
    forms = list(dict.fromkeys(errors["form"]))
    zoomed = [form for form in forms if form != "classic"]
    rows = [forms, zoomed] if zoomed and len(zoomed) < len(forms) else [forms]
    figure = new_figure(WIDTH, 1.3 + 1.7 * len(rows))
    panels = figure.subplots(len(rows), len(textures), squeeze=False, sharex="col")
    hollow: dict[str, Any] = {"linestyle": "--", "markerfacecolor": "#FFFFFF"}
    for column, (texture, here) in zip(panels.T, textures.items(), strict=True):
        for axes, shown in zip(column, rows, strict=True):
            for form in shown:
                for coefficients, style in (("published", hollow), ("calibrated", {})):
                    part = here[(here["form"] == form) & (here["coefficients"] == coefficients)]
                    part = part.groupby("Q", as_index=False)["percent"].mean()
                    look = look_of(form) | {"markersize": 5, "linewidth": 1.2} | style
                    axes.plot(part["Q"], part["percent"], **look)
            axes.axhline(0, color=OBSERVED, linewidth=0.8)
            axes.set_xticks(sorted(set(here["Q"]))[:: -(-here["Q"].nunique() // 8)])
        column[0].set_title(texture_title(texture, here), fontsize=9)
        column[-1].set_xlabel("edges in contact $Q$")
    for axes, words in zip(panels[:, 0], ("", "\n(without Classic)"), strict=False):
        axes.set_ylabel(f"load error, %{words}")
    handles = [Line2D([], [], **look_of(form)) for form in forms]
    if (errors["coefficients"] == "published").any():
        handles.append(Line2D([], [], color=QUIET, label="calibrated"))
        handles.append(Line2D([], [], color=QUIET, marker="o", label="published", **hollow))
    figure.legend(handles=handles, loc="outside lower center", ncols=MOST_LEGEND)
    return figure


@styled()
def plot_slopes(slopes: pd.DataFrame) -> Figure:
    """Draw K = dQ'/ds against pitch, fitted by the power law and predicted by Modified and Hybrid.

    Parameters
    ----------
    slopes : pandas.DataFrame
        Columns form, pitch, K, K_lower, K_upper, prob. Classic is left out: its intercept differs.

    Returns
    -------
    matplotlib.figure.Figure
        The left panel shows K. The right panel shows K times half the pitch: the c that each
        texture alone would give.
    """
    figure = new_figure(WIDTH, 3.9)
    left, right = figure.subplots(1, 2)
    step = 0.018 * (slopes["pitch"].max() - slopes["pitch"].min())
    level = f"{100 * slopes['prob'].iloc[0]:g} %"
    for axes, scaled in ((left, False), (right, True)):
        for form in dict.fromkeys(slopes["form"]):
            rows = slopes[slopes["form"] == form].sort_values("pitch")
            colour = colour_of(form)
            # Modified has a single line, because its c holds for all textures.
            rows = rows.drop_duplicates("pitch") if form == "modified" else rows
            pitch = rows["pitch"].to_numpy()
            factor = pitch / 2 if scaled else 1.0
            k, low, high = (rows[c].to_numpy() * factor for c in ("K", "K_lower", "K_upper"))
            if form == "modified":
                axes.plot(pitch, k, linewidth=1.4, color=colour, label=title_of(form))
                look: dict[str, Any] = {"color": colour, "alpha": 0.2, "linewidth": 0}
                label = f"{title_of(form)}, {level} band"
                axes.fill_between(pitch, low, high, label=label, **look)
                continue
            axes.errorbar(
                # Shifted so that it does not cover the power law.
                pitch + (step if form == "hybrid" else 0.0),
                k,
                yerr=[k - low, high - k],
                linestyle="none",
                markersize=5,
                capsize=2,
                elinewidth=1.1,
                **(look_of(form) | {"label": f"{title_of(form)}, {level} bar"}),
            )
        axes.xaxis.set_major_locator(MaxNLocator(6))
        axes.set_xlabel("pitch $L = (a + b)/R$ (dimensionless)")
    left.set_ylabel("$K = dQ'/ds$ (dimensionless)")
    right.set_ylabel("$K L/2$ (dimensionless)")
    shared_legend(figure, left)
    return figure


@styled()
def plot_bayes_factors(factors: pd.DataFrame, best: str, noise: str = "iid") -> Figure:
    """Draw ln BF of every form against the best form, by every method.

    Parameters
    ----------
    factors : pandas.DataFrame
        Columns form, method, ln_bf, ln_bf_se of each form over the best. The method
        ``summed out`` averages over all error models; its value is printed.
    best : str
        Form of highest evidence.
    noise : str, optional
        Error model of the other methods.

    Returns
    -------
    matplotlib.figure.Figure
        Each form has a row. Shading in the background marks the grades of Kass and Raftery.
    """
    forms = list(dict.fromkeys(factors.sort_values("ln_bf", ascending=False)["form"]))
    methods = set(factors["method"])
    # Methods unknown to this module are named too.
    markers = {m: _METHODS.get(m, "X") for m in (*_METHODS, *sorted(methods)) if m in methods}
    is_summed = _SUMMED in methods
    figure = new_figure(WIDTH, 1.5 + 0.5 * len(forms))
    axes = figure.subplots()
    lowest = min(float(factors["ln_bf"].min()) * 1.08, -6.0)
    for low, high, shade in ((-1, 0, 0.0), (-3, -1, 0.025), (-5, -3, 0.05), (lowest, -5, 0.075)):
        axes.axvspan(low, high, color="#000000", alpha=shade, linewidth=0)
    for i, form in enumerate(forms):
        rows = factors[factors["form"] == form]
        for k, row in enumerate(rows.to_dict("records")):
            axes.errorbar(
                row["ln_bf"],
                i + 0.62 * ((k + 0.5) / len(rows) - 0.5),
                xerr=np.nan_to_num(row["ln_bf_se"]),
                fmt=markers[row["method"]],
                color=colour_of(form),
                markersize=11 if row["method"] == _SUMMED else 5,
                alpha=0.5 if is_summed and row["method"] != _SUMMED else 1.0,
                capsize=2,
            )
        middle = float(rows["ln_bf"].iloc[0])
        height = i + 0.31 * (1 / len(rows) - 1) if is_summed else i
        room = middle > 0.6 * lowest  # otherwise the number would cross the left edge
        axes.annotate(
            f"{round(middle, 1) + 0.0:.1f}".replace("-", MINUS),
            (middle, height),
            xytext=(-10 if room else 10, 0),
            textcoords="offset points",
            ha="right" if room else "left",
            va="center",
        )
    highest = max(1.0, -0.03 * lowest, 1.08 * float(factors["ln_bf"].max()))
    axes.set(xlim=(lowest, highest), ylim=(len(forms) - 0.5, -0.5))
    axes.set_yticks(range(len(forms)), [title_of(form) for form in forms])
    axes.axvline(0, color="#000000", linewidth=1)
    axes.grid(axis="y", visible=False)
    axes.set_xlabel(f"ln Bayes factor against {title_of(best)} (shading starts at 1, 3, 5)")
    handles = [
        axes.plot([], [], marker, color=QUIET, linestyle="none", label=label)[0]
        for label, marker in zip(_labels(markers, noise), markers.values(), strict=True)
    ]
    figure.legend(handles=handles, loc="outside upper center", ncols=3)
    return figure


def _labels(methods: Iterable[str], noise: str) -> list[str]:
    """Return the legend label of each method, with its error model."""
    methods = list(methods)
    if _SUMMED not in methods:
        return [plain(method) for method in methods]
    others = [plain(f"{method} ({noise})", 40) for method in methods if method != _SUMMED]
    return ["error models summed out", *others]


@styled()
def plot_prior_sensitivity(factors: pd.DataFrame, best: str) -> Figure:
    """Draw ln BF of every form against the best form, for rescaled priors.

    Parameters
    ----------
    factors : pandas.DataFrame
        Columns prior, factor, form, ln_bf.
    best : str
        Form that the others are compared with.

    Returns
    -------
    matplotlib.figure.Figure
        Each prior has a panel. The vertical axis is linear within 5 of zero, else logarithmic.
    """
    priors = list(dict.fromkeys(factors["prior"]))
    labels = ("scale, times default", "ln BF")
    figure, panels = panel_grid(len(priors), 1.5, 0.9, labels=labels, sharex=True, sharey=True)
    panels[0].set_yscale("symlog", linthresh=5, linscale=1.5)  # of all panels, which share axes
    panels[0].set_xscale("log")
    for axes, prior in zip(panels, priors, strict=True):
        for form in dict.fromkeys(factors["form"]):
            rows = factors[(factors["prior"] == prior) & (factors["form"] == form)].dropna()
            rows = rows.sort_values("factor")
            look = look_of(form) | {"markersize": 3.5, "linewidth": 1.2}
            axes.plot(rows["factor"], rows["ln_bf"], **look)
        axes.axhline(0, color="#000000", linewidth=1)
        axes.axvline(1, color=QUIET, linewidth=1, linestyle=":")
        axes.set_title(f"prior of {_PRIORS.get(prior) or symbol(prior)}")
    figure.suptitle(f"ln Bayes factor against {title_of(best)}", fontsize=10)
    low, high = factors["ln_bf"].min(), factors["ln_bf"].max()
    ticks = [t for t in (-100, -20, -5, 5, 20) if low <= t <= high]
    panels[0].set_yticks([*ticks, 0], [f"{t}".replace("-", MINUS) for t in (*ticks, 0)])
    panels[0].minorticks_off()
    shared_legend(figure, panels[0])
    return figure
