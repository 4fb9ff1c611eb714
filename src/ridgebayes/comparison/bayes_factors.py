"""Bayes factors of several fits as a table, and in words."""

import itertools
import math
from collections.abc import Sequence

import numpy as np
import pandas as pd
from scipy.special import logsumexp

from ridgebayes.evidence.components import strength
from ridgebayes.evidence.tables import used_evidence
from ridgebayes.model.noise import Noise

SUMMED = "summed out"  # the noise column of Bayes factors that hold for no error model alone
BAYES_FACTOR_COLUMNS = [
    "form_a",
    "form_b",
    "noise",
    "method",
    "ln_bf",
    "ln_bf_se",
    "log10_bf",
    "reading",
]


def reading(ln_bf: float, ln_bf_se: float, form_a: str, form_b: str, caution: str | None) -> str:
    """Put a log Bayes factor in words, on the scale of Kass and Raftery.

    Parameters
    ----------
    ln_bf, ln_bf_se : float
        ln Z_a - ln Z_b and its standard error.
    form_a, form_b : str
        Names.
    caution : str or None
        Note about the error model.

    Returns
    -------
    str
        As `ridgebayes.evidence.components.strength`, with the favoured form and the caution.

    Examples
    --------
    >>> reading(-4.5, 0.001, "modified", "hybrid", None)
    'strong for hybrid (Kass & Raftery)'
    """
    words = strength(ln_bf, ln_bf_se)
    if words != "undecided":
        words = f"{words} for {form_a if ln_bf > 0 else form_b} (Kass & Raftery)"
    return f"{words}; {caution}" if caution else words


def factor_row(
    form_a: str,
    form_b: str,
    noise: str,
    method: str,
    ln_bf: float,
    ln_bf_se: float,
    caution: str | None,
) -> dict[str, object]:
    """Return one row of `bayes_factors.csv`."""
    return {
        "form_a": form_a,
        "form_b": form_b,
        "noise": noise,
        "method": method,
        "ln_bf": ln_bf,
        "ln_bf_se": ln_bf_se,
        "log10_bf": ln_bf / math.log(10),
        "reading": reading(ln_bf, ln_bf_se, form_a, form_b, caution),
    }


def bayes_factor_table(evidence: pd.DataFrame, forms: Sequence[str], noise: Noise) -> pd.DataFrame:
    """Return the Bayes factor of each pair of forms under an error model."""
    mine = evidence[evidence["used"] & (evidence["noise"] == noise.name)]
    used = {row["form"]: row for row in mine.to_dict("records")}
    rows: list[dict[str, object]] = []

    def add(a: str, b: str, method: str, ln_bf: float, se: float) -> None:
        rows.append(factor_row(a, b, noise.name, method, ln_bf, se, noise.caution))

    for a, b in itertools.combinations(forms, 2):
        if a in used and b in used:
            methods = dict.fromkeys([used[a]["method"], used[b]["method"]])
            errors = [used[form]["log_evidence_se"] for form in (a, b)]
            ln_bf = used[a]["log_evidence"] - used[b]["log_evidence"]
            add(a, b, "/".join(methods), ln_bf, math.hypot(*errors))
    return pd.DataFrame(rows, columns=BAYES_FACTOR_COLUMNS)


def summed_bayes_factors(evidence: pd.DataFrame) -> pd.DataFrame:
    """Return the forms' Bayes factors with the error models summed out at equal prior.

    Parameters
    ----------
    evidence : pandas.DataFrame
        As for `mean_evidence`.

    Returns
    -------
    pandas.DataFrame
        Columns of `bayes_factors.csv`; the noise is ``summed out``.
    """
    if used_evidence(evidence)["noise"].nunique() < 2:
        return pd.DataFrame(columns=BAYES_FACTOR_COLUMNS)
    sums = summed_evidence(evidence)
    rows = [
        factor_row(a, b, SUMMED, "sum", first - second, math.hypot(se, other_se), None)
        for (a, (first, se)), (b, (second, other_se)) in itertools.combinations(sums.items(), 2)
    ]
    return pd.DataFrame(rows, columns=BAYES_FACTOR_COLUMNS)


def summed_evidence(evidence: pd.DataFrame) -> dict[str, tuple[float, float]]:
    """Return ln evidence and its error of each form, error models summed out at equal prior.

    Parameters
    ----------
    evidence : pandas.DataFrame
        As for `mean_evidence`.
    """
    used, sums = used_evidence(evidence), {}
    for form, part in used.groupby("form", sort=False):
        value = float(logsumexp(part["log_evidence"]))
        share = np.exp(part["log_evidence"] - value)
        se = float(np.sqrt(((share * part["log_evidence_se"].fillna(0)) ** 2).sum()))
        sums[str(form)] = value - math.log(used["noise"].nunique()), se
    return sums
