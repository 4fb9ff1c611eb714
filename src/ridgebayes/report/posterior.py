# ruff: noqa: RUF001  (typographic minus, times and Greek are meant: readers see them)
"""Sections on the posteriors: coefficients, convergence, corner plots, traces."""

import numpy as np

from ridgebayes.checks.least_squares import LeastSquares, fit_by_least_squares
from ridgebayes.comparison.comparison import Comparison
from ridgebayes.comparison.ranking import forms_by_probability
from ridgebayes.errors import InputError
from ridgebayes.report.blocks import Picture, Section, Table, Text, table
from ridgebayes.report.figures.posterior import MOST_PARAMETERS
from ridgebayes.report.names import form_name, parameter_name
from ridgebayes.report.numbers import ABSENT, decimals, interval, percent, with_error
from ridgebayes.results import Fit

MOST_ROWS = 40  # of one table; the run folder's CSV files hold them all


def coefficients_section(comparison: Comparison) -> Section:
    """Return every coefficient beside the printed one and beside least squares on Q."""
    rows: list[list[str]] = []
    dropped = 0
    for name in forms_by_probability(comparison):
        fit = comparison.fits[name]
        squares = _least_squares(comparison, fit)
        printed = dict(zip(fit.form.parameter_names, fit.form.printed or (), strict=False))
        summary = fit.summary.to_dict("records")
        dropped += max(len(summary) - MOST_ROWS, 0)
        for row in [*summary[: MOST_ROWS - 1], *summary[MOST_ROWS - 1 :][-1:]]:
            parameter = row["parameter"]
            own = (
                ""
                if squares is None or parameter not in squares.coefficients
                else with_error(
                    squares.coefficients[parameter], squares.standard_errors[parameter], 5
                )
            )
            rows.append(
                [
                    form_name(name),
                    parameter_name(parameter),
                    with_error(row["mean"], row["sd"], 6),
                    interval(row["eti_lower"], row["eti_upper"], row["sd"]),
                    f"{printed[parameter]:g}" if parameter in printed else ABSENT,
                    own or ABSENT,
                ]
            )
    prob = next(iter(comparison.fits.values())).summary["prob"].iloc[0]
    blocks: list[Text | Table | Picture] = [
        Text(
            "The posterior weighs relative errors of the load, least squares (as the study did) "
            "errors of Q: the two differ where a form fails in a pattern. σ is the standard "
            "deviation of the log load about the form: its typical relative error."
        ),
        table(
            [
                "Form",
                "Parameter",
                "Posterior mean ± sd",
                f"{percent(prob)} interval",
                "Printed",
                "Least squares on Q",
            ],
            rows,
            text=(0, 1),
        ),
    ]
    if dropped:
        blocks.append(Text(f"{dropped:,} more parameters are in summary.csv.", "note"))
    return Section("Coefficients", "coefficients", tuple(blocks))


def _least_squares(comparison: Comparison, fit: Fit) -> LeastSquares | None:
    try:
        return fit_by_least_squares(fit.form, comparison.table)
    except InputError:  # a form with a coefficient per texture, or too few rows
        return None


def convergence_section(comparison: Comparison) -> Section:
    """Return the diagnostics of every fit, worst parameter of each."""
    rows = []
    for name in forms_by_probability(comparison):
        fit = comparison.fits[name]
        summary, chains = fit.summary, fit.chains
        low, high = chains.acceptance.min(), chains.acceptance.max()
        rows.append(
            [
                form_name(name),
                f"{chains.u.shape[0]} × {chains.u.shape[2]}",
                decimals(float(np.max(chains.tau)), 2)
                if np.all(np.isfinite(chains.tau))
                else ABSENT,
                f"{summary['ess_bulk'].min():,.0f}",
                f"{summary['ess_tail'].min():,.0f}",
                decimals(summary["r_hat"].max(), 5),
                f"{low:.2f} to {high:.2f}",
                "converged" if fit.converged else "did not converge",
            ]
        )
    blocks: list[Text | Table | Picture] = [
        table(
            [
                "Form",
                "Ensembles × walkers",
                "τ, steps",
                "Bulk ESS",
                "Tail ESS",
                "R-hat",
                "Acceptance",
                "Verdict",
            ],
            rows,
            "The worst parameter of each form. τ: integrated autocorrelation time; ESS: effective "
            "sample size; R-hat across independently started ensembles.",
            text=(0, 7),
            badge=7,
        ),
        Text(
            "Converged means: over 50 τ steps for every parameter and the log posterior, τ settled "
            "to 1 %, R-hat under 1.01, bulk and tail ESS of at least 400.",
            "note",
        ),
    ]
    for name, fit in comparison.fits.items():
        blocks += [
            Text(f"{form_name(name)}: {what}", "warning") for what in fit.convergence_failures
        ]
    return Section("Convergence", "convergence", tuple(blocks))


def corner_section(comparison: Comparison) -> Section:
    """Return the corner plot of every fit."""
    pictures = []
    for name in forms_by_probability(comparison):
        n = comparison.fits[name].model.n_parameter
        some = f" {MOST_PARAMETERS} of {n} parameters." if n > MOST_PARAMETERS else ""
        has_printed = comparison.fits[name].form.printed is not None
        printed = "; solid lines: printed coefficients that lie inside" if has_printed else ""
        pictures.append(
            Picture(
                comparison,
                f"corner-{name}",
                f"{form_name(name)}. Dashed: 5, 50 and 95 %{printed}. Contours hold 39 and 86 %."
                f"{some}",
                narrow=n < 6,
            )
        )
    return Section("Posteriors", "posteriors", tuple(pictures))


def trace_section(comparison: Comparison) -> Section:
    """Return the traces of every fit."""
    pictures = tuple(
        Picture(
            comparison,
            f"traces-{name}",
            f"{form_name(name)}: a line an ensemble. Grey: where means of independent draws fall "
            "19 times in 20.",
        )
        for name in forms_by_probability(comparison)
    )
    return Section("Traces", "traces", pictures)
