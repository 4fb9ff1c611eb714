"""The first screen: the question, the graded answer in three sentences, and what made it."""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from ridgebayes._types import __version__
from ridgebayes.checks.report_data import ReportData
from ridgebayes.comparison.comparison import Comparison
from ridgebayes.comparison.verdict import LEANS, Verdict
from ridgebayes.report.blocks import Picture
from ridgebayes.report.wording import (
    change_text,
    form_name,
    listed,
    percent,
    probability,
    say,
)
from ridgebayes.runtime.text import count

EQUAL = "at equal prior odds"
_ALIKE = 1e-9  # of prior probabilities that are equal but for rounding


@dataclass(frozen=True)
class FirstScreen:
    """Content of the first screen.

    Parameters
    ----------
    question, headline : str
        Question of the comparison, and the graded answer.
    sentences : tuple of str
        Compared forms and data; how sure the answer is, and what would change it; what it
        means for predictions. Then the result of a second comparison, if there is one.
    cautions : tuple of str
        Limits that the reader has to bear in mind.
    problems : tuple of str
        Fits that failed or did not converge; a report with any is marked in red.
    advice : str
        Remedy for the problems.
    picture : Picture
        Q against load with bands.
    made_by : str
        Command, seed, digest of the table, version.
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
    """Return the first screen of a report, with a word on a second comparison if there is any."""
    problems = data.problems
    sentences = [_compared(data), _how_sure(data), _consequence(data)]
    if reference is not None:
        n_row = len(reference.comparison.table.calibration)
        sentences.append(
            f"A second comparison is on {count(n_row, 'finite-element row')}. "
            + _headline(reference)
            + (f" {lead(reference.verdict)}" if reference.verdict else "")
        )
        problems += tuple(f"finite-element rows: {what}" for what in reference.problems)
    table = data.comparison.table
    made_by = [
        command or f"seed of the draws {data.fit.seed}",
        f"table SHA-256 {table.digest()[:12]}",
        f"ridgebayes {__version__}",
    ]
    return FirstScreen(
        f"Which contact form describes {_name(table.where)}?",
        _headline(data),
        tuple(words for words in sentences if words),
        data.cautions,
        problems,
        _advice(data if data.problems or reference is None else reference),
        _bands(data),
        " · ".join(words for words in made_by if words),
    )


def _advice(data: ReportData) -> str:
    """Say what to do about fits that failed or did not converge."""
    comparison, ways = data.comparison, []
    if comparison.unconverged:
        ways.append(say("unconverged_advice"))
    if comparison.failures or set(comparison.fits) - set(comparison.probabilities):
        ways.append(say("no_fit_advice"))
    return f"What to do: {'; '.join(ways)}." if ways else ""


def _name(where: str) -> str:
    """Return a table's name in a sentence: a file's, or what is no file with an article."""
    name = Path(where).name
    return name if "." in name else f"the {name}"


def _headline(data: ReportData) -> str:
    verdict = data.verdict
    if data.best is None:
        return "No form got a usable evidence."
    if verdict is None:
        return f"Only {form_name(data.best)} was fitted, so there is no comparison."
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
    best = form_name(verdict.form)
    least = math.exp(-LEANS) * probabilities[verdict.form]
    others = {verdict.over} | {name for name, share in probabilities.items() if share > least}
    ranked = sorted(others - {verdict.form}, key=lambda name: -probabilities[name])
    return say("headline", verdict=verdict, open=[best, *map(form_name, ranked)])


def _compared(data: ReportData) -> str:
    comparison, verdict = data.comparison, data.verdict
    rows = comparison.table.calibration
    basis = f"{count(len(rows), 'row')} of {count(len(rows.textures), 'texture')}"
    compared = comparison.fits if verdict is None else data.ranked
    scored = [name for name in compared if verdict is None or name in comparison.probabilities]
    names = listed([form_name(name) for name in scored])
    prior = "" if verdict is None else prior_words(comparison)
    what = {"verdict": verdict, "comparison": comparison}
    return say("compared", names=names, basis=basis, prior=prior, **what)


def prior_words(comparison: Comparison) -> str:
    """Return the prior probabilities of the forms in words, where they are not all alike."""
    prior = comparison.prior_probabilities
    if max(prior.values()) - min(prior.values()) < _ALIKE:
        return EQUAL
    told = [f"{form_name(name)} {probability(share)}" for name, share in prior.items()]
    return f"at prior probabilities of your own, {listed(told)}"


def _how_sure(data: ReportData) -> str:
    verdict = data.verdict
    if verdict is None:
        return ""
    _, _, least = why(verdict).partition(" (")
    return say("how_sure", verdict=verdict, why=why(verdict), least=least.removesuffix(")"))


def lead(verdict: Verdict) -> str:
    """Return the Bayes factor and its range as one sentence, no finer than the range supports."""
    return say("bayes_factor", verdict=verdict)


def why(verdict: Verdict) -> str:
    """Return what a grade follows from, in a reader's words.

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
    """Say what the choice of a form changes in predictions at the table's own textures."""
    prob = percent(data.bands["prob"].iloc[0])
    return say("consequence", effect=data.consequence, shown=data.shown, prob=prob)


def _bands(data: ReportData) -> Picture:
    """Return Q against load, of three textures where there are more."""
    n, n_shown = len(data.comparison.table.textures), len(data.textures)
    name = "bands" if n <= 3 or not n_shown else "bands-first"
    others = "all are under Predictions" if data.preset.extras else "bands.csv has all"
    some = f" {n_shown} of {n} textures; {others}." if n > 3 else ""
    caption = say("first_bands_caption", shown=form_name(data.shown), some=some)
    return Picture(name, caption, f"{_consequence(data)} {some}".strip())
