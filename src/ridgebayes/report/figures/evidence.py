"""Figures of the evidence: Bayes factors by method, and against the scale of every prior."""

import pandas as pd
from matplotlib.figure import Figure

from ridgebayes.drawing.style import (
    COLOURS,
    MARKERS,
    MINUS,
    QUIET,
    WIDTH,
    new_figure,
    plain,
    title_of,
)

_METHODS = {"bridge": "o", "quadrature": "s", "laplace": "^", "savage-dickey": "D", "dynesty": "v"}
_PRIORS = {"c": "$c$ and $c_1$", "c2": "$c_2$", "K": "$K$", "sigma": r"$\sigma$"}


def forest_figure(factors: pd.DataFrame, best: str) -> Figure:
    """Draw ln BF of every form against the best one, by every method.

    Parameters
    ----------
    factors : pandas.DataFrame
        Columns form, method, ln_bf, ln_bf_se: form over best, so at most 0 up to error.
    best : str
        Form of highest evidence.

    Returns
    -------
    matplotlib.figure.Figure
        A row a form; behind it the readings of Kass and Raftery.
    """
    forms = list(dict.fromkeys(factors.sort_values("ln_bf", ascending=False)["form"]))
    figure = new_figure(WIDTH, 1.5 + 0.75 * len(forms))
    axes = figure.subplots()
    lowest = min(float(factors["ln_bf"].min()) * 1.08, -6.0)
    for low, high, shade in ((-1, 0, 0.0), (-3, -1, 0.025), (-5, -3, 0.05), (lowest, -5, 0.075)):
        axes.axvspan(low, high, color="#000000", alpha=shade, linewidth=0)
    for i, form in enumerate(forms):
        rows = factors[factors["form"] == form]
        for k, row in enumerate(rows.to_dict("records")):
            error = row["ln_bf_se"] if row["ln_bf_se"] == row["ln_bf_se"] else 0.0
            axes.errorbar(
                row["ln_bf"],
                i + 0.62 * ((k + 0.5) / len(rows) - 0.5),
                xerr=error,
                fmt=_METHODS.get(row["method"], "o"),
                color=COLOURS.get(form, QUIET),
                markersize=5,
                capsize=2,
            )
        middle = float(rows["ln_bf"].iloc[0])
        room = middle > 0.6 * lowest  # else the number would stand outside on the left
        axes.annotate(
            f"{middle:.2f}".replace("-", MINUS),
            (middle, i),
            xytext=(-10 if room else 10, 0),
            textcoords="offset points",
            ha="right" if room else "left",
            va="center",
        )
    axes.set_xlim(lowest, max(1.0, -0.03 * lowest))
    axes.set_ylim(len(forms) - 0.5, -0.5)
    axes.set_yticks(range(len(forms)), [title_of(form) for form in forms])
    axes.axvline(0, color="#000000", linewidth=1)
    axes.grid(axis="y", visible=False)
    axes.set_xlabel(
        f"ln Bayes factor against {title_of(best)} "
        "(shades: positive, strong, very strong, from 1, 3, 5 on)"
    )
    used = [method for method in _METHODS if (factors["method"] == method).any()]
    handles = [
        axes.plot([], [], _METHODS[m], color=QUIET, linestyle="none", label=m)[0] for m in used
    ]
    figure.legend(handles=handles, loc="outside upper center", ncols=len(used))
    return figure


def sensitivity_figure(factors: pd.DataFrame, best: str) -> Figure:
    """Draw ln BF of every form against the best one, as each prior's scale is changed.

    Parameters
    ----------
    factors : pandas.DataFrame
        Columns prior, factor, form, ln_bf.
    best : str
        Form that the others are compared with.

    Returns
    -------
    matplotlib.figure.Figure
        A panel a prior, the vertical axis linear within 5 of zero and logarithmic beyond.
    """
    priors = list(dict.fromkeys(factors["prior"]))
    figure = new_figure(WIDTH, 3.9)
    panels = figure.subplots(1, len(priors), squeeze=False, sharey=True)[0]
    for axes, prior in zip(panels, priors, strict=True):
        for form in dict.fromkeys(factors["form"]):
            rows = factors[(factors["prior"] == prior) & (factors["form"] == form)].dropna()
            axes.plot(
                rows["factor"],
                rows["ln_bf"],
                marker=MARKERS.get(form, "o"),
                markersize=3.5,
                linewidth=1.2,
                color=COLOURS.get(form, QUIET),
                label=title_of(form),
            )
        axes.axhline(0, color="#000000", linewidth=1)
        axes.axvline(1, color=QUIET, linewidth=1, linestyle=":")
        axes.set_xscale("log")
        axes.set_yscale("symlog", linthresh=5, linscale=1.5)
        axes.set_title(f"prior of {_PRIORS.get(prior) or plain(prior)}")
        axes.set_xlabel("scale, times default")
    low, high = factors["ln_bf"].min(), factors["ln_bf"].max()
    ticks = [t for t in (-100, -50, -20, -10, -5, -3, -1, 1, 3, 5, 10, 20) if low <= t <= high]
    panels[0].set_yticks([*ticks, 0], [f"{t}".replace("-", MINUS) for t in (*ticks, 0)])
    panels[0].minorticks_off()
    panels[0].set_ylabel(f"ln Bayes factor against {title_of(best)}")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
    return figure
