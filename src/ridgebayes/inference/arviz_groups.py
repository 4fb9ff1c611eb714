"""Labelled datasets of a fit, with the names and attributes that arviz expects."""

import os
from collections.abc import Mapping
from datetime import UTC, datetime
from importlib.metadata import version
from typing import TYPE_CHECKING

import numpy as np

from ridgebayes._types import FloatArray, __version__
from ridgebayes.errors import ComputationError, InputError
from ridgebayes.inference.chains import Chains
from ridgebayes.inference.posterior import Posterior
from ridgebayes.model.forms import PowerLaw
from ridgebayes.model.model import Model
from ridgebayes.model.replicated import prior_draws, simulate_log_loads
from ridgebayes.runtime.randomness import stream

if TYPE_CHECKING:
    import xarray as xr

N_PREDICTIVE = 500  # draws of the prior and of the two predictive distributions

SAMPLE = ("chain", "draw")
Variables = dict[str, tuple[tuple[str, ...], np.ndarray]]


def all_groups(fit: Posterior) -> dict[str, "xr.Dataset"]:
    """Return a fit as xarray datasets for arviz.

    Parameters
    ----------
    fit : Posterior
        Posterior.

    Returns
    -------
    dict of str to xarray.Dataset
        Datasets of `labelled_groups`, each with the attributes that arviz expects.
    """
    return datasets(labelled_groups(fit), attributes(fit))


def datasets(
    groups: Mapping[str, Variables], attrs: Mapping[str, str] | None = None
) -> dict[str, "xr.Dataset"]:
    """Return groups of variables as datasets; a variable named like its dimension labels it."""
    import xarray as xr  # loads slowly

    return {name: xr.Dataset(group, attrs=attrs) for name, group in groups.items()}


def labelled_groups(fit: Posterior, *, complete: bool = True) -> dict[str, Variables]:
    """Return the thinned posterior as groups of variables with arviz's names.

    Parameters
    ----------
    fit : Posterior
        Posterior.
    complete : bool, optional
        Whether to add the groups that only arviz uses.

    Returns
    -------
    dict of str to dict of str to tuple
        Dimensions and values of each variable. The groups are posterior (dimensions chain and
        draw; K also has texture), sample_stats, observed_data, constant_data and, unless there are
        very many rows, log_likelihood. A chain is an ensemble; its draws are ordered by step, then
        by walker. With `complete` the groups also include log_prior (per parameter; the log priors
        of K are summed over textures), prior and, unless there are very many rows,
        prior_predictive and posterior_predictive: at most 500 draws of the rows' log loads, with
        new draws of the shared offsets. These groups are omitted if hardly any prior draw gives a
        load.
    """
    groups = _variables(fit)
    if complete:
        groups |= {"log_prior": _log_prior(fit), **_predictive(fit, "log_likelihood" in groups)}
    return {name: _labelled(fit, group) for name, group in groups.items()}


def _variables(fit: Posterior) -> dict[str, Variables]:
    chains, data = fit.kept_chains, fit.model.data
    stats = sample_stats(chains)
    u, log_density = stats["u"][1], stats["lp"][1]
    theta = fit.model.to_theta(u)
    groups: dict[str, Variables] = {
        "posterior": _parameters(fit.model, theta),
        "sample_stats": stats,
        "observed_data": {"log_load": (("row",), data.log_load)},
        "constant_data": {
            "Q": (("row",), data.Q),
            "texture_index": (("row",), data.texture),
            "rel_se": (("row",), data.rel_se),
            "log_lower": (("row",), data.log_lower),
            "is_count": (("row",), data.is_count.astype(np.int8)),
            "a_over_R": (("texture",), data.a_over_R),
            "b_over_R": (("texture",), data.b_over_R),
        },
    }
    if data.n_series > 1:
        groups["constant_data"]["series_index"] = (("row",), data.series)
    rows = fit.rows_log_likelihood()
    if rows is not None:
        rows = rows.reshape(*log_density.shape, len(data))
        groups["log_likelihood"] = {"log_load": ((*SAMPLE, "row"), rows)}
        if fit.model.offsets.n_level:
            # Each row's density is conditional on other rows or on offsets, so that the sum over
            # rows is not the joint log-likelihood, which is stored here.
            joint = fit.log_likelihood_of_rows.reshape(log_density.shape)
            groups["sample_stats"]["log_likelihood_joint"] = (SAMPLE, joint)
    return groups


