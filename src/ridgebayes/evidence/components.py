"""Inclusion Bayes factors: the support of the rows for components of the error model.

The Bayes factor of a component is the mean evidence of the error models with it over the mean
evidence of the error models without it, both summed over forms.
"""

import math

import numpy as np
import pandas as pd
from scipy.special import logsumexp

from ridgebayes.evidence.tables import used_evidence
from ridgebayes.model.noise import SERIES, SMOOTH, Noise

COMPONENT_COLUMNS = ["component", "ln_bf", "ln_bf_se", "probability", "reading"]
_COMPONENTS = {  # names of components, and the factor or tail of an error model with each component
    "texture": "texture",
    "step": "step",
    "smooth": SMOOTH,
    "series": SERIES,
    "student": "student",
}


def component_table(evidence: pd.DataFrame) -> pd.DataFrame:
    """Return the inclusion Bayes factor of each component of the error model.

    ``ln BF = ln mean over error models with it of Z(m) - ln mean over those without of Z(m)``,
    where Z(m) is the sum over forms of the evidence under error model m.

    Parameters
    ----------
    evidence : pandas.DataFrame
        `evidence.csv` of a run.

    Returns
    -------
    pandas.DataFrame
        Columns component (``texture``, ``step``, ``smooth``, ``series``, ``student``), ln_bf,
        ln_bf_se, probability (posterior probability of all error models with the component, at the
        prior odds of the forms; ln_bf is at equal odds), reading. Components of all or of none of
        the error models with an evidence are omitted, so that a single error model gives no row.

    Notes
    -----
    *Validity.* A pair of form and error model without an evidence counts as zero. Components
    compete: a smooth offset explains most of the errors that step offsets explain, so that the
    Bayes factor of one can be low because of the other.

    References
    ----------
    Hinne et al. (2020), doi:10.1177/2515245919898657: inclusion Bayes factors.

    Examples
    --------
    >>> rows = pd.DataFrame({"form": "hybrid", "noise": ["iid", "step", "iid:student"],
    ...     "log_evidence": np.log([1.0, 40.0, 4.0]), "log_evidence_se": 0.0, "used": True,
    ...     "model_probability": [1 / 45, 40 / 45, 4 / 45]})
    >>> component_table(rows)[["component", "reading"]].to_numpy().tolist()
    [['step', 'positive for it'], ['student', 'positive against it']]
    """
    used, rows = used_evidence(evidence), []
    parts = {name: _factors_and_tail(name) for name in evidence["noise"].unique()}
    for component, part in _COMPONENTS.items():
        having = [name for name, own in parts.items() if part in own]
        has = used["noise"].isin(having)
        if not has.any() or has.all():
            continue
        included, se = _log_mean(used[has], len(having))
        excluded, excluded_se = _log_mean(used[~has], len(parts) - len(having))
        ln_bf, error = included - excluded, math.hypot(se, excluded_se)
        share, word = min(used.loc[has, "model_probability"].sum(), 1.0), strength(ln_bf, error)
        side = "" if word == "undecided" else " for it" if ln_bf > 0 else " against it"
        rows.append((component, ln_bf, error, share, word + side))
    return pd.DataFrame(rows, columns=COMPONENT_COLUMNS)


def strength(ln_bf: float, ln_bf_se: float) -> str:
    """Return a word for the size of a Bayes factor, on the scale of Kass and Raftery.

    Parameters
    ----------
    ln_bf, ln_bf_se : float
        Log of the Bayes factor and its standard error.

    Returns
    -------
    str
        ``undecided`` if abs(ln BF) is under 1 or under two standard errors, else ``positive``,
        ``strong`` or ``very strong``.

    References
    ----------
    Kass & Raftery (1995), doi:10.1080/01621459.1995.10476572, section 3.2: 2 ln BF of 2, 6, 10.

    Examples
    --------
    >>> strength(-4.5, 0.1), strength(1.5, 1.0)
    ('strong', 'undecided')
    """
    size = abs(ln_bf)
    if not size >= 1 or size < 2 * ln_bf_se:
        return "undecided"
    return "positive" if size < 3 else "strong" if size < 5 else "very strong"


def _factors_and_tail(noise: str) -> set[str]:
    """Return the factors of an error model, and its tail."""
    error_model = Noise.named(noise)
    return {*error_model.factors, error_model.tail}


def _log_mean(used: pd.DataFrame, n: int) -> tuple[float, float]:
    """Return the log of the mean evidence of n error models, summed over forms, and its error."""
    total = float(logsumexp(used["log_evidence"]))
    share = np.exp(used["log_evidence"] - total)
    se = float(np.sqrt(((share * used["log_evidence_se"].fillna(0)) ** 2).sum()))
    return total - math.log(n), se
