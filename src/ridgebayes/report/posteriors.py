"""Sections on the posteriors: coefficients, convergence, corner plots and checks."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ridgebayes.checks.power_scaling import THRESHOLD
from ridgebayes.checks.repeat import OUTER
from ridgebayes.checks.report_data import ReportData
from ridgebayes.inference.pareto_smoothing import MAX_PARETO_K
from ridgebayes.report.blocks import MOST_ROWS, Block, Folded, Picture, Table, Text
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

TINY = 1e-4  # values of sigma shown as "<": an error of 0.01 per cent of the load


def coefficients_section(data: ReportData) -> list[Block]:
    """Return every coefficient, with least squares on Q, and published values if they apply."""
    n_more = sum(max(len(fit.summary) - MOST_ROWS, 0) for fit in data.comparison.fits.values())
    others = [name for name in data.ranked if name != data.shown]
    table, note = coefficients_table, f"{n_more:,} more parameters are in summary.csv."
    return [
        Text(say("coefficients", tiny=_tiny_sigma(data))),
        table(data, [data.shown]),
        *([Folded("Coefficients of the other forms", [table(data, others)])] if others else []),
        *([Text(note, "note")] if n_more else []),
    ]


def _tiny_sigma(data: ReportData) -> str:
    """Return a sentence on a sigma close to zero, if the form has one."""
    summary = data.fit.summary.set_index("parameter")["mean"]
    if not float(summary.get("sigma", np.nan)) < TINY:
        return ""
    return say("tiny_sigma", percent=f"{100 * TINY:g}", shown=form_name(data.shown))


def coefficients_table(data: ReportData, names: Sequence[str]) -> Table:
    """Return the coefficients of some forms; a long list keeps its first rows and the last."""
    fits, prob = data.comparison.fits, data.fit.summary["prob"].iloc[0]
    rows = []
    for name in names:
        summary = fits[name].summary.assign(form=name).to_dict("records")
        rows += [*summary[: MOST_ROWS - 1], *summary[MOST_ROWS - 1 :][-1:]]

    def is_tiny(row: dict[str, Any]) -> bool:
        return bool(row["parameter"] == "sigma" and row["mean"] < TINY)

    def mean(row: dict[str, Any]) -> str:
        return f"< {TINY:g}" if is_tiny(row) else with_error(row["mean"], row["sd"], 6)

    def ends(row: dict[str, Any]) -> str:
        return ABSENT if is_tiny(row) else interval(row["eti_lower"], row["eti_upper"], row["sd"])

    def squares(row: dict[str, Any]) -> str:
        fit, parameter = data.least_squares.get(row["form"]), row["parameter"]
        if fit is None or parameter not in fit.index:
            return ABSENT
        value, error = fit.loc[parameter]
        return with_error(value, error, 5)

    def published(row: dict[str, Any]) -> str:
        form = fits[row["form"]].form
        values = dict(zip(form.parameter_names, form.published or (), strict=False))
        return f"{values[row['parameter']]:g}" if row["parameter"] in values else ABSENT

    columns: dict[str, Callable[[dict[str, Any]], str]] = {
        "Form": lambda row: form_name(row["form"]),
        "Parameter": lambda row: parameter_name(row["parameter"]),
        "Posterior mean ± sd": mean,
        f"{percent(prob)} interval": ends,
        "Least squares on Q": squares,
    }
    if data.is_paper_sweep:  # published coefficients belong to this table only
        columns["Published 2019"] = published
    return Table.of(rows, columns, text=(0, 1))


def convergence_section(data: ReportData) -> list[Block]:
    """Return the diagnostics of the worst parameter of every fit."""
    fits = data.comparison.fits
    table = Table.of(
        [fits[name] for name in data.ranked],
        {
            "Form": lambda fit: form_name(fit.form.name),
            "Drawn by": lambda fit: fit.sampler,
            "Bulk ESS": lambda fit: f"{fit.summary['ess_bulk'].min():,.0f}",
            "Tail ESS": lambda fit: f"{fit.summary['ess_tail'].min():,.0f}",
            "R-hat": lambda fit: decimals(fit.summary["r_hat"].max(), 4),
            "Share": lambda fit: f"{fit.chains.acceptance.min():.2f}",
            "State": lambda fit: "converged" if fit.converged else "did not converge",
        },
        say("convergence_caption"),
        text=(0, 1, 6),
        badge=6,
    )
    failures = [_not_converged(data, name) for name, fit in fits.items() if not fit.converged]
    return [table, Text(say("converged", k=f"{MAX_PARETO_K:g}"), "note"), *failures]


def _not_converged(data: ReportData, name: str) -> Text:
    """Say which criteria a fit fails, and whether this matters."""
    matters = name in data.comparison.unconverged
    failures = data.comparison.fits[name].convergence_failures
    words = say("not_converged", form=name, failures=failures, matters=matters)
    return Text(words, "warning" if matters else "note")


def repeat_section(data: ReportData) -> list[Block]:
    """Return whether the posterior stays the same with twice the draws."""
    again = data.repeat
    if again is None:
        return []
    parameter = "" if again.failed else parameter_name(again.parameter)
    words = say("repeat", again=again, shown=form_name(data.shown), parameter=parameter)
    return [Text(words, "warning" if again.failed else "plain")]


def sense_section(data: ReportData) -> list[Block]:
    """Return whether the posterior is plausible under the prior."""
    frame = data.against_priors
    outer = frame[(frame["prior_below"] < OUTER) | (frame["prior_below"] > 1 - OUTER)]
    odd = ", ".join(parameter_name(name) for name in outer["parameter"])
    table = Table.of(
        frame.head(MOST_ROWS),
        {
            "Parameter": lambda row: parameter_name(row["parameter"]),
            "Prior median": lambda row: number(row["prior_median"], 3),
            "Posterior mean": lambda row: (
                f"< {TINY:g}" if 0 < row["mean"] < TINY else number(row["mean"], 4)
            ),
            "Prior below the mean": lambda row: _share(row["prior_below"]),
        },
    )
    words = say("outer_means", parameters=odd, outer=percent(OUTER))
    return [Text(words), Folded("Posterior means in their priors", [table])]


def _share(share: float) -> str:
    """Return a share in whole per cent; rounding never gives 0 or 100."""
    return "< 1 %" if share < 0.01 else "> 99 %" if share > 0.99 else percent(round(share, 2))


def corner_section(data: ReportData) -> list[Block]:
    """Return the corner plot of every fit."""
    pictures: list[Block] = []
    for name in data.ranked:
        fit = data.comparison.fits[name]
        is_published = data.is_paper_sweep and fit.form.published is not None
        counts = {"n": fit.model.n_parameter, "most": MOST_PARAMETERS}
        caption = say("corner_caption", form=form_name(name), is_published=is_published, **counts)
        narrow = fit.model.n_parameter < MOST_PARAMETERS
        pictures.append(Picture(f"corner-{name}", caption, narrow=narrow))
    return pictures


def checks_section(data: ReportData) -> list[Block]:
    """Return the posterior predictive checks of the best form."""
    if data.checks is None:
        return []
    checks = data.checks.table()
    odd = ", ".join(checks[checks["two_sided"] < 0.05]["quantity"]) or "none"
    caption = say("predictive_checks_caption")
    alt = f"Statistics that {form_name(data.shown)} does not reproduce: {odd}."
    words = say("predictive_checks", shown=form_name(data.shown), odd=odd)
    return [Text(words), Picture("posterior-checks", caption, alt)]


def prior_check(data: ReportData) -> list[Block]:
    """Return the prior predictive bands of the loads."""
    return [Picture("prior-bands", say("prior_check_caption"))]


def power_section(data: ReportData) -> list[Block]:
    """Return how sensitive each parameter of the best form is to its prior and to the rows."""
    table = Table.of(
        data.power_scaling,
        {
            "Parameter": lambda row: parameter_name(row["parameter"]),
            "Prior": lambda row: decimals(row["prior"], 3),
            "Likelihood": lambda row: decimals(row["likelihood"], 3),
            "Diagnosis": lambda row: row["diagnosis"] or "none",
        },
        text=(0, 3),
    )
    words = say("power_scaling", shown=form_name(data.shown), threshold=f"{THRESHOLD:g}")
    return [Text(words), table]
