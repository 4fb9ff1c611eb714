"""The answer in a sentence, and what stands against trusting it."""

from dataclasses import dataclass

from ridgebayes.checks.report_data import ReportData
from ridgebayes.report.wording import (
    count,
    decimals,
    form_name,
    noise_name,
    percent,
    probability,
    reading_text,
    with_error,
)

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
    notes = [_robustness(data), _held_out(data)]
    if reference is not None:
        n_row = len(reference.comparison.table.calibration)
        notes.append(
            f"On {count(n_row, 'finite-element row')}, with every form: {_headline(reference)} "
            f"{_lead(reference)}"
        )
        problems += tuple(f"finite-element rows: {what}" for what in reference.problems)
    notes.append(_error_model(data))
    return FirstScreen(
        _headline(data),
        _sentence(data),
        (CAUTIONS.get(caution, caution),) if caution else (),
        tuple(words for words in notes if words),
        problems,
    )


def _headline(data: ReportData) -> str:
    if data.best is None:
        return "No form got a usable evidence."
    best, second = form_name(data.best), data.second
    if second is None:
        return f"Only {best} was fitted, so there is no comparison."
    if second.reading.startswith("undecided"):
        return f"The evidence does not decide between {best} and {form_name(second.form)}."
    return f"{best} is the form the evidence supports."


def _sentence(data: ReportData) -> str:
    comparison, second = data.comparison, data.second
    rows = comparison.table.calibration
    basis = f"{count(len(rows), 'row')} of {count(len(rows.textures), 'texture')}"
    if data.best is None:
        return f"{count(len(comparison.fits), 'form')} fitted to {basis}."
    if second is None:
        return f"Fitted to {basis}."
    return (
        f"Of the {len(comparison.probabilities)} forms compared on {basis}, "
        f"{form_name(data.best)} has probability "
        f"{probability(comparison.probabilities[data.best])} at equal prior odds. Its ln Bayes "
        f"factor over {form_name(second.form)}, the second, is "
        f"{with_error(second.ln_bf, second.ln_bf_se)}: {reading_text(second.reading)}."
    )


def _lead(data: ReportData) -> str:
    second = data.second
    if second is None:
        return ""
    size = with_error(second.ln_bf, second.ln_bf_se)
    return f"ln Bayes factor over {form_name(second.form)} {size}."


def _robustness(data: ReportData) -> str:
    """Say how the Bayes factor against the next form moves with the prior scales."""
    factors, second = data.sensitivity, data.second
    if second is None or not len(factors):
        return ""
    ours = -factors[factors["form"] == second.form]["ln_bf"].dropna()
    if not len(ours):
        return ""
    low, high, other = float(ours.min()), float(ours.max()), form_name(second.form)
    tail = f"{form_name(data.shown)} stays ahead"
    return (
        f"With each prior scale varied by a factor of 100, the ln Bayes factor over {other} lies "
        f"between {decimals(low, 1)} and {decimals(high, 1)}: "
        f"{tail if low > 0 else f'{other} is ahead for some scales'}."
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
    """Say which error model the evidence chose."""
    means = data.error_models
    if len(means) < 2:
        return ""
    best, second = means.iloc[0], means.iloc[1]
    return (
        f"The error model is {noise_name(data.comparison.noise.name)}. Of {len(means)} it has the "
        f"highest mean evidence over the forms: ln {decimals(best['log_mean_evidence'], 1)}, "
        f"against {decimals(second['log_mean_evidence'], 1)} of the next, "
        f"{noise_name(second['noise'])}."
    )
