"""The answer in a sentence, and what stands against trusting it."""

from dataclasses import dataclass

from ridgebayes.checks.held_out import held_out_loads
from ridgebayes.comparison.comparison import Comparison
from ridgebayes.comparison.ranking import best_form, problems, runner_up, sensitivity_factors
from ridgebayes.evidence.error_models import mean_evidence
from ridgebayes.report.names import form_name, noise_name, said
from ridgebayes.report.numbers import count, decimals, percent, probability, with_error

CAUTIONS = {
    "rows are not independent": (
        "Rows are not independent: the errors of a form repeat within a texture and from step to "
        "step, so with independent noise posteriors come out too narrow and Bayes factors too loud."
    )
}


@dataclass(frozen=True)
class Verdict:
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


def verdict(comparison: Comparison, reference: Comparison | None = None) -> Verdict:
    """Return the verdict of a comparison, with a word on a second one if there is any."""
    caution = comparison.noise.caution
    notes = [*_robustness(comparison), *_held_out(comparison)]
    found = problems(comparison)
    if reference is not None:
        answer = verdict(reference)
        notes.append(
            f"On {count(len(reference.table.calibration), 'finite-element row')}, with every form: "
            f"{answer.headline} {_lead(reference)}"
        )
        found += tuple(f"finite-element rows: {what}" for what in answer.problems)
    cautions = (CAUTIONS.get(caution, caution),) if caution else ()
    notes += _error_model(comparison)
    return Verdict(_headline(comparison), _sentence(comparison), cautions, tuple(notes), found)


def _error_model(comparison: Comparison) -> list[str]:
    """Say which error model the evidence chose, and what the forms are worth without it."""
    means = mean_evidence(comparison.evidence)
    if len(means) < 2:
        return []
    best, second = means.iloc[0], means.iloc[1]
    return [
        f"The error model is {noise_name(comparison.noise.name)}: of {len(means)} it has the "
        f"highest mean evidence over the forms, ln {decimals(best['log_mean_evidence'], 1)} "
        f"against {decimals(second['log_mean_evidence'], 1)} of {noise_name(second['noise'])}, the "
        "next."
    ]


def _lead(comparison: Comparison) -> str:
    second = runner_up(comparison)
    if second is None:
        return ""
    size = with_error(second.ln_bf, second.ln_bf_se)
    return f"ln Bayes factor over {form_name(second.form)} {size}."


def _held_out(comparison: Comparison) -> list[str]:
    """Say how many held-out loads lie inside the best form's bands."""
    best, loads = best_form(comparison), held_out_loads(comparison)
    if best is None or not len(loads):
        return []
    own = loads[loads["form"] == best]
    far = " (an extrapolation)" if own["extrapolation"].all() else ""
    return [
        f"Of the held-out loads{far}, {int(own['inside'].sum())} of {len(own)} lie inside the "
        f"{percent(own['prob'].iloc[0])} bands of {form_name(best)}."
    ]


def _headline(comparison: Comparison) -> str:
    best, second = best_form(comparison), runner_up(comparison)
    if best is None:
        return "No form got a usable evidence."
    if second is None:
        return f"{form_name(best)} alone was weighed: there is nothing to compare it with."
    if second.reading.startswith("undecided"):
        return (
            f"The evidence does not decide between {form_name(best)} and {form_name(second.form)}."
        )
    return f"{form_name(best)} is the form the evidence supports."


def _sentence(comparison: Comparison) -> str:
    best, second = best_form(comparison), runner_up(comparison)
    rows = comparison.table.calibration
    basis = f"{count(len(rows), 'row')} of {count(len(rows.textures), 'texture')}"
    if best is None:
        return f"{count(len(comparison.fits), 'form')} fitted to {basis}."
    if second is None:
        return f"Fitted to {basis}."
    words = said(second.reading.partition(";")[0])
    return (
        f"Of the {len(comparison.probabilities)} forms compared on {basis}, "
        f"{form_name(best)} has probability {probability(comparison.probabilities[best])} at equal "
        f"prior odds. Its ln Bayes factor over {form_name(second.form)}, the next, is "
        f"{with_error(second.ln_bf, second.ln_bf_se)}: {words}."
    )


def _robustness(comparison: Comparison) -> list[str]:
    """Say how the Bayes factor against the next form moves with the prior scales."""
    best, second = best_form(comparison), runner_up(comparison)
    if best is None or second is None:
        return []
    factors = sensitivity_factors(comparison, best)
    ours = -factors[factors["form"] == second.form]["ln_bf"].dropna()
    if not len(ours):
        return []
    low, high = float(ours.min()), float(ours.max())
    tail = (
        f"{form_name(best)} stays ahead."
        if low > 0
        else f"for some prior scales {form_name(second.form)} is ahead."
    )
    return [
        "With the scale of each prior in turn run over a factor of 100, the ln Bayes factor over "
        f"{form_name(second.form)} lies between {decimals(low, 1)} and {decimals(high, 1)}: {tail}"
    ]
