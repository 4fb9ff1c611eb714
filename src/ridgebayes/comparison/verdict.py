"""The verdict of a comparison: which form, how surely, and what would change it."""

import math
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import pandas as pd
from scipy.special import logsumexp

from ridgebayes.comparison.bayes_factors import summed_evidence
from ridgebayes.evidence.prior_sensitivity import NUGGET
from ridgebayes.evidence.tables import MIN_PAIR_WEIGHT, mean_evidence, used_evidence
from ridgebayes.model.noise import SERIES, Noise

GRADES = ("decisive", "supports", "leans", "undecided")
LEANS = 2.0  # ln BF; lower values leave the verdict undecided
DECISIVE, LEAD = 5.0, 3.0  # ln BF of a decisive verdict, and its least value over all changes
_OF_ERRORS = ("sigma", "tau_", "length_", "df", NUGGET)  # priors of the error model, in all forms
_SURE = 0.95  # posterior probability that counts as decisive for a reader's own prior
# Forms that are the same where each texture has a free factor of its own.
_ALIKE_WITH_OFFSETS = frozenset({"modified", "power-law"})


@dataclass(frozen=True)
class Verdict:
    """Which form the evidence supports, graded, and the range over priors and error models.

    Parameters
    ----------
    form : str
        The most probable form at equal prior odds, whatever the grade.
    grade : str
        ``decisive``, ``supports``, ``leans`` or ``undecided``.
    ln_bf : float
        ln Bayes factor over the next form, error models summed out.
    ln_bf_range : tuple of (float, float)
        Its least and greatest value over the strongest other form, with the scale of one prior
        changed at a time, and under each error model that carries weight, taken alone.
    over : str
        The next form.
    min_prior_probability : float
        Smallest prior probability of the form, the others sharing the rest, at which its posterior
        one is 0.95.
    error_model : str
        The selected one.
    error_model_weights : dict of str to float
        Posterior probabilities, forms summed out, of those above one per cent.
    why : str
        Reason for the grade, in words.

    Examples
    --------
    >>> import ridgebayes as rb
    >>> found = rb.compare(rb.paper_sweep(), [rb.Modified(), rb.Hybrid()], noise="iid", rng=1)
    >>> said = found.verdict.to_dict()
    >>> said["form"], said["over"], said["grade"], round(said["ln_bf"], 1)
    ('hybrid', 'modified', 'supports', 4.5)
    """

    form: str
    grade: str
    ln_bf: float
    ln_bf_range: tuple[float, float]
    over: str
    min_prior_probability: float
    error_model: str
    error_model_weights: Mapping[str, float]
    why: str

    def to_dict(self) -> dict[str, Any]:
        """Return the entries of run.json."""
        # JSON has no infinity, the ln BF where a form lacks an evidence under an error model.
        ends = [end if math.isfinite(end) else None for end in self.ln_bf_range]
        return asdict(self) | {"ln_bf_range": ends}


def verdict_of(
    evidence: pd.DataFrame,
    sensitivity: pd.DataFrame,
    selected: Noise,
    same_loads: Callable[[str, str], bool],
    failed: Collection[str] = (),
    *,
    series_are_textures: bool = False,
) -> Verdict | None:
    """Return the verdict that evidences and their sensitivity lead to.

    Parameters
    ----------
    evidence : pandas.DataFrame
        `evidence.csv`.
    sensitivity : pandas.DataFrame
        `prior_sensitivity.csv`; may be empty.
    selected : Noise
        Error model of the fits that are shown.
    same_loads : callable
        Whether two forms, by name, can reach the same loads at all fitted rows, see
        `ridgebayes.comparison.same_loads`.
    failed : collection of str, optional
        Forms that could not be fitted: any of them may be the best one, so that nothing is decided.
    series_are_textures : bool, optional
        Whether each series has rows of one texture alone, so that its offset is the texture's.

    Returns
    -------
    Verdict or None
        None where fewer than two forms have an evidence.
    """
    ranked = ranked_forms(evidence)
    if len(ranked) < 2:
        return None
    (best, first), (over, second), *_ = ranked.items()
    ln_bf = first - second
    factors = leads(evidence, sensitivity)
    low, high = min([ln_bf, *factors.values()]), max([ln_bf, *factors.values()])
    weights = mean_evidence(evidence).set_index("noise")["probability"]
    shared = {"texture", SERIES} if series_are_textures else {"texture"}
    with_offsets = sum(
        w for name, w in weights.items() if shared & set(Noise.named(str(name)).factors)
    )
    open_ = _unfitted(failed) or _alike(best, over, same_loads, with_offsets)
    grade = "undecided" if open_ else _grade(ln_bf, low)
    return Verdict(
        form=best,
        grade=grade,
        ln_bf=ln_bf,
        ln_bf_range=(low, high),
        over=over,
        min_prior_probability=_min_prior_probability(*ranked.values()),
        error_model=selected.name,
        error_model_weights={
            str(name): float(w) for name, w in weights.items() if w > MIN_PAIR_WEIGHT
        },
        why=open_ or _why(grade, ln_bf, low, min(factors, key=lambda k: factors[k], default="")),
    )


