"""Tables of evidences of forms and error models, with probabilities and the selected model."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from scipy.special import logsumexp

from ridgebayes.errors import ComputationError
from ridgebayes.inference.log_evidence import LogEvidence
from ridgebayes.model.noise import Noise
from ridgebayes.predict.extrapolation import MIN_SHARE

MAX_SELECTED_GAP = 1.1  # ln evidence; the simplest error model this close to the best is selected

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


def evidence_table(
    estimates: Mapping[tuple[str, str], Sequence[LogEvidence]],
    prior_odds: Mapping[str, float] | None = None,
) -> pd.DataFrame:
    """Return evidences by form, error model and method, and model probabilities.

    Parameters
    ----------
    estimates : mapping of (str, str) to sequence of LogEvidence
        Evidences by names of form and error model. Bayes factors and probabilities use the first
        evidence with status "ok" (or "first pass").
    prior_odds : mapping of str to float, optional
        Prior odds of forms; 1 for forms that are not given. A form's error models have equal prior
        probabilities.

    Returns
    -------
    pandas.DataFrame
        Columns of `evidence.csv`. Prior and model probabilities are those of pairs, with sum 1.
    """
    used = {key: next((e for e in methods if e.ok), None) for key, methods in estimates.items()}
    odds = {key: (prior_odds or {}).get(key[0], 1.0) for key in estimates}
    prior = {key: odds[key] / sum(odds.values()) for key in estimates}
    weight = {key: e.value + math.log(prior[key]) for key, e in used.items() if e is not None}
    total = logsumexp([-math.inf, *weight.values()])
    rows = []
    for key, methods in estimates.items():
        for e in methods:
            chosen = e is used[key]
            share = math.exp(weight[key] - total) if chosen else math.nan
            numbers = (e.method, e.value, e.se, chosen, prior[key], share, e.status)
            rows.append((*key, *numbers))
    return pd.DataFrame(rows, columns=EVIDENCE_COLUMNS)


def used_evidence(evidence: pd.DataFrame) -> pd.DataFrame:
    """Return the rows with the used evidence of each form under each error model."""
    return evidence[evidence["used"]].drop_duplicates(["form", "noise"])


def error_model_weights(evidence: pd.DataFrame, form: str) -> dict[str, float]:
    """Return the weights of error models in a form's averaged predictions.

    Parameters
    ----------
    evidence : pandas.DataFrame
        `evidence.csv` of a run.
    form : str
        Name of the form.

    Returns
    -------
    dict of str to float
        Posterior probabilities given the form, of error models above one per cent, normalised.
    """
    used = used_evidence(evidence)
    log_evidence = used[used["form"] == form].set_index("noise")["log_evidence"]
    if log_evidence.empty:
        return {}
    share = np.exp(log_evidence - logsumexp(log_evidence))
    heavy = share[share >= MIN_SHARE]
    return {str(name): float(weight) for name, weight in (heavy / heavy.sum()).items()}


def mean_evidence(evidence: pd.DataFrame) -> pd.DataFrame:
    """Return the log of the mean evidence over the forms, by error model, highest first.

    Parameters
    ----------
    evidence : pandas.DataFrame
        `evidence.csv` of a run.

    Returns
    -------
    pandas.DataFrame
        Columns noise, log_mean_evidence, probability (with equal prior probabilities of error
        models and of forms), n_form. A form without an evidence under an error model counts as
        evidence zero.

    Examples
    --------
    >>> rows = pd.DataFrame({"form": ["a", "b"] * 2, "noise": ["iid", "iid", "step", "step"],
    ...     "method": "importance", "log_evidence": [0.0, 0.0, 1.0, 1.0], "used": True})
    >>> mean_evidence(rows)["noise"].tolist()
    ['step', 'iid']
    """
    used = used_evidence(evidence)
    n_form = used["form"].nunique()
    rows = [
        (noise, float(logsumexp(part["log_evidence"])) - math.log(n_form), len(part))
        for noise, part in used.groupby("noise", sort=False)
    ]
    frame = pd.DataFrame(rows, columns=["noise", "log_mean_evidence", "n_form"])
    share = np.exp(frame["log_mean_evidence"] - logsumexp(frame["log_mean_evidence"]))
    frame.insert(2, "probability", share)
    return frame.sort_values("log_mean_evidence", ascending=False, kind="stable", ignore_index=True)


def selected_error_model(evidence: pd.DataFrame) -> Noise:
    """Return the simplest error model with a mean evidence close to the highest.

    Parameters
    ----------
    evidence : pandas.DataFrame
        `evidence.csv` of a run.

    Returns
    -------
    Noise
        Error model with the fewest parameters within `MAX_SELECTED_GAP` of the best; among several,
        the error model with the highest evidence.

    Raises
    ------
    ComputationError
        If no form has a usable evidence under any error model.
    """
    if used_evidence(evidence).empty:
        why = "; ".join(dict.fromkeys(evidence["status"]))
        raise ComputationError(f"no form has an evidence under any error model: {why}")
    means = mean_evidence(evidence)
    good = means[means["log_mean_evidence"] >= means["log_mean_evidence"].max() - MAX_SELECTED_GAP]
    noises = [Noise.named(name) for name in good["noise"]]
    return min(noises, key=lambda noise: len(noise.parameter_names))
