"""Calibration: `calibrate` returns a `Fit`, a posterior with its predictions."""

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from ridgebayes import drawing
from ridgebayes._types import Rng, Tabular, __version__
from ridgebayes.cautions import cautions
from ridgebayes.distributions.grammar import priors_to_json
from ridgebayes.errors import InputError, warn_of
from ridgebayes.evidence.walk_pair import walk_pair
from ridgebayes.inference.arviz_groups import all_groups
from ridgebayes.inference.chains import ProgressCallback, SampleSettings
from ridgebayes.inference.checkpoint import Checkpoint
from ridgebayes.inference.diagnostics import arviz_object
from ridgebayes.inference.mixture import PosteriorMixture, fit_mixture
from ridgebayes.inference.netcdf import read_netcdf, write_netcdf
from ridgebayes.inference.posterior import Posterior, walked_posterior
from ridgebayes.inference.presets import STANDARD, Preset
from ridgebayes.model.forms import FORMS, Form
from ridgebayes.model.model import Model
from ridgebayes.model.noise import AUTO, Noise
from ridgebayes.model.observations import nearest_load
from ridgebayes.predict.extrapolation import CalibratedRange
from ridgebayes.predict.predict import Predictive
from ridgebayes.request import PriorsLike, Request, TableLike

if TYPE_CHECKING:  # slow to import
    from matplotlib.axes import Axes

_MAX_ROWS_SHOWN = 500  # in a plot


