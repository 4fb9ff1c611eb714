"""Evidences of a fit by every method that applies, and as a table."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import pandas as pd
from scipy.special import logsumexp

from ridgebayes.evidence.bridge import bridge_evidence
from ridgebayes.evidence.quadrature import quadrature_evidence
from ridgebayes.inference.importance_sampling import importance_posterior
from ridgebayes.inference.log_evidence import LogEvidence, laplace_evidence
from ridgebayes.inference.posterior import Posterior, drawn_exactly
from ridgebayes.inference.power_law_exact import is_conjugate, power_law_evidence
from ridgebayes.model.forms import PowerLaw
from ridgebayes.runtime.randomness import stream

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


def evidences(fit: Posterior, *, n_bridge: int | None = None) -> list[LogEvidence]:
    """Return the log evidence of a fit by every method that applies, bridge first.

    Parameters
    ----------
    fit : Posterior
        Posterior with its full chains.
    n_bridge : int, optional
        Most draws that the bridge takes; as many as an error of 0.002 needs if not given.

    Returns
    -------
    list of LogEvidence
        bridge, quadrature where there are at most four parameters or the form is the power law,
        laplace. Where offsets are drawn beside the parameters, importance and laplace. A power law
        that is drawn exactly has its exact evidence alone. Of a posterior of several modes each is
        of one of them, and its status says so.
    """
    if drawn_exactly(fit.model):
        return [power_law_evidence(fit.model)]
    model, laplace = fit.model, fit.laplace
    if model.is_latent:
        drawn = fit.evidence or importance_posterior(model, laplace, seed=fit.seed)[1]
        return [drawn, laplace_evidence(laplace)]
    is_cheap = model.is_iid_gaussian and len(model.data.textures) <= _MANY
    found = [
        bridge_evidence(
            model.log_density,
            fit.chains,
            laplace,
            rng=stream(fit.seed, "bridge"),
            draws_max=n_bridge or (100_000 if is_cheap else 20_000),  # an error of 0.002 will do
        )
    ]
    if is_conjugate(model):
        found.append(power_law_evidence(model))
    elif model.is_iid_gaussian and not isinstance(model.form, PowerLaw):
        found.append(quadrature_evidence(model.log_density, laplace))
    found.append(laplace_evidence(laplace))
    if laplace.other_modes:
        found = [replace(evidence, status=laplace.other_modes[0]) for evidence in found]
    return found


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
