"""Figures of one fit: the corner plot of its posterior, and the traces of its ensembles."""

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.drawing.style import COLOURS, DPI, QUIET, WIDTH, new_figure, symbol, title_of
from ridgebayes.results import Fit

MOST_PARAMETERS = 12  # a corner plot of more cannot be read, and traces fill pages


def corner_figure(fit: Fit) -> Figure:
    """Draw all one- and two-parameter marginals of a posterior.

    Parameters
    ----------
    fit : Fit
        Its thinned draws are shown, so that a fit read back from a file gives the same figure.

    Returns
    -------
    matplotlib.figure.Figure
        Dashed lines where the study's printed coefficients stand, if it printed any.
    """
    import corner

    names, shown = _shown(fit)
    draws = fit.draws[:, shown]
    powers = _powers(draws)
    draws = draws * 10.0**powers
    n = len(shown)
    size = min(2.0 + 1.6 * n, 11.0)
    figure = Figure(figsize=(size, size), dpi=DPI)
    FigureCanvasAgg(figure)
    colour = COLOURS.get(fit.form.name, QUIET)
    # A draw far out in a tail must not squeeze the rest of the panel.
    span = [tuple(np.quantile(x, [0.0005, 0.9995])) for x in draws.T]
    printed = fit.form.printed or ()
    truths = [
        printed[i] * 10.0**power if i < len(printed) else None
        for i, power in zip(shown, powers.tolist(), strict=True)
    ]
    inside = [
        t if t is not None and low < t < high else None
        for t, (low, high) in zip(truths, span, strict=True)
    ]
    corner.corner(
        draws,
        fig=figure,
        range=span,
        bins=36,
        smooth=0.9,
        color=colour,
        labels=[
            _scaled(name, power).replace(" ", "\n" if n >= 6 else " ", 1)
            for name, power in zip(names, powers.tolist(), strict=True)
        ],
        truths=inside,
        truth_color="#000000",
        plot_datapoints=False,
        plot_density=False,
        fill_contours=True,
        levels=(0.39, 0.86),  # one and two standard deviations of a normal in two dimensions
        quantiles=(0.05, 0.5, 0.95),
        max_n_ticks=4 if n < 6 else 3,
        labelpad=-0.06 if n < 6 else 0.2,
        label_kwargs={"fontsize": 10 if n < 6 else 7.5},
        hist_kwargs={"linewidth": 1.2},
    )
    for axes in figure.axes:
        axes.grid(False)
        axes.tick_params(labelsize=8 if n < 6 else 7)
        for line in axes.lines:
            line.set_linewidth(0.9)
    left = (0.85 if n < 6 else 1.1) / size
    figure.subplots_adjust(left=left, bottom=left, right=1 - 0.3 / size, top=1 - 0.45 / size)
    note = "" if n == fit.model.n_parameter else f" ({n} of {fit.model.n_parameter} parameters)"
    figure.suptitle(f"{title_of(fit.form.name)}: posterior{note}", y=1 - 0.1 / size, va="top")
    return figure


def trace_figure(fit: Fit) -> Figure:
    """Draw each ensemble's mean over its walkers, step by step, for each parameter.

    Parameters
    ----------
    fit : Fit
        Its thinned steps are shown.

    Returns
    -------
    matplotlib.figure.Figure
        One panel a parameter, one line an ensemble; the grey band is where the means of that
        many independent draws fall 19 times in 20.
    """
    names, shown = _shown(fit)
    theta = fit.model.to_theta(fit.kept_chains.u)[..., shown]
    powers = _powers(theta.reshape(-1, len(shown)))
    theta = theta * 10.0**powers
    n_walker = theta.shape[2]
    n_column = min(3, len(shown))
    n_row = -(-len(shown) // n_column)
    figure = new_figure(WIDTH, 0.7 + 1.75 * n_row)
    panels = figure.subplots(n_row, n_column, squeeze=False, sharex=True)
    summary = fit.summary.set_index("parameter")
    steps = np.arange(1, theta.shape[1] + 1)
    for i, axes in enumerate(panels.flat):
        if i >= len(shown):
            axes.set_visible(False)
            continue
        mean, sd, r_hat, ess = (
            float(summary[column].loc[names[i]]) for column in ("mean", "sd", "r_hat", "ess_bulk")
        )
        mean, sd = mean * 10.0 ** powers[i], sd * 10.0 ** powers[i]
        half = 1.96 * sd / np.sqrt(n_walker)
        axes.axhspan(mean - half, mean + half, color="#000000", alpha=0.08, linewidth=0)
        for k, ensemble in enumerate(theta[..., i]):
            axes.plot(steps, ensemble.mean(axis=1), linewidth=1.0, color=_ensemble_colour(k))
        label = _scaled(names[i], int(powers[i]))
        axes.set_title(f"{label}\nR-hat {r_hat:.4f}, ESS {ess:,.0f}", fontsize=9)
        axes.yaxis.set_major_locator(MaxNLocator(4))
        axes.xaxis.set_major_locator(MaxNLocator(5, integer=True))
        if i + n_column >= len(shown):
            axes.tick_params(labelbottom=True)
            axes.set_xlabel("kept step")
    note = "" if len(shown) == fit.model.n_parameter else f", {len(shown)} of {len(fit.summary)}"
    figure.suptitle(
        f"{title_of(fit.form.name)}: mean over the {n_walker} walkers of each of "
        f"{len(theta)} ensembles{note}",
        fontsize=10,
    )
    return figure


def _powers(draws: FloatArray) -> IntArray:
    """Return the power of ten by which to show each column: an axis has no room for small ones."""
    sizes = np.quantile(np.abs(draws), 0.5, axis=0)
    small = (sizes > 0) & (sizes < 1e-3)
    return np.where(small, -np.floor(np.log10(np.where(small, sizes, 1))), 0).astype(np.int64)


def _scaled(name: str, power: int) -> str:
    return f"$10^{{{power}}}$\N{NO-BREAK SPACE}{symbol(name)}" if power else symbol(name)


def _ensemble_colour(k: int) -> str:
    return ("#0072B2", "#D55E00", "#009E73", "#B2478F", "#C88A00", "#56B4E9")[k % 6]


def _shown(fit: Fit) -> tuple[list[str], list[int]]:
    """Return names and places of the parameters to show: the first ones, and the error model's."""
    n = fit.model.n_parameter
    shown = list(range(n))
    if n > MOST_PARAMETERS:
        n_noise = n - fit.model.n_coefficient
        shown = [*range(MOST_PARAMETERS - n_noise), *range(n - n_noise, n)]
    return [fit.model.parameter_names[i] for i in shown], shown
