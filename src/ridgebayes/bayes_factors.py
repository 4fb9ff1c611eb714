"""Evidences and Bayes factors of several fits as tables, and in words."""

import itertools
import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pandas as pd

from ridgebayes.evidence import (
    LogEvidence,
    bridge_evidence,
    laplace_evidence,
    power_law_evidence,
    quadrature_evidence,
    savage_dickey,
)
from ridgebayes.fit import Fit, drawn_exactly
from ridgebayes.forms import PowerLaw
from ridgebayes.laplace import fit_laplace, several_modes
from ridgebayes.noise import Noise
from ridgebayes.randomness import stream

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
_MANY = 2_000  # textures, of which a density takes milliseconds
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


def evidences(fit: Fit, *, n_bridge: int | None = None) -> list[LogEvidence]:
    """Return the log evidence of a fit by every method that applies, bridge first.

    Parameters
    ----------
    fit : Fit
        Posterior with its full chains.
    n_bridge : int, optional
        Most draws that the bridge takes; as many as an error of 0.002 needs if not given.

    Returns
    -------
    list of LogEvidence
        bridge, quadrature where there are at most four parameters or the form is the power law,
        laplace. A power law of very many textures has its exact evidence alone. Of a posterior of
        several modes each is of one of them, and its status says so.
    """
    if drawn_exactly(fit.model):
        return [power_law_evidence(fit.model)]
    model, laplace = fit.model, fit_laplace(fit.model)
    is_cheap = model.is_plain and len(model.data.textures) <= _MANY
    found = [
        bridge_evidence(
            model.log_density,
            fit.chains,
            laplace,
            rng=stream(fit.seed, "bridge"),
            draws_max=n_bridge or (100_000 if is_cheap else 20_000),  # an error of 0.002 will do
        )
    ]
    if isinstance(model.form, PowerLaw) and model.is_plain:
        found.append(power_law_evidence(model))
    elif model.is_plain:
        found.append(quadrature_evidence(model.log_density, laplace))
    found.append(laplace_evidence(laplace))
    if modes := several_modes(model, laplace):
        found = [replace(evidence, status=modes[0]) for evidence in found]
    return found


def evidence_table(found: Mapping[str, list[LogEvidence]], noise: Noise) -> pd.DataFrame:
    """Return evidences by form and method, and model probabilities at equal prior.

    The first method whose status is ok is the one that Bayes factors and probabilities use.
    """
    used = {name: next((e for e in methods if e.ok), methods[0]) for name, methods in found.items()}
    usable = {name: e.value for name, e in used.items() if e.ok}
    top = max(usable.values(), default=0.0)
    total = sum(math.exp(value - top) for value in usable.values())
    rows = []
    for name, methods in found.items():
        for e in methods:
            chosen = e is used[name] and e.ok
            rows.append(
                {
                    "form": name,
                    "noise": noise.name,
                    "method": e.method,
                    "log_evidence": e.value,
                    "log_evidence_se": e.se,
                    "used": chosen,
                    "prior_probability": 1 / len(found),
                    "model_probability": math.exp(e.value - top) / total if chosen else np.nan,
                    "status": e.status,
                }
            )
    return pd.DataFrame(rows)


def reading(ln_bf: float, ln_bf_se: float, form_a: str, form_b: str, caution: str | None) -> str:
    """Put a log Bayes factor in words, on the scale of Kass and Raftery.

    Parameters
    ----------
    ln_bf, ln_bf_se : float
        ln Z_a - ln Z_b and its standard error.
    form_a, form_b : str
        Names.
    caution : str or None
        What is added of the error model.

    Returns
    -------
    str
        ``undecided`` where abs(ln BF) is under 1 or under two standard errors.

    References
    ----------
    Kass & Raftery (1995), doi:10.1080/01621459.1995.10476572, section 3.2: 2 ln BF of 2, 6, 10.

    Examples
    --------
    >>> reading(-4.5, 0.001, "modified", "hybrid", None)
    'strong for hybrid (Kass & Raftery)'
    """
    size = abs(ln_bf)
    if not size >= 1 or size < 2 * ln_bf_se:
        words = "undecided"
    else:
        word = "positive" if size < 3 else "strong" if size < 5 else "very strong"
        words = f"{word} for {form_a if ln_bf > 0 else form_b} (Kass & Raftery)"
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


def bayes_factor_table(
    evidence: pd.DataFrame, fits: Mapping[str, Fit], noise: Noise
) -> pd.DataFrame:
    """Return the Bayes factor of each pair of forms, and Savage-Dickey's for Modified in Hybrid."""
    mine = evidence[evidence["used"] & (evidence["noise"] == noise.name)]
    used = {row["form"]: row for row in mine.to_dict("records")}
    rows: list[dict[str, object]] = []

    def add(a: str, b: str, method: str, ln_bf: float, se: float) -> None:
        rows.append(factor_row(a, b, noise.name, method, ln_bf, se, noise.caution))

    for a, b in itertools.combinations(fits, 2):
        if a in used and b in used:
            methods = dict.fromkeys([used[a]["method"], used[b]["method"]])
            # A method without a Monte Carlo error has none to add.
            errors = [np.nan_to_num(used[form]["log_evidence_se"]) for form in (a, b)]
            ln_bf = used[a]["log_evidence"] - used[b]["log_evidence"]
            add(a, b, "/".join(methods), ln_bf, math.hypot(*errors))
    if {"modified", "hybrid"} <= set(fits):
        ratio = savage_dickey(fits["hybrid"])
        if ratio.ok:
            add("modified", "hybrid", ratio.method, -ratio.value, ratio.se)
    return pd.DataFrame(rows, columns=BAYES_FACTOR_COLUMNS)