def ranked_forms(evidence: pd.DataFrame) -> dict[str, float]:
    """Return ln evidence by form, error models summed out, the highest first."""
    forms = {form: value for form, (value, _) in summed_evidence(evidence).items()}
    return dict(sorted(forms.items(), key=lambda item: -item[1]))


def leads(evidence: pd.DataFrame, sensitivity: pd.DataFrame) -> dict[str, float]:
    """Return ln BF of the best form over the strongest other one, by what is changed."""
    used, forms = used_evidence(evidence), ranked_forms(evidence)
    changes = [*_perturbed(used, forms, sensitivity), *_unusable(evidence, used, forms)]
    by_change = {what: _lead(values, next(iter(forms))) for what, values in changes}
    return {what: lead for what, lead in by_change.items() if not math.isnan(lead)}


def of_errors(prior: str) -> bool:
    """Return whether a prior is of the error models, and moves in all forms together."""
    return prior.startswith(_OF_ERRORS)


def _perturbed(
    used: pd.DataFrame, forms: dict[str, float], sensitivity: pd.DataFrame
) -> Iterator[tuple[str, dict[str, float]]]:
    """Give ln evidences by form under each change of a prior, and under each error model alone."""
    for (prior, factor), part in sensitivity.groupby(["prior", "factor"], sort=False):
        values = zip(part["form"], part["log_evidence"], strict=True)
        new = {form: value for form, value in values if form in forms and not math.isnan(value)}
        of = "nugget" if prior == NUGGET else f"{prior} prior's scale"
        what = f"{of} times {factor:g}"
        if of_errors(str(prior)):
            yield what, forms | new
        else:
            yield from ((f"{form}'s {what}", forms | {form: new[form]}) for form in new)
    share = np.exp(used["log_evidence"] - logsumexp(used["log_evidence"]))
    by_noise = share.groupby(used["noise"]).sum()
    for noise in by_noise.index[by_noise > MIN_PAIR_WEIGHT]:
        alone = used[used["noise"] == noise].set_index("form")["log_evidence"]
        yield f"error model {noise} alone", alone.dropna().to_dict()


def _unusable(
    evidence: pd.DataFrame, used: pd.DataFrame, forms: dict[str, float]
) -> Iterator[tuple[str, dict[str, float]]]:
    """Give ln evidences with what is known of a pair whose own could not be used."""
    usable = pd.MultiIndex.from_frame(used[["form", "noise"]])
    pairs = pd.MultiIndex.from_frame(evidence[["form", "noise"]])
    lost = evidence[~pairs.isin(usable) & np.isfinite(evidence["log_evidence"])]
    n_noise = max(used["noise"].nunique(), 1)
    for (form, noise), value in lost.groupby(["form", "noise"])["log_evidence"].max().items():
        if form in forms:
            known_too = float(np.logaddexp(forms[form], value - math.log(n_noise)))
            what = f"{form} under {noise}, whose evidence is uncertain"
            yield what, forms | {form: known_too}


def _lead(values: Mapping[str, float], best: str) -> float:
    """Return ln BF of a form over the strongest of the others."""
    others = [value for form, value in values.items() if form != best]
    if best not in values:
        return -math.inf
    return values[best] - max(others) if others else math.inf


def _grade(ln_bf: float, low: float) -> str:
    if ln_bf >= DECISIVE and low > LEAD:
        return "decisive"
    if ln_bf >= 3 and low > 0:
        return "supports"
    return "leans" if ln_bf >= LEANS and low > 0 else "undecided"


def _unfitted(failed: Collection[str]) -> str:
    """Say that a form without an evidence may be the best; empty if all have one."""
    return f"{' and '.join(failed)} could not be fitted, and may be better" if failed else ""


def _alike(
    best: str, over: str, same_loads: Callable[[str, str], bool], with_offsets: float
) -> str:
    """Say why two forms cannot be told apart by any rows of this table; empty if they can.

    `with_offsets` is the probability that each texture has an offset.
    """
    pair = {best, over}
    names = " and ".join(sorted(pair))
    if same_loads(best, over):
        return f"{names} can predict the same loads at all fitted rows: only their priors differ"
    if with_offsets > 0.5 and pair == _ALIKE_WITH_OFFSETS:
        return f"{names} are the same where each texture has an offset: only their priors differ"
    return ""


def _why(grade: str, ln_bf: float, low: float, weakest: str) -> str:
    """Say what a grade follows from; `weakest`: where the lead is least."""
    led = f"ln BF {ln_bf:.1f}, at least {low:.1f} over priors and error models"
    at = f" ({weakest})" if weakest and low < ln_bf else ""
    if grade != "undecided":
        return led + at
    if ln_bf < LEANS:
        return f"ln BF {ln_bf:.1f} over the next form is under {LEANS:g}"
    return f"ln BF {ln_bf:.1f}, but another form is ahead under another prior or error model{at}"


def _min_prior_probability(best: float, *others: float) -> float:
    mean = float(logsumexp(others)) - math.log(len(others))
    odds = _SURE / (1 - _SURE) * math.exp(min(mean - best, 700.0))
    return odds / (1 + odds)
