"""The answer in a sentence, and what stands against trusting it."""

from dataclasses import dataclass

from ridgebayes.checks.report_data import ReportData
from ridgebayes.comparison.verdict import Verdict
from ridgebayes.report.wording import (
    decimals,
    form_name,
    noise_name,
    number,
    percent,
    probability,
)
from ridgebayes.runtime.text import count

CAUTIONS = {
    "rows are not independent": (
        "Rows are not independent: the errors of a form repeat within a texture and from step to "
        "step. Ignoring correlation makes posteriors too narrow and overstates Bayes factors."
    )
}


@dataclass(frozen=True)
class FirstScreen:
    """What the first screen says.

    Parameters
    ----------
    headline, sentence : str
        The answer, and the numbers behind it.
    cautions, notes : tuple of str
        What to bear in mind, and what else the first screen tells.
    problems : tuple of str
        Fits that failed or did not converge; a report with any is marked in red.
    """

    headline: str
    sentence: str
    cautions: tuple[str, ...]
    notes: tuple[str, ...]
    problems: tuple[str, ...]


def first_screen(data: ReportData, reference: ReportData | None = None) -> FirstScreen:
    """Return the first screen of a report, with a word on a second comparison if there is any."""
    caution, problems = data.comparison.noise.caution, data.problems
    notes = [_held_out(data)]
    if reference is not None:
        n_row = len(reference.comparison.table.calibration)
        notes.append(
            f"This is the answer for {data.comparison.table.where}. A second comparison asks which "
            f"form describes {count(n_row, 'finite-element row')}, the half-plane's equation among "
            f"them: {_headline(reference)}"
            + (f" {lead(reference.verdict)}" if reference.verdict else "")
        )
        problems += tuple(f"finite-element rows: {what}" for what in reference.problems)
    notes.append(_error_model(data))
    cautions = [CAUTIONS.get(caution, caution)] if caution else []
    if n_repeated := len(data.comparison.table.repeated):
        cautions.append(
            f"{count(n_repeated, 'row')} with the load of another source, solver or series to all "
            "digits. Copies count twice: leave one of each out."
        )
    return FirstScreen(
        _headline(data),
        _sentence(data),
        tuple(cautions),
        tuple(words for words in notes if words),
        problems,
    )


def _headline(data: ReportData) -> str:
    verdict = data.verdict
    if data.best is None:
        return "No form got a usable evidence."
    if verdict is None:
        return f"Only {form_name(data.best)} was fitted, so there is no comparison."
    return headline(verdict)


def headline(verdict: Verdict) -> str:
    """Return a verdict as one sentence.

    Parameters
    ----------
    verdict : Verdict
        What a comparison found.
    """
    best, over = form_name(verdict.form), form_name(verdict.over)
    return {
        "decisive": f"The evidence for {best} is decisive among the forms compared.",
        "supports": f"The evidence supports {best} among the forms compared.",
        "leans": f"The evidence leans towards {best}, not firmly.",
        "undecided": f"The evidence does not decide between {best} and {over}.",
    }[verdict.grade]


def _sentence(data: ReportData) -> str:
    comparison, verdict = data.comparison, data.verdict
    rows = comparison.table.calibration
    basis = f"{count(len(rows), 'row')} of {count(len(rows.textures), 'texture')}"
    if data.best is None:
        return f"{count(len(comparison.fits), 'form')} fitted to {basis}."
    if verdict is None:
        return f"Fitted to {basis}."
    words = (
        f"Of the {len(comparison.probabilities)} forms compared on {basis}, "
        f"{form_name(verdict.form)} has probability "
        f"{probability(comparison.probabilities[verdict.form])} at equal prior odds. "
        f"{lead(verdict)}"
    )
    if verdict.grade == "undecided":
        return f"{words} Why: {verdict.why}."
    return (
        f"{words} Its posterior probability passes 0.95 if its prior probability is above "
        f"{number(verdict.min_prior_probability, 2)}."
    )


def lead(verdict: Verdict) -> str:
    """Return the Bayes factor and its range as one sentence, no finer than the range supports."""
    low, high = verdict.ln_bf_range
    digits = 1 if high - low < 10 else 0
    return (
        f"Its ln Bayes factor over {form_name(verdict.over)}, the next, is "
        f"{decimals(verdict.ln_bf, digits)}; over priors and error models it lies between "
        f"{decimals(low, digits)} and {decimals(high, digits)}."
    )


def _held_out(data: ReportData) -> str:
    """Say how many held-out loads lie inside the best form's bands."""
    if data.best is None or not len(data.held_out):
        return ""
    own = data.held_out[data.held_out["form"] == data.best]
    far = " (an extrapolation)" if own["extrapolation"].all() else ""
    return (
        f"Of the held-out loads{far}, {int(own['inside'].sum())} of {len(own)} lie inside the "
        f"{percent(own['prob'].iloc[0])} bands of {form_name(data.best)}."
    )


def _error_model(data: ReportData) -> str:
    """Say which error models carry weight, and what Bayes factors mean under a smooth one."""
    weights = {} if data.verdict is None else data.verdict.error_model_weights
    if len(data.error_models) < 2 or not weights:
        return ""
    listed = ", ".join(f"{name} {probability(weight)}" for name, weight in weights.items())
    words = (
        f"Predictions are averaged over the error models by their probability: {listed}. "
        f"Parameters are printed under {noise_name(data.comparison.noise.name)}."
    )
    smooth = sum(weight for name, weight in weights.items() if "smooth" in name)
    if smooth < 0.5:
        return words
    words += (
        " Under a smooth offset a Bayes factor tells which form leaves the smaller and smoother "
        "remainder, given the priors of that offset."
    )
    if data.predicting is None:
        return words
    form, offset = data.predicting.without_form, data.predicting.without_offset
    more, less = ("form", "offset") if form > offset else ("offset", "form")
    return (
        f"{words} On textures left out, the error of predicted loads is {number(form, 2)} times as "
        f"large with Classic in the place of {form_name(data.shown)}, and bands are "
        f"{number(offset, 2)} times as wide without the offset: the {more} does more of the "
        f"predicting than the {less}."
    )
