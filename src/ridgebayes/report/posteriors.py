"""Sections on the posteriors: coefficients, convergence, corner plots, checks."""

import numpy as np

from ridgebayes.checks.power_scaling import THRESHOLD
from ridgebayes.checks.repeat import OUTER
from ridgebayes.checks.report_data import ReportData
from ridgebayes.inference.pareto_smoothing import MAX_PARETO_K
from ridgebayes.report.blocks import Block, Folded, Picture, Table, Text
from ridgebayes.report.figures.gallery import MOST_PARAMETERS
from ridgebayes.report.wording import (
    ABSENT,
    decimals,
    form_name,
    interval,
    number,
    parameter_name,
    percent,
    say,
    with_error,
)

TINY = 1e-4  # of sigma: a hundredth of a per cent of the load
MOST_ROWS = 40  # of one table; the run folder's CSV files hold them all


def coefficients_section(data: ReportData) -> list[Block]:
    """Return every coefficient beside least squares on Q, of the study's sweep the published."""
    fits = data.comparison.fits
    dropped = sum(max(len(fit.summary) - MOST_ROWS, 0) for fit in fits.values())
    others = [name for name in data.ranked if name != data.shown]
    blocks: list[Block] = [
        Text(say("coefficients", tiny=_tiny_sigma(data))),
        _coefficients_table(data, [data.shown]),
    ]
    if others:
        blocks.append(
            Folded("Coefficients of the other forms", [_coefficients_table(data, others)])
        )
    if dropped:
        blocks.append(Text(f"{dropped:,} more parameters are in summary.csv.", "note"))
    return blocks


def _tiny_sigma(data: ReportData) -> str:
    """Say what it means where a form leaves next to no error."""
    summary = data.fit.summary.set_index("parameter")["mean"]
    sigma = float(summary.get("sigma", np.nan))
    if not sigma < TINY:
        return ""
    return say("tiny_sigma", percent=f"{100 * TINY:g}", shown=form_name(data.shown))


def _coefficients_table(data: ReportData, names: list[str]) -> Table:
    prob = data.fit.summary["prob"].iloc[0]
    header = ["Form", "Parameter", "Posterior mean ± sd", f"{percent(prob)} interval"]
    header += ["Least squares on Q", "Published 2019"]
    rows = [row for name in names for row in _coefficients(data, name)]
    if not data.is_paper_sweep:  # the published ones are those of another table
        header, rows = header[:-1], [row[:-1] for row in rows]
    return Table(header, rows, text=(0, 1))


def _coefficients(data: ReportData, name: str) -> list[list[str]]:
    fit, squares = data.comparison.fits[name], data.least_squares.get(name)
    published = dict(zip(fit.form.parameter_names, fit.form.published or (), strict=False))
    summary, rows = fit.summary.to_dict("records"), []
    for row in [*summary[: MOST_ROWS - 1], *summary[MOST_ROWS - 1 :][-1:]]:
        parameter, own = row["parameter"], ABSENT
        tiny = parameter == "sigma" and row["mean"] < TINY
        if squares is not None and parameter in squares.coefficients:
            value, error = squares.coefficients[parameter], squares.standard_errors[parameter]
            own = with_error(value, error, 5)
        rows.append(
            [
                form_name(name),
                parameter_name(parameter),
                f"< {TINY:g}" if tiny else with_error(row["mean"], row["sd"], 6),
                ABSENT if tiny else interval(row["eti_lower"], row["eti_upper"], row["sd"]),
                own,
                f"{published[parameter]:g}" if parameter in published else ABSENT,
            ]
        )
    return rows


def convergence_section(data: ReportData) -> list[Block]:
    """Return the diagnostics of every fit, worst parameter of each."""
    fits, rows = data.comparison.fits, []
    for name in data.ranked:
        summary, chains = fits[name].summary, fits[name].chains
        rows.append(
            [
                form_name(name),
                fits[name].sampler,
                f"{summary['ess_bulk'].min():,.0f}",
                f"{summary['ess_tail'].min():,.0f}",
                decimals(summary["r_hat"].max(), 4),
                f"{chains.acceptance.min():.2f}",
                "converged" if fits[name].converged else "did not converge",
            ]
        )
    return [
        Table(
            ["Form", "Drawn by", "Bulk ESS", "Tail ESS", "R-hat", "Share", "State"],
            rows,
            say("convergence_caption"),
            text=(0, 1, 6),
            badge=6,
        ),
        Text(
            say("converged", k=f"{MAX_PARETO_K:g}"),
            "note",
        ),
        *(_not_converged(data, name) for name, fit in fits.items() if not fit.converged),
    ]