def sample_stats(chains: Chains) -> Variables:
    """Return the variables of the group sample_stats."""
    n_ensemble, n_step, n_walker, n_coordinate = chains.u.shape
    flat = (n_ensemble, n_step * n_walker)
    return {
        "lp": (SAMPLE, chains.log_density.reshape(flat)),
        # The normal scores are stored too, so that a fit read back is bitwise identical.
        "u": ((*SAMPLE, "coordinate"), chains.u.reshape(*flat, n_coordinate)),
        "acceptance_rate": (("chain",), chains.acceptance),
        "tau": (("quantity",), chains.tau),
    }


def _parameters(model: Model, theta: FloatArray) -> Variables:
    """Return draws of shape (chain, draw, n_parameter) as one variable per parameter."""
    names = model.parameter_names
    if not isinstance(model.form, PowerLaw):
        return {name: (SAMPLE, theta[..., i]) for i, name in enumerate(names)}
    k = model.n_coefficient
    noise = {name: (SAMPLE, theta[..., i]) for i, name in enumerate(names) if i >= k}
    return {"K": ((*SAMPLE, "texture"), theta[..., :k]), **noise}


def _log_prior(fit: Posterior) -> Variables:
    """Return the log prior density of each parameter at the draws."""
    model = fit.model
    log_priors: dict[str, FloatArray] = {}
    theta = fit.draws.reshape(len(fit.chains.u), -1, model.n_parameter)
    for i, (name, prior) in enumerate(model.priors.items()):
        is_K = isinstance(model.form, PowerLaw) and i < model.n_coefficient
        key, value = "K" if is_K else name, prior.log_pdf(theta[..., i])
        log_priors[key] = log_priors[key] + value if key in log_priors else value
    return {name: (SAMPLE, value) for name, value in log_priors.items()}


def _predictive(fit: Posterior, with_rows: bool) -> dict[str, Variables]:
    """Return prior and, if asked for, prior_predictive and posterior_predictive."""
    model, rng = fit.model, stream(fit.seed, "predictive")
    try:
        prior = prior_draws(model, rng, N_PREDICTIVE)[None]
    except ComputationError:
        return {}
    groups = {"prior": _parameters(model, prior)}
    if with_rows:
        n_chain, n_walk = len(fit.chains.u), len(fit.draws) // len(fit.chains.u)
        draw = np.linspace(0, n_walk - 1, min(N_PREDICTIVE // n_chain, n_walk)).astype(np.int64)
        posterior = fit.draws.reshape(n_chain, n_walk, -1)[:, draw]
        for name, theta in (("prior", prior), ("posterior", posterior)):
            loads = simulate_log_loads(model, theta, rng)[0]
            groups[f"{name}_predictive"] = {"log_load": ((*SAMPLE, "row"), loads)}
        groups["posterior_predictive"]["draw"] = (("draw",), draw)
    return groups


def _labelled(fit: Posterior, group: Variables) -> Variables:
    """Return a group with label variables for its rows, textures, chains and draws."""
    sizes = {
        name: n
        for dims, cells in group.values()
        for name, n in zip(dims, np.shape(cells), strict=True)
    }
    labels = {name: np.arange(sizes[name]) for name in (*SAMPLE, "row") if name in sizes}
    if "texture" in sizes:
        labels["texture"] = np.array(fit.model.data.labels)
    return {name: ((name,), cells) for name, cells in labels.items()} | group


def attributes(fit: Posterior) -> dict[str, str]:
    """Return the attributes of arviz that state the origin of the data.

    The creation date is SOURCE_DATE_EPOCH, or 1970, so that equal runs write equal files.
    """
    seconds = os.environ.get("SOURCE_DATE_EPOCH", "0")
    try:
        created = datetime.fromtimestamp(int(seconds), UTC)
    except (ValueError, OverflowError, OSError):
        rule = "expected whole seconds since 1970"
        raise InputError(f"SOURCE_DATE_EPOCH: {rule}, got {seconds!r}") from None
    is_emcee = fit.sampler == "emcee"
    return {
        "created_at": created.isoformat(),
        "creation_library": "ridgebayes",
        "creation_library_version": __version__,
        "creation_library_language": "Python",
        "inference_library": "emcee" if is_emcee else "ridgebayes",
        "inference_library_version": version("emcee") if is_emcee else __version__,
    }
