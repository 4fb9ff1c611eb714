"""Published reporting checklists, held against the page itself: where each item is met, or why not.

BARG: Kruschke (2021), doi:10.1038/s41562-021-01177-7. WAMBS: Depaoli and van de Schoot (2017),
doi:10.1037/met0000065.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from ridgebayes.report.blocks import Block, Folded, Odds, OwnTexture, Picture, Section, Table
from ridgebayes.report.first_screen import FirstScreen

ANSWER = "answer"
_QUICK = "a quick run leaves it out; --accuracy standard has it"
_SLOW = "left out of a quick run, with over 20 parameters, and where offsets are sampled"
_ONE = "only one form was compared"


@dataclass(frozen=True)
class Item:
    """An item of a checklist.

    Parameters
    ----------
    name : str
        Guideline, number, and what it asks for.
    anchor : str
        Section that meets it; empty where it does not apply to these analyses.
    words : str
        What stands there; where it is not met, why.
    otherwise : str
        Why the words may be missing.
    """

    name: str
    anchor: str
    words: str
    otherwise: str = _QUICK


ITEMS = (
    Item("BARG 0A, why Bayesian", "computation", "Why Bayesian"),
    Item("BARG 0B, goals", ANSWER, "Which contact form describes"),
    Item("BARG 1A, data variables", "evidence", "at which load p/E each count Q of edges"),
    Item("BARG 1B, likelihood and parameters", "evidence", "the log load of a row is y ="),
    Item("BARG 1C, priors and their reasons", "data", "Priors of this run"),
    Item("BARG 1D, formal specification", "evidence", "s(Q)"),
    Item("BARG 1E, prior predictive check", "data", "Prior predictive check"),
    Item("BARG 2A, software", "appendix", "ridgebayes"),
    Item("BARG 2B, convergence", "computation", "R-hat"),
    Item("BARG 2C, effective sample size", "computation", "Bulk ESS"),
    Item("BARG 2D, methods that are not chains", "computation", "Evidence by independent methods"),
    Item(
        "BARG 3A, posterior predictive check",
        "checks",
        "residuals of rows replicated",
        "no row gives its load exactly",
    ),
    Item("BARG 3B, posterior of the parameters", "evidence", "Posterior mean ± sd"),
    Item("BARG 3C, Bayes factors, model probabilities", "evidence", "ln BF against the best"),
    Item("BARG 4A, decision rule", "computation", "Decision rule"),
    Item("BARG 4B, loss function", "", "the verdict grades evidence; no loss enters it"),
    Item("BARG 4C, limits of a ROPE", "", "no decision is taken on the value of a parameter"),
    Item(
        "BARG 4D, smallest prior probability of a model",
        ANSWER,
        "passes 0.95 if its prior probability is above",
        f"{_ONE}, or the verdict is undecided",
    ),
    Item("BARG 4E, estimates beside decisions", "evidence", "Coefficients"),
    Item(
        "BARG 5A to 5D, sensitivity to priors",
        "evidence",
        "scale of each prior is varied from",
        _ONE,
    ),
    Item("BARG 5E, sensitivity of the decision", ANSWER, "across priors and error models", _ONE),
    Item("BARG 6A, versions", "appendix", "Python"),
    Item("BARG 6B and 6C, script and data", ANSWER, "table SHA-256"),
    Item("BARG 6D, auxiliary files", "appendix", "posterior-"),
    Item("BARG 6E, runs as posted", "appendix", "the same bytes"),
    Item("BARG 6F, stability of the draws", "computation", "with twice the draws", _SLOW),
    Item("WAMBS 1, priors understood", "data", "Why"),
    Item("WAMBS 2, traces", "", "draws are independent of each other: there is no trace"),
    Item("WAMBS 3, twice the draws", "computation", "with twice the draws", _SLOW),
    Item("WAMBS 4, histograms", "computation", "Contours contain"),
    Item("WAMBS 5, autocorrelation", "computation", "integrated autocorrelation times"),
    Item("WAMBS 6, posteriors make sense", "checks", "Sense check"),
    Item("WAMBS 7, priors of variances", "evidence", "scale of each prior is varied from", _ONE),
    Item("WAMBS 8, wide priors", "evidence", "scale of each prior is varied from", _ONE),
    Item("WAMBS 9, sensitivity", "computation", "Sensitivity to prior and likelihood"),
    Item("WAMBS 10, Bayesian interpretation", ANSWER, " prior ", _ONE),
)


def held_against(first: FirstScreen, sections: Sequence[Section]) -> list[tuple[str, bool, str]]:
    """Return each item's name, whether the page meets it, and where or why not.

    Parameters
    ----------
    first : FirstScreen
        The first screen.
    sections : sequence of Section
        The rest of the page.
    """
    texts = {section.anchor: " ".join(_words(section.blocks)) for section in sections}
    titles = {section.anchor: section.title for section in sections}
    titles[ANSWER] = "First screen"
    texts[ANSWER] = " ".join([first.question, first.headline, *first.sentences, first.made_by])
    rows = []
    for item in ITEMS:
        is_met = bool(item.anchor) and item.words in texts.get(item.anchor, "")
        where = titles[item.anchor] if is_met else item.otherwise if item.anchor else item.words
        rows.append((item.name, is_met, where))
    return rows


def _words(blocks: Sequence[Block]) -> list[str]:
    """Return all words of some blocks."""
    found: list[str] = []
    for block in blocks:
        if isinstance(block, Table):
            found += [block.caption, *block.header, *(cell for row in block.rows for cell in row)]
        elif isinstance(block, Picture):
            found.append(block.caption)
        elif isinstance(block, Folded):
            found += [block.title, *_words(block.blocks)]
        elif not isinstance(block, Odds | OwnTexture):
            found.append(block.words)
    return found