def _not_converged(data: ReportData, name: str) -> Text:
    """Say what a fit lacks, and whether that matters."""
    first, *others = data.comparison.fits[name].convergence_failures
    more = f"; and {len(others)} more of the kind" if others else ""
    if name in data.comparison.unconverged:
        return Text(f"{form_name(name)}: {first}{more}.", "warning")
    words = "Its probability is negligible, so that nothing rests on it."
    return Text(f"{form_name(name)}: {first}{more}. {words}", "note")


def repeat_section(data: ReportData) -> list[Block]:
    """Return whether the posterior stays the same with twice the draws."""
    found = data.repeat
    if found is None:
        return []
    words = say(
        "repeat",
        again=found,
        shown=form_name(data.shown),
        parameter="" if found.failed else parameter_name(found.parameter),
    )
    return [Text(words, "warning" if found.failed else "plain")]


def sense_section(data: ReportData) -> list[Block]:
    """Return whether the posterior makes sense against what was known before."""
    frame = data.against_priors
    outer = frame[(frame["prior_below"] < OUTER) | (frame["prior_below"] > 1 - OUTER)]
    odd = ", ".join(parameter_name(name) for name in outer["parameter"])
    words = say("outer_means", parameters=odd, outer=percent(OUTER))
    rows = [
        [
            parameter_name(row["parameter"]),
            number(row["prior_median"], 3),
            f"< {TINY:g}" if 0 < row["mean"] < TINY else number(row["mean"], 4),
            _share(row["prior_below"]),
        ]
        for row in frame.head(MOST_ROWS).to_dict("records")
    ]
    header = ["Parameter", "Prior median", "Posterior mean", "Prior below the mean"]
    return [Text(words), Folded("Posterior means in their priors", [Table(header, rows)])]


def _share(share: float) -> str:
    """Return a share in whole per cent; never 0 or 100 by rounding."""
    return "< 1 %" if share < 0.01 else "> 99 %" if share > 0.99 else percent(round(share, 2))


def corner_section(data: ReportData) -> list[Block]:
    """Return the corner plot of every fit."""
    pictures: list[Block] = []
    for name in data.ranked:
        model = data.comparison.fits[name].model
        n = model.n_parameter
        some = f" {MOST_PARAMETERS} of {n} parameters." if n > MOST_PARAMETERS else ""
        is_published = data.is_paper_sweep and model.form.published is not None
        lines = " Solid lines: published coefficients." if is_published else ""
        caption = say("corner_caption", form=form_name(name), lines=lines, some=some)
        pictures.append(Picture(f"corner-{name}", caption, narrow=n < 6))
    return pictures


def checks_section(data: ReportData) -> list[Block]:
    """Return the posterior predictive checks of the best form."""
    blocks: list[Block] = []
    if data.checks is not None:
        found = data.checks.table()
        odd = ", ".join(found[found["two_sided"] < 0.05]["quantity"])
        blocks += [
            Text(say("predictive_checks", shown=form_name(data.shown), odd=odd or "none")),
            Picture(
                "posterior-checks",
                say("predictive_checks_caption"),
                f"Statistics that {form_name(data.shown)} does not reproduce: {odd or 'none'}.",
            ),
        ]
    return blocks


def prior_check(data: ReportData) -> list[Block]:
    """Return what the priors say of the loads before the rows are known."""
    caption = say("prior_check_caption")
    return [Picture("prior-bands", caption)]


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
    words = say("power_scaling", shown=form_name(data.shown), threshold=f"{THRESHOLD:g}")
    return [
        Text(words),
        Table(["Parameter", "Prior", "Likelihood", "Diagnosis"], rows, text=(0, 3)),
    ]
