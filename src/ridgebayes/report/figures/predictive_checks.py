"""Figures of predictive checks: replicated quantities, and what the priors say of the loads."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, MaxNLocator

from ridgebayes.checks.predictive_checks import QUANTITIES, PredictiveChecks
from ridgebayes.drawing.style import (
    COLOURS,
    OBSERVED,
    QUIET,
    WIDTH,
    new_figure,
    styled,
    texture_title,
    title_of,
)
from ridgebayes.errors import InputError
from ridgebayes.model.observations import Observations
from ridgebayes.report.figures.bands import MOST_TEXTURES

_N_BIN = 40
_SHOWN = 0.998  # share of the draws that the axis holds: single far ones would squeeze the rest


@styled()
def plot_posterior_checks(checks: PredictiveChecks) -> Figure:
    """Draw each test quantity of replicated rows beside that of the observed ones.

    Parameters
    ----------
    checks : PredictiveChecks
        What `posterior_checks` found.

    Returns
    -------
    matplotlib.figure.Figure
        A panel a quantity: both distributions over the posterior's draws, and the p-value.
    """
    n_column = min(3, len(checks.names))
    n_row = -(-len(checks.names) // n_column)
    figure = new_figure(WIDTH, 1.1 + 2.2 * n_row)
    panels = figure.subplots(n_row, n_column, squeeze=False)
    colour = COLOURS.get(checks.form, QUIET)
    for i, axes in enumerate(panels.flat):
        if i >= len(checks.names):
            axes.set_visible(False)
            continue
        name = checks.names[i]
        replicated, observed = checks.replicated[:, i], checks.observed[:, i]
        both = np.concatenate([replicated, observed])
        low, high = np.quantile(both, [0.5 - _SHOWN / 2, 0.5 + _SHOWN / 2])
        edges = np.linspace(low, high if high > low else low + 1, _N_BIN + 1)
        axes.hist(replicated, edges, density=True, color=colour, alpha=0.5, label="replicated")
        # The observed one hardly varies: as a histogram it would tower over the other.
        span = np.quantile(observed, [0.05, 0.95])
        axes.axvline(float(observed.mean()), color=OBSERVED, linewidth=1.4, label="observed: mean")
        axes.axvspan(
            *span, color=OBSERVED, alpha=0.18, linewidth=0, label="observed: 90 % of the draws"
        )
        axes.set_title(f"{QUANTITIES[name]}\n{_p(checks.p_values[name])}", fontsize=9)
        axes.set_yticks([])
        axes.grid(visible=False)
        axes.spines["left"].set_visible(False)
        axes.xaxis.set_major_locator(MaxNLocator(4))
        axes.margins(x=0.03)
    handles, labels = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=3)
    return figure


@styled()
def plot_prior_bands(bands: pd.DataFrame, data: Observations, form: str) -> Figure:
    """Draw what the priors say of the load, texture by texture, with the rows.

    Parameters
    ----------
    bands : pandas.DataFrame
        As `prior_bands` returns it.
    data : Observations
        Rows: exact ones are shown as dots.
    form : str
        Name of the form.

    Returns
    -------
    matplotlib.figure.Figure
        A panel a texture, of the first `MOST_TEXTURES`: the load on a logarithmic axis over Q.

    Raises
    ------
    InputError
        If there are no bands.
    """
    if bands.empty:
        raise InputError("bands: expected at least one, got none")
    textures = list(dict.fromkeys(zip(bands["a_over_R"], bands["b_over_R"], strict=True)))
    textures = textures[:MOST_TEXTURES]
    n_column = min(3, len(textures))
    n_row = -(-len(textures) // n_column)
    figure = new_figure(WIDTH, 1.1 + 2.2 * n_row)
    panels = figure.subplots(n_row, n_column, squeeze=False, sharex=True, sharey=True)
    colour, exact = COLOURS.get(form, QUIET), data.is_exact
    for i, axes in enumerate(panels.flat):
        if i >= len(textures):
            axes.set_visible(False)
            continue
        a, b = textures[i]
        own = bands[(bands["a_over_R"] == a) & (bands["b_over_R"] == b)].sort_values("Q")
        lower, median, upper = (np.exp(own[name]) for name in ("lower", "median", "upper"))
        share = f"{100 * own['prob'].iloc[0]:g} %"
        axes.fill_between(
            own["Q"],
            lower,
            upper,
            color=colour,
            alpha=0.25,
            linewidth=0,
            label=f"{title_of(form)}: prior, {share}",
        )
        # A band over one count has no width: its ends are drawn as well.
        axes.vlines(own["Q"], lower, upper, color=colour, linewidth=0.8, alpha=0.6)
        axes.plot(own["Q"], median, color=colour, linewidth=1.2, label="median")
        place = data.textures.index((a, b))
        rows = (data.texture == place) & exact
        axes.plot(
            data.Q[rows],
            np.exp(data.log_load[rows]),
            ".",
            color=OBSERVED,
            markersize=5,
            label="rows",
        )
        axes.set_title(texture_title(a, b), fontsize=9)
        _axes(axes, i + n_column >= len(textures), i % n_column == 0, bands)
    handles, labels = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=3)
    return figure


def _axes(axes: Axes, is_last: bool, is_first: bool, bands: pd.DataFrame) -> None:
    axes.set_yscale("log")
    low, high = np.log10(np.exp([bands["lower"].min(), bands["upper"].max()]))
    powers = np.arange(np.floor(low), np.ceil(high) + 1)
    if high - low < 6:  # with few decades the 3s between them help
        powers = np.sort(np.concatenate([powers, powers + np.log10(3)]))
    axes.yaxis.set_major_locator(FixedLocator(list(10**powers)))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.2g}"))
    axes.minorticks_off()
    axes.xaxis.set_major_locator(MaxNLocator(5, integer=True, steps=[2, 4, 10]))
    if is_last:
        axes.tick_params(labelbottom=True)
        axes.set_xlabel("$Q$")
    if is_first:
        axes.set_ylabel("load $p/E$")


def _p(p_value: float) -> str:
    if p_value < 0.001:
        return "$p$ < 0.001"
    return "$p$ > 0.999" if p_value > 0.999 else f"$p$ = {p_value:.3f}"
