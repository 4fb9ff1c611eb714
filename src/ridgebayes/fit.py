"""`calibrate`: a table and a form in, a posterior out; and `Fit`, the record that holds it."""

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from ridgebayes._types import FloatArray, Rng
from ridgebayes.checkpoint import Checkpoint
from ridgebayes.diagnostics import shortcomings, summarise
from ridgebayes.errors import InputError
from ridgebayes.forms import FORMS, Form, PowerLaw
from ridgebayes.laplace import fit_laplace, several_modes
from ridgebayes.likelihood import Model
from ridgebayes.noise import Noise
from ridgebayes.observations import Observations
from ridgebayes.priors import Prior
from ridgebayes.randomness import seed_of
from ridgebayes.sample import Chains, SampleSettings, Tell, sample, walkers_for
from ridgebayes.table import ContactTable

if TYPE_CHECKING:
    from ridgebayes.loads import LoadDistribution
    from ridgebayes.qdistribution import QDistribution

N_TEXTURE_WALKED = 40  # a power law of more textures is drawn from exactly, without a walk
N_KEPT = 10_240  # draws that files and predictions keep: whole steps, evenly thinned


@dataclass(frozen=True, eq=False)
class Fit:
    """The posterior of one form under one error model.

    Parameters
    ----------
    model : Model
        What was sampled: data, form, error model, priors.
    chains : Chains
        Draws in unconstrained coordinates.
    summary : pandas.DataFrame
        One row per parameter, as `ridgebayes.diagnostics.summarise` returns it.
    missing : tuple of str
        What the fit lacks of convergence; empty if it converged.
    seed : int
        Seed of the run.
    """

    model: Model
    chains: Chains
    summary: pd.DataFrame
    missing: tuple[str, ...]
    seed: int
    _kept: FloatArray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_kept", self.model.to_theta(self.kept_chains.u))

    def __repr__(self) -> str:
        state = "converged" if self.converged else f"NOT converged: {self.missing[0]}"
        values = ", ".join(
            f"{row.parameter} = {row.mean:.4g} ± {row.sd:.2g}" for row in self.summary.itertuples()
        )
        return f"Fit({self.form.name}, {self.noise.name}: {values}; {state})"

    @property
    def form(self) -> Form:
        """The form, bound to the calibrated textures."""
        return self.model.form

    @property
    def noise(self) -> Noise:
        """The error model."""
        return self.model.noise

    @property
    def converged(self) -> bool:
        """Whether every convergence rule was met."""
        return not self.missing

    @property
    def kept_chains(self) -> Chains:
        """The chains thinned to at most `N_KEPT` draws, whole steps at a time."""
        n_ensemble, n_step, n_walker, _ = self.chains.u.shape
        n_keep = max(N_KEPT // (n_ensemble * n_walker), 1)
        steps = np.unique(np.linspace(0, n_step - 1, min(n_keep, n_step)).astype(int))
        return Chains(
            self.chains.u[:, steps],
            self.chains.log_density[:, steps],
            self.chains.acceptance,
            self.chains.tau,
            self.chains.missing,
        )

    @property
    def draws(self) -> FloatArray:
        """Thinned draws of the parameters, shape (n_draw, n_parameter)."""
        return self._kept.reshape(-1, self.model.n_parameter)

    @property
    def coordinates(self) -> FloatArray:
        """The same draws in unconstrained coordinates, shape (n_draw, n_coordinate)."""
        return self.kept_chains.u.reshape(-1, self.model.n_coordinate)

    def predict(
        self,
        a_over_R: float | FloatArray,
        b_over_R: float | FloatArray,
        p_over_E: float | FloatArray,
        *,
        nu: float | FloatArray = 0.5,
        kind: str = "simulation",
    ) -> "QDistribution":
        """Return the posterior predictive of Q; see `ridgebayes.predict.predict_q`."""
        from ridgebayes.predict import predict_q

        return predict_q(self, a_over_R, b_over_R, p_over_E, nu=nu, kind=kind)

    def predict_load(
        self,
        a_over_R: float | FloatArray,
        b_over_R: float | FloatArray,
        Q: int | FloatArray,
        *,
        nu: float = 0.5,
        kind: str = "simulation",
    ) -> "LoadDistribution":
        """Return the distribution of the load that reaches Q; see `predict_load`."""
        from ridgebayes.predict import predict_load

        return predict_load(self, a_over_R, b_over_R, Q, nu=nu, kind=kind)

    def to_arviz(self) -> Any:
        """Return the thinned draws as arviz's container: InferenceData (0.x) or DataTree (1.x)."""
        from ridgebayes.diagnostics import arviz_object
        from ridgebayes.labelled import groups_of

        return arviz_object(groups_of(self))

    def to_netcdf(self, path: str | os.PathLike[str]) -> None:
        """Write thinned draws, log-likelihood, data, diagnostics; both arviz lines open it."""
        from ridgebayes.labelled import write_netcdf

        write_netcdf(self, path)

    @classmethod
    def from_netcdf(cls, path: str | os.PathLike[str]) -> "Fit":
        """Read what `to_netcdf` wrote; its chains are the thinned ones."""
        from ridgebayes.labelled import read_netcdf

        return read_netcdf(path)


def calibrate(
    table: ContactTable,
    form: Form,
    *,
    noise: str | Noise = "iid",
    priors: Mapping[str, Prior] | None = None,
    rng: Rng = 0,
    settings: SampleSettings | None = None,
    progress: Tell | None = None,
    checkpoint: Path | None = None,
) -> Fit:
    """Sample the posterior of a form's coefficients and error scale given a table.

    Parameters
    ----------
    table : ContactTable
        Rows of role calibration and status ok are fitted.
    form : Form
        Contact form.
    noise : str or Noise, optional
        Error model.
    priors : mapping of str to Prior, optional
        Replacements for default priors, by parameter name.
    rng : int or numpy.random.Generator, optional
        Seed; the same seed gives the same draws.
    settings : SampleSettings, optional
        Lengths and thresholds of sampling.
    progress : callable, optional
        Called with a line of text now and then.
    checkpoint : Path, optional
        HDF5 file that the chains are kept in as they grow; if it is there already, sampling goes
        on from it, and ends as if it had never stopped.

    Returns
    -------
    Fit
        Draws, diagnostics, and what is missing if it did not converge: failure to converge is
        told in the record, not raised.

    Raises
    ------
    InputError
        If no row can be fitted, the form would be fitted to rows that its own equation made, or
        `checkpoint` holds chains of something else.
    ComputationError
        If the posterior has no interior mode.

    Notes
    -----
    *Cost.* About half a CPU second for the paper's sweep, whatever the number of rows.

    Examples
    --------
    >>> import ridgebayes as rb
    >>> fit = rb.calibrate(rb.paper_sweep(), rb.Hybrid(), rng=1)
    >>> fit.converged
    True
    >>> [round(mean, 2) for mean in fit.summary["mean"]]
    [1.34, 0.02, 0.03]
    """
    model = Model(Observations.from_table(table), form, as_noise(noise), priors)
    refuse_circular(table, form)
    seed = seed_of(rng)
    return fit_model(
        model,
        seed=seed,
        settings=settings,
        progress=progress,
        checkpoint=_checkpoint(checkpoint, table, model, seed, settings),
    )


def fit_model(
    model: Model,
    *,
    seed: int,
    settings: SampleSettings | None = None,
    progress: Tell | None = None,
    checkpoint: Checkpoint | None = None,
) -> Fit:
    """Sample a posterior: what `calibrate` does once it has made a model of its table.

    Parameters
    ----------
    model : Model
        Posterior.
    seed : int
        Seed.
    settings : SampleSettings, optional
        Lengths and thresholds of sampling.
    progress : callable, optional
        Called with a line of text now and then.
    checkpoint : Checkpoint, optional
        Where the chains are kept as they grow.

    Returns
    -------
    Fit
        As `calibrate` returns it.

    Raises
    ------
    ComputationError
        If the posterior has no interior mode.
    """
    if drawn_exactly(model):
        from ridgebayes.exact import sample_power_law

        chains = sample_power_law(model, seed=seed)
    else:
        settings = settings or SampleSettings()
        if settings.n_walker is None:
            n_walker = walkers_for(len(model.data.textures), model.is_plain)
            settings = replace(settings, n_walker=n_walker)
        laplace = fit_laplace(model)
        chains = sample(
            model.log_density,
            laplace,
            seed=seed,
            names=model.coordinate_names,
            settings=settings,
            progress=progress,
            checkpoint=checkpoint,
        )
        chains = replace(chains, missing=chains.missing + several_modes(model, laplace))
    summary = summarise(model.to_theta(chains.u), model.parameter_names)
    return Fit(model, chains, summary, chains.missing + shortcomings(summary), seed)


def _checkpoint(
    path: Path | None,
    table: ContactTable,
    model: Model,
    seed: int,
    settings: SampleSettings | None,
) -> Checkpoint | None:
    """Tie a chain file to all that decides what the chains are."""
    if path is None:
        return None
    from ridgebayes import __version__

    fingerprint = {
        "package version": __version__,
        "table": table.calibration.digest(),
        # A form of the user's own may hold numbers of its own.
        "form": model.form.name if type(model.form) in FORMS.values() else repr(model.form),
        "error model": model.noise.name,
        "priors": priors_to_json(model.priors),
        "seed": str(seed),
        "settings": str(settings or SampleSettings()),
    }
    return Checkpoint(path, fingerprint)


def drawn_exactly(model: Model) -> bool:
    """Return whether a posterior is drawn from exactly: a power law of very many textures."""
    many = isinstance(model.form, PowerLaw) and len(model.form.textures) > N_TEXTURE_WALKED
    return many and model.is_plain


def as_noise(noise: str | Noise) -> Noise:
    """Return an error model from its name, or the model itself."""
    return Noise.named(noise) if isinstance(noise, str) else noise


def refuse_circular(table: ContactTable, form: Form) -> None:
    """Raise InputError if the form would be fitted to rows that its own equation made."""
    if form.name != "half-plane":
        return
    own = int((table.calibration.column("solver") == "half-plane").sum())
    if own:
        raise InputError(
            f"{table.where}: {own} calibration rows have solver 'half-plane'; rule: the half-plane "
            "form is not compared on rows that its own equation generated, that would be circular"
        )


def priors_from_json(text: str) -> dict[str, Prior]:
    """Return priors from the JSON text that `priors_to_json` wrote."""
    kinds = {kind.kind: kind for kind in Prior.__subclasses__()}
    return {name: kinds[fields.pop("kind")](**fields) for name, fields in json.loads(text).items()}


def priors_to_json(priors: Mapping[str, Prior]) -> str:
    """Return priors as JSON text."""
    return json.dumps({name: prior.describe() for name, prior in priors.items()})
