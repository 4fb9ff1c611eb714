"""Evidences of a fit by every method that applies, and as a table."""

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pandas as pd

from ridgebayes.evidence.bridge import bridge_evidence
from ridgebayes.evidence.quadrature import quadrature_evidence
from ridgebayes.inference.log_evidence import LogEvidence, laplace_evidence
from ridgebayes.inference.posterior import Posterior, drawn_exactly
from ridgebayes.inference.power_law_exact import power_law_evidence
from ridgebayes.model.forms import PowerLaw
from ridgebayes.model.noise import Noise
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
        laplace. A power law of very many textures has its exact evidence alone. Of a posterior of
        several modes each is of one of them, and its status says so.
    """
    if drawn_exactly(fit.model):
        return [power_law_evidence(fit.model)]
    model, laplace = fit.model, fit.laplace
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
    if isinstance(model.form, PowerLaw) and model.is_iid_gaussian:
        found.append(power_law_evidence(model))
    elif model.is_iid_gaussian:
        found.append(quadrature_evidence(model.log_density, laplace))
    found.append(laplace_evidence(laplace))
    if laplace.other_modes:
        found = [replace(evidence, status=laplace.other_modes[0]) for evidence in found]
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
            share = math.exp(e.value - top) / total if chosen else np.nan
            numbers = (e.method, e.value, e.se, chosen, 1 / len(found), share, e.status)
            rows.append((name, noise.name, *numbers))
    return pd.DataFrame(rows, columns=EVIDENCE_COLUMNS)


def used_evidence(evidence: pd.DataFrame) -> pd.DataFrame:
    """Return the evidence that is used of each form under each error model."""
    return evidence[evidence["used"]].drop_duplicates(["form", "noise"])
