"""Verdict of a comparison: the most probable form, a grade and the reason for the grade."""

import math
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import pandas as pd
from scipy.special import logsumexp

from ridgebayes.comparison.bayes_factors import summed_evidence
from ridgebayes.evidence.prior_sensitivity import NUGGET
from ridgebayes.evidence.tables import mean_evidence, used_evidence
from ridgebayes.model.noise import SERIES, Noise
from ridgebayes.predict.extrapolation import MIN_SHARE

GRADES = ("decisive", "supports", "leans", "undecided")
MIN_LN_BF_LEANS = 2.0  # smallest ln BF of the grade "leans"; below it the verdict is undecided
# A decisive ln BF must also stay above `MIN_LN_BF_SUPPORTS` under all priors and error models.
MIN_LN_BF_SUPPORTS, MIN_LN_BF_DECISIVE = 3.0, 5.0
_ERROR_MODEL_PRIORS = ("sigma", "tau_", "length_", "df", NUGGET)  # prefixes, the same in all forms
_SURE = 0.95  # posterior probability of the form at `min_prior_probability`
# These forms are equal if each texture has a free factor.
_EQUAL_WITH_OFFSETS = frozenset({"modified", "power-law"})


@dataclass(frozen=True)
class Verdict:
    """Most probable form, with a grade and the range of ln BF over priors and error models.

    Parameters
    ----------
    form : str
        Most probable form at equal prior odds, for any grade.
    grade : str
        ``decisive``, ``supports``, ``leans`` or ``undecided``.
    ln_bf : float
        ln Bayes factor over the next form, with error models summed out.
    ln_bf_range : tuple of (float, float)
        Smallest and largest ln Bayes factor over the strongest other form, if the scale of one
        prior is changed at a time, and under each single error model of more than 1 % weight.
    over : str
        Next most probable form.
    min_prior_probability : float
        Smallest prior probability of the form at which its posterior probability is 0.95, if the
        other forms share the rest equally.
    error_model : str
        Name of the selected error model.
    error_model_weights : dict of str to float
        Posterior probabilities of the error models above 1 %, with forms summed out.
    why : str
        Reason for the grade, in words.

    Examples
    --------
    >>> import ridgebayes as rb
    >>> cmp = rb.compare(rb.paper_sweep(), ["modified", "hybrid"], noise="iid", accuracy="quick")
    >>> entries = cmp.verdict.to_dict()
    >>> entries["form"], entries["over"], entries["grade"], round(entries["ln_bf"], 1)
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
        # JSON has no infinity, which is the ln BF over forms without an evidence.
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
    """Return the verdict that follows from evidences and their prior sensitivity.

    Parameters
    ----------
    evidence : pandas.DataFrame
        Table of `evidence.csv`.
    sensitivity : pandas.DataFrame
        Table of `prior_sensitivity.csv`, which may be empty.
    selected : Noise
        Error model of the fits shown.
    same_loads : callable
        Function of the names of two forms, True if they can reach the same loads at all fitted
        rows, see `ridgebayes.comparison.same_loads`.
    failed : collection of str, optional
        Forms that could not be fitted. As any of them may be the best form, the verdict is then
        undecided.
    series_are_textures : bool, optional
        Whether each series has rows of only one texture, so that series offsets are texture
        offsets.

    Returns
    -------
    Verdict or None
        None if fewer than two forms have an evidence.
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
    unfitted = f"{' and '.join(failed)} could not be fitted, and may be better" if failed else ""
    obstacle = unfitted or _indistinguishable(best, over, same_loads, with_offsets)
    grade = "undecided" if obstacle else _grade(ln_bf, low)
    return Verdict(
        form=best,
        grade=grade,
        ln_bf=ln_bf,
        ln_bf_range=(low, high),
        over=over,
        min_prior_probability=_min_prior_probability(*ranked.values()),
        error_model=selected.name,
        error_model_weights={str(name): float(w) for name, w in weights.items() if w > MIN_SHARE},
        why=obstacle or _why(grade, ln_bf, low, min(factors, key=lambda k: factors[k], default="")),
    )


def ranked_forms(evidence: pd.DataFrame) -> dict[str, float]:
    """Return ln evidence by form with error models summed out, in descending order."""
    forms = {form: value for form, (value, _) in summed_evidence(evidence).items()}
    return dict(sorted(forms.items(), key=lambda item: -item[1]))


