"""Changes of a prior that could decide the grade of a verdict: found anew where draws cannot tell.

Evidences under another prior follow from draws. An error model without draws is a small part of its
form, but only under the default priors: under others it may be the largest.
"""

import math
from collections.abc import Callable, Collection, Mapping
from typing import Any, TypeAlias

import pandas as pd

from ridgebayes.comparison.verdict import DECISIVE, LEAD, LEANS, leads, of_errors, ranked_forms
from ridgebayes.evidence.changed_prior import NUGGET
from ridgebayes.evidence.prior_sensitivity import BOUNDS, SENSITIVITY_COLUMNS
from ridgebayes.evidence.tables import used_evidence

_OPEN = 0.5  # in ln BF: by which what was not drawn may change a lead
EvidencesAnew: TypeAlias = Callable[[str, float, Collection[str]], Mapping[str, float]]


def with_deciding_priors(
    evidence: pd.DataFrame, sensitivity: pd.DataFrame, evidences: EvidencesAnew
) -> pd.DataFrame:
    """Return `prior_sensitivity.csv`, with evidences found anew where they may decide the grade.

    Parameters
    ----------
    evidence : pandas.DataFrame
        `evidence.csv`.
    sensitivity : pandas.DataFrame
        As `evidence.prior_sensitivity.prior_sensitivity` returns it, with bounds.
    evidences : callable
        Returns ln evidences by form, error models added, from prior, factor and names of forms.

    Returns
    -------
    pandas.DataFrame
        Columns prior, factor, form, log_evidence. The change that may leave the best form the least
        lead is looked at first, and no more once the others cannot cost the grade.
    """
    told = sensitivity[SENSITIVITY_COLUMNS].copy()
    ranked = ranked_forms(evidence)
    if len(ranked) < 2 or not len(told):
        return told
    (best, first), (_, second), *_ = ranked.items()
    ln_bf = first - second
    log_n = math.log(used_evidence(evidence)["noise"].nunique())
    open_ = _open_changes(sensitivity, best)
    while open_:
        (prior, factor), (bounds, least) = min(open_.items(), key=lambda item: item[1][1])
        is_open = pd.MultiIndex.from_frame(told[["prior", "factor"]]).isin(list(open_))
        low = min([ln_bf, *leads(evidence, told[~is_open]).values()])
        at_stake = _at_stake(ln_bf, low)
        if least > at_stake:
            break
        near = bounds["lower"][best] - bounds["upper"] <= at_stake
        names = {best, *bounds.index[near]}
        for form, value in evidences(prior, factor, names).items():
            here = told[["prior", "factor", "form"]].eq([prior, factor, form]).all(axis=1)
            # A search from the start may miss the mode that draws led to: it finds too little.
            told.loc[here, "log_evidence"] = max(value - log_n, bounds["lower"][form])
        del open_[prior, factor]
    return told


def _open_changes(
    sensitivity: pd.DataFrame, best: str
) -> dict[tuple[str, float], tuple[pd.DataFrame, float]]:
    """Return bounds by form, and the best form's least lead, where what was not drawn matters."""
    found: dict[tuple[Any, Any], tuple[pd.DataFrame, float]] = {}  # pandas knows no types of keys
    its = sensitivity[sensitivity["prior"].map(of_errors) & (sensitivity["prior"] != NUGGET)]
    for (prior, factor), part in its.groupby(["prior", "factor"], sort=False):
        # What could not be found from draws may be anything.
        bounds = part.set_index("form")[BOUNDS].fillna({"lower": -math.inf, "upper": math.inf})
        others = bounds.drop(best, errors="ignore")
        if len(others) == len(bounds):
            continue
        least = float(bounds["lower"][best] - others["upper"].max())
        most = float(bounds["upper"][best] - others["lower"].max())
        if least < most - _OPEN:
            found[prior, factor] = bounds, least
    return found


def _at_stake(ln_bf: float, low: float) -> float:
    """Return the lead that would cost the grade if another change left no more than that."""
    if ln_bf < LEANS or low <= 0:
        return -math.inf
    return LEAD if ln_bf >= DECISIVE and low > LEAD else 0.0
