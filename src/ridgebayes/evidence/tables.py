"""Evidences of pairs of form and error model as a table."""

import math
from collections.abc import Mapping, Sequence

import pandas as pd
from scipy.special import logsumexp

from ridgebayes.inference.log_evidence import LogEvidence

EVIDENCE_COLUMNS = [
    "form",
    "noise",
    "method",
    "log_evidence",
    "log_evidence_se",
    "used",
    "prior_probability",
    "model_probability",
    "status",
]


def evidence_table(found: Mapping[tuple[str, str], Sequence[LogEvidence]]) -> pd.DataFrame:
    """Return evidences by form, error model and method, and model probabilities at equal prior.

    Parameters
    ----------
    found : mapping of (str, str) to sequence of LogEvidence
        By names of form and error model. The first whose status is ok is the one that Bayes factors
        and probabilities use.

    Returns
    -------
    pandas.DataFrame
        Columns of `evidence.csv`. Probabilities are of pairs: prior ones all alike, posterior ones
        with a sum of 1.
    """
    used = {key: next((e for e in methods if e.ok), None) for key, methods in found.items()}
    total = logsumexp([-math.inf, *(e.value for e in used.values() if e is not None)])
    rows = []
    for key, methods in found.items():
        for e in methods:
            chosen = e is used[key]
            share = math.exp(e.value - total) if chosen else math.nan
            numbers = (e.method, e.value, e.se, chosen, 1 / len(found), share, e.status)
            rows.append((*key, *numbers))
    return pd.DataFrame(rows, columns=EVIDENCE_COLUMNS)


def used_evidence(evidence: pd.DataFrame) -> pd.DataFrame:
    """Return the evidence that is used of each form under each error model."""
    return evidence[evidence["used"]].drop_duplicates(["form", "noise"])
