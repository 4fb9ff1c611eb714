"""Sections on whether the model holds: coverage of its bands, predictive checks, power-scaling."""

import numpy as np

from ridgebayes.checks.power_scaling import THRESHOLD, power_scaling
from ridgebayes.checks.predictive_checks import posterior_checks
from ridgebayes.comparison.comparison import Comparison
from ridgebayes.comparison.ranking import best_form
from ridgebayes.report.blocks import Picture, Section, Table, Text, table
from ridgebayes.report.names import form_name, parameter_name
from ridgebayes.report.numbers import decimals, number, percent
from ridgebayes.results import Fit


def coverage_section(comparison: Comparison) -> Section:
    """Return how often bands hold textures left out, where that was counted."""
    title, anchor = "Do the bands hold?", "coverage"
    counted = comparison.coverage
    if not len(counted):
        return Section(title, anchor, ())
    rows = [
        [
            row["noise"],
            percent(row["prob"]),
            f"{int(row['covered'])} of {int(row['n'])}",
            f"{decimals(100 * row['share'], 1)} ± {decimals(100 * row['share_se'], 1)} %",
            number(row["mean_width"], 2),
        ]
        for row in counted.to_dict("records")
    ]
    form = form_name(str(counted["form"].iloc[0]))
    n_texture = int(counted["n_texture"].max())
    beyond = decimals(100 * counted["share_extrapolated"].max(), 0)
    blocks: list[Text | Table | Picture] = [
        Text(
            f"{n_texture} textures left out in turn, {form} fitted to the others, and each "
            "transition of the one left out looked up in its simulation band. A band of 90 % "
            "should hold about nine in ten; one that holds fewer promises too much, one that "
            "holds all could be narrower. Beside the error model of this run: independent rows."
        ),
        Picture(comparison, "coverage", "Share of transitions inside, and width of the bands."),
        table(
            ["Error model", "Band", "Inside", "Share ± standard error", "Width in log load"],
            rows,
            "Whole textures are taken as independent. Of the transitions left out, "
            f"{beyond} % lie beyond what their fit had seen.",
            text=(0,),
        ),
    ]
    failed = counted[counted["failed"] != ""]
    if len(failed):
        blocks.append(Text(f"Not fitted: {failed['failed'].iloc[0]}", "warning"))
    return Section(title, anchor, tuple(blocks))


def checks_section(comparison: Comparison) -> Section:
    """Return the predictive checks of the best form."""
    fit = _fit(comparison)
    data = fit.model.data
    blocks: list[Text | Table | Picture] = []
    if data.is_exact.any():
        found = posterior_checks(fit, rng=fit.seed).table()
        odd = found[found["two_sided"] < 0.05]
        words = (
            f"{form_name(fit.form.name)}: rows replicated from the fitted model, their residuals "
            "compared with those of the observed rows. A p near 0 or 1 is a feature that the model "
            "does not make. "
        )
        words += (
            f"Here: {', '.join(odd['quantity'])}."
            if len(odd)
            else "No quantity is out of the ordinary here (two-sided p under 0.05)."
        )
        blocks += [
            Text(words),
            Picture(
                comparison,
                "posterior-checks",
                "Posterior predictive checks: each quantity of replicated rows, and of the "
                "observed ones over the posterior's draws.",
            ),
        ]
    if np.any(data.Q >= 4):
        blocks.append(
            Picture(
                comparison,
                "prior-bands",
                "Prior predictive check: loads that the priors alone expect, with the rows. They "
                "should surround the rows by a wide margin, and not by many powers of ten.",
            )
        )
    return Section("Predictive checks", "checks", tuple(blocks))


def power_scaling_section(comparison: Comparison) -> Section:
    """Return how far each parameter of the best form hangs on its prior and on the rows."""
    fit = _fit(comparison)
    rows = [
        [
            parameter_name(row["parameter"]),
            decimals(row["prior"], 3),
            decimals(row["likelihood"], 3),
            row["diagnosis"] or "none",
        ]
        for row in power_scaling(fit).to_dict("records")
    ]
    return Section(
        "What each parameter hangs on",
        "power-scaling",
        (
            Text(
                f"{form_name(fit.form.name)}: how far each parameter's distribution moves when all "
                "priors, or the likelihood, are raised to a power near one, per doubling of that "
                f"power. From {THRESHOLD:g} on it counts. Where the prior alone counts, the rows "
                "say little of that parameter."
            ),
            table(
                ["Parameter", "Prior", "Likelihood", "To look at"],
                rows,
                text=(0, 3),
            ),
        ),
    )


def _fit(comparison: Comparison) -> Fit:
    return comparison.fits[best_form(comparison) or next(iter(comparison.fits))]
