# ruff: noqa: RUF001  (typographic minus, times and Greek are meant: readers see them)
"""Sections on the posteriors: coefficients, convergence, corner plots, traces, checks."""

import numpy as np

from ridgebayes.checks.power_scaling import THRESHOLD
from ridgebayes.checks.report_data import ReportData
from ridgebayes.report.blocks import Block, Picture, Table, Text
from ridgebayes.report.figures.gallery import MOST_PARAMETERS
from ridgebayes.report.wording import (
    ABSENT,
    decimals,
    form_name,
    interval,
    parameter_name,
    percent,
    with_error,
)

MOST_ROWS = 40  # of one table; the run folder's CSV files hold them all


def coefficients_section(data: ReportData) -> list[Block]:
    """Return every coefficient beside the printed one and beside least squares on Q."""
    fits = data.comparison.fits
    dropped = sum(max(len(fit.summary) - MOST_ROWS, 0) for fit in fits.values())
    prob = next(iter(fits.values())).summary["prob"].iloc[0]
    blocks: list[Block] = [
        Text(
            "The posterior weighs relative errors of the load. Least squares, the study's method, "
            "weighs errors of Q. The two differ where a form fails systematically. σ is the "
            "standard deviation of the log load about the form: its typical relative error."
        ),
        Table(
            [
                "Form",
                "Parameter",
                "Posterior mean ± sd",
                f"{percent(prob)} interval",
                "Printed",
                "Least squares on Q",
            ],
            [row for name in data.ranked for row in _coefficients(data, name)],
            text=(0, 1),
        ),
    ]
    if dropped:
        blocks.append(Text(f"{dropped:,} more parameters are in summary.csv.", "note"))
    return blocks


def _coefficients(data: ReportData, name: str) -> list[list[str]]:
    fit, squares = data.comparison.fits[name], data.least_squares.get(name)
    printed = dict(zip(fit.form.parameter_names, fit.form.printed or (), strict=False))
    summary, rows = fit.summary.to_dict("records"), []
    for row in [*summary[: MOST_ROWS - 1], *summary[MOST_ROWS - 1 :][-1:]]:
        parameter, own = row["parameter"], ABSENT
        if squares is not None and parameter in squares.coefficients:
            value, error = squares.coefficients[parameter], squares.standard_errors[parameter]
            own = with_error(value, error, 5)
        rows.append(
            [
                form_name(name),
                parameter_name(parameter),
                with_error(row["mean"], row["sd"], 6),
                interval(row["eti_lower"], row["eti_upper"], row["sd"]),
                f"{printed[parameter]:g}" if parameter in printed else ABSENT,
                own,
            ]
        )
    return rows


def convergence_section(data: ReportData) -> list[Block]:
    """Return the diagnostics of every fit, worst parameter of each."""
    fits, rows = data.comparison.fits, []
    for name in data.ranked:
        summary, chains = fits[name].summary, fits[name].chains
        known = np.all(np.isfinite(chains.tau))
        rows.append(
            [
                form_name(name),
                f"{chains.u.shape[0]} × {chains.u.shape[2]}",
                decimals(float(np.max(chains.tau)), 2) if known else ABSENT,
                f"{summary['ess_bulk'].min():,.0f}",
                f"{summary['ess_tail'].min():,.0f}",
                decimals(summary["r_hat"].max(), 5),
                f"{chains.acceptance.min():.2f} to {chains.acceptance.max():.2f}",
                "converged" if fits[name].converged else "did not converge",
            ]
        )
    header = ("Form", "Ensembles × walkers", "τ, steps", "Bulk ESS", "Tail ESS", "R-hat")
    blocks: list[Block] = [
        Table(
            [*header, "Acceptance", "Verdict"],
            rows,
            "The worst parameter of each form. τ: integrated autocorrelation time. ESS: effective "
            "sample size. R-hat: across independently started ensembles.",
            text=(0, 7),
            badge=7,
        ),
        Text(
            "Converged means: over 50 τ steps for every parameter and the log posterior, τ stable "
            "to 1 %, R-hat under 1.01, bulk and tail ESS of at least 400.",
            "note",
        ),
        *(
            Text(f"{form_name(name)}: {what}", "warning")
            for name, fit in fits.items()
            for what in fit.convergence_failures
        ),
    ]
    return blocks


def corner_section(data: ReportData) -> list[Block]:
    """Return the corner plot of every fit."""
    pictures: list[Block] = []
    for name in data.ranked:
        model = data.comparison.fits[name].model
        n = model.n_parameter
        some = f" {MOST_PARAMETERS} of {n} parameters." if n > MOST_PARAMETERS else ""
        printed = " Solid lines: printed coefficients." if model.form.printed is not None else ""
        caption = (
            f"{form_name(name)}. Dashed: 5, 50 and 95 % quantiles.{printed} Contours contain 39 "
            f"and 86 %.{some}"
        )
        pictures.append(Picture(f"corner-{name}", caption, narrow=n < 6))
    return pictures


def trace_section(data: ReportData) -> list[Block]:
    """Return the traces of every fit."""
    words = "one line an ensemble. Grey: 95 % range of means of as many independent draws."
    return [Picture(f"traces-{name}", f"{form_name(name)}: {words}") for name in data.ranked]


def checks_section(data: ReportData) -> list[Block]:
    """Return the predictive checks of the best form."""
    blocks: list[Block] = []
    if data.checks is not None:
        found = data.checks.table()
        odd = ", ".join(found[found["two_sided"] < 0.05]["quantity"])
        blocks += [
            Text(
                f"{form_name(data.shown)}: residuals of rows replicated from the fitted model, "
                "compared with those of the observed rows. A p near 0 or 1 marks a statistic that "
                f"the model does not reproduce. Here (two-sided p under 0.05): {odd or 'none'}."
            ),
            Picture(
                "posterior-checks",
                "Posterior predictive checks: each statistic of replicated and of observed rows, "
                "over the posterior's draws.",
            ),
        ]
    caption = (
        "Prior predictive check: loads from the priors alone, with the rows. The priors should "
        "reach well beyond the rows, but not by many powers of ten."
    )
    return [*blocks, Picture("prior-bands", caption)]


def power_scaling_section(data: ReportData) -> list[Block]:
    """Return how sensitive each parameter of the best form is to its prior and to the rows."""
    rows = [
        [
            parameter_name(row["parameter"]),
            decimals(row["prior"], 3),
            decimals(row["likelihood"], 3),
            row["diagnosis"] or "none",
        ]
        for row in data.power_scaling.to_dict("records")
    ]
    words = (
        f"{form_name(data.shown)}: change of each parameter's distribution when all priors, or the "
        "likelihood, are raised to a power near one, per doubling of that power. Values from "
        f"{THRESHOLD:g} on matter. Where only the prior matters, the rows say little about the "
        "parameter."
    )
    blocks: list[Block] = [
        Text(words),
        Table(["Parameter", "Prior", "Likelihood", "Diagnosis"], rows, text=(0, 3)),
    ]
    return blocks
