"""First screen of the report: question, graded answer in three sentences, and provenance."""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from ridgebayes._types import __version__
from ridgebayes.checks.report_data import ReportData
from ridgebayes.comparison.comparison import Comparison
from ridgebayes.comparison.verdict import MIN_LN_BF_LEANS, Verdict
from ridgebayes.report.blocks import Picture
from ridgebayes.report.wording import change_text, form_name, listed, percent, say
from ridgebayes.runtime.text import count

EQUAL = "at equal prior odds"


@dataclass(frozen=True)
class FirstScreen:
    """Content of the first screen.

    Parameters
    ----------
    question, headline : str
        Question of the comparison, and the graded answer.
    sentences : tuple of str
        Compared forms and data; certainty of the answer and changes that would alter it;
        consequence for predictions. A fourth gives the result of a second comparison, if any.
    cautions : tuple of str
        Limits of the result.
    problems : tuple of str
        Fits that failed or did not converge; the report marks them in red.
    advice : str
        Remedy for the problems.
    picture : Picture
        Q against load with bands.
    made_by : str
        Command, seed, digest of the table and version.
    """

    question: str
    headline: str
    sentences: tuple[str, ...]
    cautions: tuple[str, ...]
    problems: tuple[str, ...]
    advice: str
    picture: Picture
    made_by: str


def first_screen(
    data: ReportData, reference: ReportData | None = None, command: str = ""
) -> FirstScreen:
    """Return the first screen of a report, with a sentence on a second comparison if given."""
    problems, table, verdict = data.problems, data.comparison.table, data.comparison.verdict
    sure = "" if verdict is None else say("how_sure", verdict=verdict, why=why(verdict))
    sentences = [_compared(data), sure, _consequence(data)]
    if reference is not None:
        n_row = len(reference.comparison.table.calibration)
        words = {"headline": _headline(reference), "verdict": reference.comparison.verdict}
        sentences.append(say("second", n_row=n_row, **words))
        problems += tuple(f"finite-element rows: {what}" for what in reference.problems)
    made_by = [
        command or f"seed of the draws {data.fit.seed}",
        f"table SHA-256 {table.digest()[:12]}",
        f"ridgebayes {__version__}",
    ]
    unfinished = (data if data.problems or reference is None else reference).comparison
    without_fit = unfinished.failures or set(unfinished.fits) - set(unfinished.probabilities)
    states = {"are_unconverged": unfinished.unconverged, "are_without_fit": without_fit}
    return FirstScreen(
        say("question", name=Path(table.where).name),
        _headline(data),
        tuple(filter(None, sentences)),
        data.comparison.cautions,
        problems,
        say("advice", **{name: bool(state) for name, state in states.items()}),
        _bands(data),
        " · ".join(made_by),
    )


def _headline(data: ReportData) -> str:
    if (verdict := data.comparison.verdict) is None:
        return say("no_verdict", best=data.best)
    return headline(verdict, data.comparison.probabilities_at_equal_odds)


def headline(verdict: Verdict, probabilities: Mapping[str, float]) -> str:
    """Return a verdict as one sentence.

    Parameters
    ----------
    verdict : Verdict
        Verdict of a comparison.
    probabilities : mapping of str to float
        Posterior probabilities of the forms at equal prior odds. An undecided verdict names all
        forms whose ln Bayes factor is within 2 of the best.
    """
    least = math.exp(-MIN_LN_BF_LEANS) * probabilities[verdict.form]
    others = {verdict.over} | {name for name, share in probabilities.items() if share > least}
    ranked = sorted(others - {verdict.form}, key=lambda name: -probabilities[name])
    return say("headline", verdict=verdict, open=[*map(form_name, [verdict.form, *ranked])])


def _compared(data: ReportData) -> str:
    comparison, verdict = data.comparison, data.comparison.verdict
    rows = comparison.table.calibration
    scored = [name for name in data.ranked if not verdict or name in comparison.probabilities]
    return say(
        "compared",
        names=listed([form_name(name) for name in scored]),
        basis=f"{count(len(rows), 'row')} of {count(len(rows.textures), 'texture')}",
        prior=verdict and prior_words(comparison),
        verdict=verdict,
        comparison=comparison,
    )


def prior_words(comparison: Comparison) -> str:
    """Return the prior probabilities of the forms in words."""
    prior = comparison.prior_probabilities
    if math.isclose(max(prior.values()), min(prior.values())):  # equal up to rounding
        return EQUAL
    return say("prior_odds", prior=prior)


def lead(verdict: Verdict) -> str:
    """Return the Bayes factor and its range as a sentence; its width rounds the range."""
    return say("bayes_factor", verdict=verdict)


def why(verdict: Verdict) -> str:
    """Return the reason for a grade, with the displayed names of the forms.

    Parameters
    ----------
    verdict : Verdict
        Verdict of a comparison.
    """
    reason, _, weakest = verdict.why.partition(" (")
    for name in (verdict.form, verdict.over):
        reason = re.sub(rf"\b{name}\b", form_name(name), reason)
    return f"{reason} ({change_text(weakest.removesuffix(')'))})" if weakest else reason


def _consequence(data: ReportData) -> str:
    """Say how the choice of a form changes predictions at the table's textures."""
    prob = percent(data.bands["prob"].iloc[0])
    return say("consequence", effect=data.consequence, shown=data.shown, prob=prob)


def _bands(data: ReportData) -> Picture:
    """Return Q against load for at most three textures."""
    n, n_shown = len(data.comparison.table.ok.textures), len(data.textures)
    name = "bands" if n <= 3 or not n_shown else "bands-first"
    some = say("bands_shown", n=n, n_shown=n_shown, are_all_below=data.preset.extras)
    caption = say("first_bands_caption", shown=form_name(data.shown), some=some)
    return Picture(name, caption, f"{_consequence(data)} {some}".strip())