def leads(evidence: pd.DataFrame, sensitivity: pd.DataFrame) -> dict[str, float]:
    """Return ln BF of the best form over the strongest other form, by the name of each change."""
    used, forms = used_evidence(evidence), ranked_forms(evidence)
    changes = [*_perturbed(used, forms, sensitivity), *_unusable(evidence, used, forms)]
    by_change = {change: _lead(values, next(iter(forms))) for change, values in changes}
    return {change: lead for change, lead in by_change.items() if not math.isnan(lead)}


def is_error_model_prior(prior: str) -> bool:
    """Return whether a prior belongs to the error model and so changes for all forms together."""
    return prior.startswith(_ERROR_MODEL_PRIORS)


def _perturbed(
    used: pd.DataFrame, forms: dict[str, float], sensitivity: pd.DataFrame
) -> Iterator[tuple[str, dict[str, float]]]:
    """Yield the ln evidences of all forms for each changed prior and each single error model."""
    for (prior, factor), part in sensitivity.groupby(["prior", "factor"], sort=False):
        values = zip(part["form"], part["log_evidence"], strict=True)
        new = {form: value for form, value in values if form in forms and not math.isnan(value)}
        scaled = "nugget" if prior == NUGGET else f"{prior} prior's scale"
        change = f"{scaled} times {factor:g}"
        if is_error_model_prior(str(prior)):
            yield change, forms | new
        else:
            yield from ((f"{form}'s {change}", forms | {form: new[form]}) for form in new)
    share = np.exp(used["log_evidence"] - logsumexp(used["log_evidence"]))
    by_noise = share.groupby(used["noise"]).sum()
    for noise in by_noise.index[by_noise > MIN_SHARE]:
        alone = used[used["noise"] == noise].set_index("form")["log_evidence"]
        yield f"error model {noise} alone", alone.dropna().to_dict()


def _unusable(
    evidence: pd.DataFrame, used: pd.DataFrame, forms: dict[str, float]
) -> Iterator[tuple[str, dict[str, float]]]:
    """Yield ln evidences that include the best estimate of a pair without a usable evidence."""
    usable = pd.MultiIndex.from_frame(used[["form", "noise"]])
    pairs = pd.MultiIndex.from_frame(evidence[["form", "noise"]])
    unusable = evidence[~pairs.isin(usable) & np.isfinite(evidence["log_evidence"])]
    estimates = unusable.groupby(["form", "noise"])["log_evidence"].max()
    n_noise = max(used["noise"].nunique(), 1)
    for (form, noise), value in estimates.items():
        if form in forms:
            total = float(np.logaddexp(forms[form], value - math.log(n_noise)))
            yield f"{form} under {noise}, whose evidence is uncertain", forms | {form: total}


def _lead(values: Mapping[str, float], best: str) -> float:
    """Return ln BF of a form over the strongest other form."""
    others = [value for form, value in values.items() if form != best]
    return values.get(best, -math.inf) - max(others, default=-math.inf)


def _grade(ln_bf: float, low: float) -> str:
    if ln_bf >= MIN_LN_BF_DECISIVE and low > MIN_LN_BF_SUPPORTS:
        return "decisive"
    if ln_bf >= MIN_LN_BF_SUPPORTS and low > 0:
        return "supports"
    return "leans" if ln_bf >= MIN_LN_BF_LEANS and low > 0 else "undecided"


def _indistinguishable(
    best: str, over: str, same_loads: Callable[[str, str], bool], with_offsets: float
) -> str:
    """Return the reason that no loads at these rows can distinguish two forms; empty if they can.

    `with_offsets` is the probability that each texture has an offset.
    """
    pair = {best, over}
    names = " and ".join(sorted(pair))
    if same_loads(best, over):
        return f"{names} can predict the same loads at all fitted rows: only their priors differ"
    if with_offsets > 0.5 and pair == _EQUAL_WITH_OFFSETS:
        return f"{names} are the same where each texture has an offset: only their priors differ"
    return ""


def _why(grade: str, ln_bf: float, low: float, weakest: str) -> str:
    """Return the reason for a grade; `weakest` names the change with the smallest lead."""
    lead = f"ln BF {ln_bf:.1f}, at least {low:.1f} over priors and error models"
    at = f" ({weakest})" if weakest and low < ln_bf else ""
    if grade != "undecided":
        return lead + at
    if ln_bf < MIN_LN_BF_LEANS:
        return f"ln BF {ln_bf:.2f} over the next form is under {MIN_LN_BF_LEANS:g}"
    return f"ln BF {ln_bf:.1f}, but another form is ahead under another prior or error model{at}"


def _min_prior_probability(best: float, *others: float) -> float:
    mean = float(logsumexp(others)) - math.log(len(others))
    odds = _SURE / (1 - _SURE) * math.exp(min(mean - best, 700.0))
    return odds / (1 + odds)
