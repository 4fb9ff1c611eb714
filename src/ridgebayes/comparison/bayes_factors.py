"""Tables of Bayes factors, and their interpretation in words."""

import itertools
import math
from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from scipy.special import logsumexp

from ridgebayes.evidence.components import strength
from ridgebayes.evidence.tables import used_evidence
from ridgebayes.model.noise import Noise

SUMMED = "summed out"  # entry of the noise column if Bayes factors are summed over error models
BAYES_FACTOR_COLUMNS = ["form_a", "form_b", "noise", "method", "ln_bf", "ln_bf_se", "log10_bf"]
BAYES_FACTOR_COLUMNS += ["reading"]


def reading(ln_bf: float, ln_bf_se: float, form_a: str, form_b: str, caution: str | None) -> str:
    """Describe a log Bayes factor in words, on the scale of Kass and Raftery.

    Parameters
    ----------
    ln_bf, ln_bf_se : float
        ln Z_a - ln Z_b and its standard error.
    form_a, form_b : str
        Names of the forms.
    caution : str or None
        Note about the error model, which is appended.

    Returns
    -------
    str
        Words of `ridgebayes.evidence.components.strength`, the favoured form and the caution.

    Examples
    --------
    >>> reading(-4.5, 0.001, "modified", "hybrid", None)
    'strong for hybrid (Kass & Raftery)'
    """
    words = strength(ln_bf, ln_bf_se)
    if words != "undecided":
        words = f"{words} for {form_a if ln_bf > 0 else form_b} (Kass & Raftery)"
    return f"{words}; {caution}" if caution else words


def bayes_factor_table(evidence: pd.DataFrame, forms: Sequence[str], noise: Noise) -> pd.DataFrame:
    """Return the Bayes factor of each pair of forms under one error model."""
    used = evidence[evidence["used"] & (evidence["noise"] == noise.name)].set_index("form")
    columns = used[["log_evidence", "log_evidence_se", "method"]]
    rows = {form: tuple(columns.loc[form]) for form in forms if form in used.index}
    return _pairs(rows, noise.name, noise.caution)


def summed_bayes_factors(evidence: pd.DataFrame) -> pd.DataFrame:
    """Return the forms' Bayes factors with equally probable error models summed out.

    Parameters
    ----------
    evidence : pandas.DataFrame
        Table of evidences, as for `mean_evidence`.

    Returns
    -------
    pandas.DataFrame
        Columns of `bayes_factors.csv`, with the noise ``summed out``. Empty if only one error model
        was weighed.
    """
    several = len(set(used_evidence(evidence)["noise"])) > 1
    sums = summed_evidence(evidence) if several else {}
    return _pairs({form: (*value_and_se, "sum") for form, value_and_se in sums.items()}, SUMMED)


def _pairs(
    evidences: Mapping[str, tuple[float, float, str]], noise: str, caution: str | None = None
) -> pd.DataFrame:
    """Return a row for each pair of forms, given each form's ln evidence, error and method."""
    rows = []
    for (a, first), (b, second) in itertools.combinations(evidences.items(), 2):
        ln_bf, se = first[0] - second[0], math.hypot(first[1], second[1])
        method = "/".join(dict.fromkeys([first[2], second[2]]))
        words = reading(ln_bf, se, a, b, caution)
        rows.append((a, b, noise, method, ln_bf, se, ln_bf / math.log(10), words))
    return pd.DataFrame(rows, columns=BAYES_FACTOR_COLUMNS)


def summed_evidence(evidence: pd.DataFrame) -> dict[str, tuple[float, float]]:
    """Return ln evidence and its error by form, with equally probable error models summed out.

    Parameters
    ----------
    evidence : pandas.DataFrame
        Table of evidences, as for `mean_evidence`.
    """
    used, sums = used_evidence(evidence), {}
    for form, part in used.groupby("form", sort=False):
        value = float(logsumexp(part["log_evidence"]))
        share = np.exp(part["log_evidence"] - value)
        se = float(np.sqrt(((share * part["log_evidence_se"].fillna(0)) ** 2).sum()))
        sums[str(form)] = value - math.log(evidence["noise"].nunique()), se
    return sums