@dataclass(frozen=True, eq=False, repr=False)
class Fit(Posterior, Predictive, Tabular):
    """Posterior of a form, with its predictions and its file.

    If several error models have weight, it holds a posterior for each, and predictions are
    averaged over them. Draws, diagnostics and files are those of the selected error model.

    Parameters
    ----------
    model : Model
        Sampled model: data, form, error model, priors.
    chains : Chains
        Draws: normal scores of the parameters, then of the offsets shared by rows.
    summary : pandas.DataFrame
        One row per parameter: mean, sd, interval, effective sample sizes, R-hat.
    convergence_failures : tuple of str
        Violated convergence criteria; empty if the fit converged.
    seed : int
        Seed of the run.
    sampler : str, optional
        Sampler of the draws: ``importance`` or ``emcee``.
    evidence : LogEvidence, optional
        Evidence from the same draws; a fit read from a file has none.
    cautions : tuple of str, optional
        Sentences with reasons to doubt the result: units, copies, independence, priors.
    error_model_weights : dict of str to float, optional
        Posterior probability of each error model over which predictions are averaged.
    others : dict of str to Posterior, optional
        Posteriors under the other error models.

    Examples
    --------
    >>> import ridgebayes as rb
    >>> fit = rb.calibrate(rb.paper_sweep(), rb.Hybrid(), noise="iid", rng=1)
    >>> fit.converged, fit.to_dataframe()["parameter"].tolist()
    (True, ['c1', 'c2', 'sigma'])
    >>> list(fit.posteriors), [weight for _, weight in fit.averaged]
    (['iid'], [1.0])
    >>> len(fit.plot().get_xlabel()) > 0, fit.to_mixture(2).names
    (True, ('c1', 'c2', 'sigma'))
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     fit.to_netcdf(f"{folder}/hybrid.nc")
    ...     again = rb.Fit.from_netcdf(f"{folder}/hybrid.nc")
    >>> bool((again.draws == fit.draws).all()), fit.to_arviz()["posterior"]["c1"].dims
    (True, ('chain', 'draw'))
    >>> rb.Fit.of(again.thinned(100), {"iid": 1.0}).noise.name  # of any posterior
    'iid'
    """

    error_model_weights: Mapping[str, float] = field(default_factory=dict)
    others: Mapping[str, Posterior] = field(default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.error_model_weights:
            object.__setattr__(self, "error_model_weights", {self.noise.name: 1.0})

    @classmethod
    def of(
        cls,
        posterior: Posterior,
        weights: Mapping[str, float] | None = None,
        posteriors: Mapping[str, Posterior] | None = None,
    ) -> "Fit":
        """Return a posterior as a fit.

        Parameters
        ----------
        posterior : Posterior
            Posterior, sampled or read from a file.
        weights : mapping of str to float, optional
            Probabilities of the error models to average over; only this error model if not given.
        posteriors : mapping of str to Posterior, optional
            Posteriors under these error models; that of the selected error model is ignored.

        Returns
        -------
        Fit
            Fit with the same draws.
        """
        drawn = {f.name: getattr(posterior, f.name) for f in fields(Posterior) if f.init}
        others = {
            name: other
            for name, other in (posteriors or {}).items()
            if name in (weights or {}) and name != posterior.noise.name
        }
        return cls(**drawn, error_model_weights=weights or {}, others=others)

    @property
    def posteriors(self) -> dict[str, Posterior]:
        """Posterior under each error model that has one, the selected error model first."""
        drawn = {name: other for name, other in self.others.items() if other.noise.name == name}
        return {self.noise.name: self, **drawn}

    @property
    def averaged(self) -> list[tuple[Posterior, float]]:
        """Posteriors over which predictions are averaged, with their weights."""
        parts: dict[int, tuple[Posterior, float]] = {}
        for name, weight in self.error_model_weights.items():
            posterior = self.others.get(name, self)
            if posterior.noise.name == self.noise.name:
                posterior = self
            # Several error models may share one posterior.
            before = parts.get(id(posterior), (posterior, 0.0))[1]
            parts[id(posterior)] = posterior, weight + before
        return list(parts.values())

    def to_dataframe(self) -> pd.DataFrame:
        """Return the summary of the posterior as a table.

        Returns
        -------
        pandas.DataFrame
            A copy of `summary`: one row per parameter, columns parameter, mean, sd, eti_lower,
            eti_upper, prob, ess_bulk, ess_tail, r_hat, mcse_mean.
        """
        return self.summary.copy()

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw the errors of predicted loads, with 90 % bands, over the fitted loads at nu = 0.5.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Axes to draw on; those of a new figure if not given.

        Returns
        -------
        matplotlib.axes.Axes
            Axes drawn on. At most the first 500 rows are shown, a bracket at its load nearest to
            the prediction.

        Raises
        ------
        InputError
            If all rows are counts.
        """
        data = self.model.data
        shown = np.flatnonzero(~data.is_count)[:_MAX_ROWS_SHOWN]
        if not len(shown):
            raise InputError(
                f"{self.form.name}: expected a row with a load to plot, got only counts"
            )
        texture, upper, lower = data.texture[shown], data.log_load[shown], data.log_lower[shown]
        a, b = data.a_over_R[texture], data.b_over_R[texture]
        predicted = self.predict_load(a, b, data.Q[shown]).widened(data.rel_se[shown])
        observed = nearest_load(predicted.median(), np.exp(upper), np.exp(lower))
        frame = predicted.to_dataframe().assign(p_over_E_observed=observed)
        return drawing.records.draw_errors(frame, self.form.name, ax)

    def to_arviz(self) -> Any:
        """Return the thinned draws as an ArviZ object.

        Returns
        -------
        arviz.InferenceData or xarray.DataTree
            InferenceData of ArviZ 0.x, DataTree of 1.x: posterior (chain = ensemble, draw),
            sample_stats, observed_data, constant_data, log_likelihood, log_prior, prior,
            prior_predictive, posterior_predictive. The last three hold 500 draws; very large
            groups are left out.

        Raises
        ------
        InputError
            If the environment variable SOURCE_DATE_EPOCH, used as the date, is not a number.

        Notes
        -----
        If rows share offsets, log_likelihood holds each row's density given the other rows, for
        leave-one-out scores. Its sum is not the joint likelihood, which is log_likelihood_joint of
        sample_stats. If offsets were drawn (Student errors, brackets, counts), log_likelihood is
        conditional on them, and the joint likelihood is not included.
        """
        return arviz_object(all_groups(self))

    def to_mixture(self, n_component: int | None = None) -> PosteriorMixture:
        """Return the posterior of the selected error model as a Gaussian mixture.

        The mixture can serve as a prior elsewhere: it can be written as JSON for PyMC, NumPyro and
        Stan, see docs/reuse.md.

        Parameters
        ----------
        n_component : int, optional
            Number of components, 1 to 8; chosen by the density of left-out draws if not given.

        Returns
        -------
        PosteriorMixture
            Mixture with its distance from the draws, and the calibrated range.

        Raises
        ------
        InputError
            If there are more than 40 parameters, or `n_component` is out of range.
        """
        return fit_mixture(self, CalibratedRange.of(self).to_dict(), n_component)

    def to_netcdf(self, path: str | os.PathLike[str]) -> None:
        """Write the result of `to_arviz`, which this class and ArviZ can read.

        Parameters
        ----------
        path : path
            File to write atomically; an existing file is overwritten.
        """
        write_netcdf(self, path)

    @classmethod
    def from_netcdf(cls, path: str | os.PathLike[str]) -> "Fit":
        """Read a fit written by `to_netcdf`.

        Parameters
        ----------
        path : path
            File.

        Returns
        -------
        Fit
            Fit with thinned chains.

        Raises
        ------
        InputError
            If the file is missing, damaged, or not written by this package.
        """
        return cls.of(read_netcdf(path))


def calibrate(  # noqa: PLR0913  (each parameter is part of the question, and has a default)
    table: TableLike,
    form: Form | str,
    *,
    noise: str | Noise = AUTO,
    priors: PriorsLike | None = None,
    rng: Rng = 0,
    settings: SampleSettings | None = None,
    accuracy: Preset | str = STANDARD,
    progress: ProgressCallback | None = None,
    checkpoint: Path | None = None,
) -> Fit:
    """Sample the posterior of a form's coefficients and error scales given a table.

    Parameters
    ----------
    table : ContactTable, path or pandas.DataFrame
        Table whose rows of role calibration and status ok are fitted.
    form : Form or str
        Contact form, or its name.
    noise : str or Noise, optional
        Error model; ``auto`` weights all suitable error models and averages predictions over them.
    priors : mapping of str to mapping of str to prior, or path, optional
        Replacements for default priors, as for `compare`: by form name, or ``noise``, and parameter
        name, such as ``{"hybrid": {"c2": "normal(0, 0.05)"}, "noise": {"sigma": ...}}``, or the
        path of a file of priors.
    rng : int or numpy.random.Generator, optional
        Seed; the same seed gives the same draws.
    settings : SampleSettings, optional
        Lengths and thresholds of a walk by emcee. If given, the selected error model is sampled by
        the walk, otherwise by importance sampling.
    accuracy : str or Preset, optional
        Target errors of draws and evidences: ``quick``, ``standard`` or ``reference``.
    progress : callable, optional
        Called with a line of text from time to time.
    checkpoint : Path, optional
        HDF5 file in which growing chains are saved. If it exists, sampling continues from
        it, with the same result as without interruption.

    Returns
    -------
    Fit
        Fit with draws, diagnostics, and violated convergence criteria. Failure to converge is
        recorded, not raised.

    Raises
    ------
    InputError
        If no row can be fitted, the form would be fitted to rows computed from its equation, or
        `checkpoint` holds chains of another model.
    ComputationError
        If the posterior has no interior mode.

    Warns
    -----
    CautionWarning
        If the fit has `cautions`, once for each.

    Notes
    -----
    *Cost.* A tenth of a CPU second for an error model of exact rows with normal errors, one or two
    for others; some seconds if all error models are weighted.

    Examples
    --------
    >>> import ridgebayes as rb
    >>> fit = rb.calibrate(rb.paper_sweep(), rb.Hybrid(), noise="iid", rng=1)
    >>> fit.converged
    True
    >>> [round(mean, 2) for mean in fit.summary["mean"]]
    [1.34, 0.02, 0.03]
    >>> sure = {"hybrid": {"c2": "normal(0, 0.001)"}}
    >>> fit = rb.calibrate(rb.paper_sweep(), "hybrid", noise="iid", priors=sure)
    >>> round(float(fit.summary["sd"][1]), 3)
    0.001
    """
    request = Request.of(
        table, form, noise=noise, priors=priors, accuracy=accuracy, rng=rng, settings=settings
    )
    weighed = replace(request, progress=progress).weigh()
    (name,), selected = (form.name for form in request.forms), weighed.selected()
    n_kept = request.accuracy.n_kept
    posteriors = weighed.posteriors([name], selected.name, n_kept)[name]
    posterior = posteriors[selected.name]
    if settings is not None:
        pair = weighed.pairs[name, selected.name]
        drawn = weighed.weighed[pair.key].drawn
        assert drawn is not None  # it is selected by its evidence
        digest = request.table.calibration.digest()
        file = chain_checkpoint(checkpoint, digest, posterior.model, request.seed, settings)
        walked, _ = walk_pair(pair, drawn, settings, progress=progress, checkpoint=file)
        posterior = walked_posterior(posterior.model, walked, pair.own_seed, drawn.evidence)
    noises = [noise.name for noise in request.noises]
    sentences = cautions(request.table, noises, selected, {name: posterior})[name]
    warn_of(sentences)
    return Fit.of(replace(posterior, cautions=sentences), weighed.weights(name), posteriors)


def chain_checkpoint(
    path: Path | None, table_digest: str, model: Model, seed: int, settings: SampleSettings | None
) -> Checkpoint | None:
    """Return the checkpoint of a chain file, tied to everything that determines the chains."""
    if path is None:
        return None
    fingerprint = {
        "package version": __version__,
        "table": table_digest,
        # A user's form may contain additional numbers.
        "form": model.form.name if type(model.form) in FORMS.values() else repr(model.form),
        "error model": repr(model.noise),
        "priors": priors_to_json(model.priors),
        "seed": str(seed),
        "settings": str(settings or SampleSettings()),
    }
    return Checkpoint(path, fingerprint)
