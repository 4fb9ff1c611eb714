"""Printed results of `run`, `compare` and `fit`: the verdict and a summary of each form."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import pandas as pd

from ridgebayes.commands.run_files import summary_table, verdicts
from ridgebayes.commands.terminal import MOST_SHOWN, Answer, files_in
from ridgebayes.comparison.comparison import Comparison
from ridgebayes.comparison.ranking import forms_by_probability
from ridgebayes.report.first_screen import EQUAL, headline, lead, prior_words, why
from ridgebayes.results import Fit
from ridgebayes.runtime.text import count, short_label


def comparison_answer(done: Comparison, out: Path, then: str = "") -> Answer:
    """Return the verdict, the forms in order of probability, and their coefficients."""
    verdict, shares, parts = done.verdict, done.probabilities, [_rows_text(done, out, then)]
    if verdict is not None:
        reason = f" Why: {why(verdict)}." if verdict.grade == "undecided" else ""
        sentence = headline(verdict, done.probabilities_at_equal_odds)
        parts.append(f"{sentence} {lead(verdict)} Grade: {verdict.grade}.{reason}")
        if (prior := prior_words(done)) != EQUAL:
            parts.append(f"Probabilities are {prior}.")
    ranked = [done.fits[name] for name in forms_by_probability(done)]
    forms = [
        {
            "form": fit.form.name,
            "probability": _share_text(shares.get(fit.form.name)),
            "error models": _heaviest(fit.error_model_weights),
            "sampler": fit.sampler,
        }
        for fit in ranked
    ]
    summary = verdicts(done)
    return Answer(
        (*parts, pd.DataFrame(forms), *_coefficients(ranked)),
        {"verdict": summary["verdict"], "fits": summary["fits"]},
        files_in(out),
        details=(done.bayes_factors,),
        problem=_problem(done),
    )


def fit_answer(done: Comparison, out: Path) -> Answer:
    """Return the parameters of one fit, including those of the error model."""
    (fit,) = done.fits.values()
    state = "converged" if fit.converged else "NOT converged"
    state_text = f"{fit.form.name}, error model {fit.noise.name}, drawn by {fit.sampler}: {state}"
    return Answer(
        (_rows_text(done, out), state_text, _rounded(fit.summary)),
        summary_table([fit]),
        files_in(out),
        details=(fit.summary,),
        problem=_problem(done),
    )


def _rows_text(done: Comparison, out: Path, then: str = "") -> str:
    """Return a text about fitted, held-out and ignored rows, and the cautions."""
    table = done.table
    fitted = count(len(table.calibration), "row")
    held_out = f", {n} held out" if (n := len(table.held_out)) else ""
    lines = [f"{out}: {fitted} fitted{held_out}. {then}".strip(), *done.cautions]
    if n_left_out := len(table.left_out):
        rows = count(n_left_out, "row is", "rows are")
        lines.insert(0, f"{table.where}: {rows} not ok and not fitted")
    return "\n".join(lines)


def _coefficients(fits: Sequence[Fit]) -> list[str | pd.DataFrame]:
    """Return a table of coefficients; name the file of forms with too many coefficients."""
    tables: list[pd.DataFrame] = []
    more: list[str | pd.DataFrame] = []
    for fit in fits:
        coefficients = fit.summary[fit.summary["parameter"].isin(fit.form.parameter_names)]
        if len(coefficients) > MOST_SHOWN:
            more.append(f"{fit.form.name}: {len(coefficients)} coefficients, see summary.csv")
        else:
            tables.append(_rounded(coefficients))
            tables[-1].insert(0, "form", fit.form.name)
    if not tables:
        return more
    return [f"Coefficients under error model {fits[0].noise.name}:", pd.concat(tables), *more]


def _rounded(summary: pd.DataFrame) -> pd.DataFrame:
    """Round parameters to two digits of their standard deviation."""
    rows = []
    for row in summary.to_dict("records"):
        places = 3
        if 0 < row["sd"] < math.inf:
            places = max(1 - math.floor(math.log10(row["sd"])), 0)
        cells = {name: f"{row[name]:z.{places}f}" for name in ("mean", "sd")}
        ends = " to ".join(f"{row[name]:z.{places}f}" for name in ("eti_lower", "eti_upper"))
        parameter = {"parameter": short_label(str(row["parameter"]))}
        rows.append(parameter | cells | {f"{100 * row['prob']:g} % interval": ends})
    return pd.DataFrame(rows)


def _heaviest(weights: Mapping[str, float]) -> str:
    """Return the error models with the largest weights; run.json has all of them."""
    ranked = sorted(weights.items(), key=lambda item: -item[1])
    shown = [f"{noise} {weight:.2g}" for noise, weight in ranked[:MOST_SHOWN]]
    more = [f"{len(ranked) - len(shown)} more"] if len(ranked) > len(shown) else []
    return ", ".join([*shown, *more])


def _share_text(share: float | None) -> str:
    if share is None:
        return "no evidence"
    if 0.9999 < share < 1:
        return "> 0.9999"
    return f"{share:.3f}" if share >= 0.01 else f"{share:.2g}"


def _problem(done: Comparison) -> str:
    """Return a text about forms that failed or did not converge; empty if there are none."""
    by_form = done.unconverged.items()
    unconverged = [f"{name} did not converge: {'; '.join(failures)}" for name, failures in by_form]
    return "\n".join(
        [*unconverged, *(f"{name} failed: {why}" for name, why in done.failures.items())]
    )
