"""`calibrate_friction`: fit the parameters of a friction model to measured friction."""

import json
import os
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from ridgebayes._types import FloatArray, Json, Rng, Tabular, __version__
from ridgebayes.comparison.comparison import Comparison
from ridgebayes.contact.hertz import half_width
from ridgebayes.distributions.distribution import Distribution
from ridgebayes.distributions.grammar import from_dict, to_dict
from ridgebayes.errors import InputError
from ridgebayes.friction.bands import FrictionBands, FrictionInputs, predicted
from ridgebayes.friction.density import FrictionDensity, FrictionRows
from ridgebayes.friction.friction_model import FrictionModel
from ridgebayes.friction.inputs import friction_inputs
from ridgebayes.friction.table import FrictionTable, read_friction_table
from ridgebayes.friction.terms import PARAMETERS, terms
from ridgebayes.inference.arviz_groups import SAMPLE, Variables, datasets, sample_stats
from ridgebayes.inference.chains import N_KEPT, Chains
from ridgebayes.inference.diagnostics import (
    arviz_object,
    failed_diagnostics,
    summarise,
    values_text,
)
from ridgebayes.inference.importance import Effort, at_least, importance_sample
from ridgebayes.inference.log_evidence import LogEvidence
from ridgebayes.inference.netcdf import Stored, chains_of, read_tree, write_groups
from ridgebayes.results import Fit
from ridgebayes.runtime.randomness import seed_of, stream
from ridgebayes.scene.scene import Scene

_N_INPUT = 512  # draws of the contact of each texture
_MAX_DRAWS = 1_024  # effort stops doubling here if importance weights fail a check
_MIN_DEVIATION = 1e-3  # components with smaller relative deviations of the contact are omitted


@dataclass(frozen=True, eq=False, repr=False)
class FrictionFit(Tabular):
    """Posterior of the parameters of a friction model.

    Parameters
    ----------
    model : FrictionModel
        Model with its priors.
    chains : Chains
        Thinned draws, as normal scores of the unknown parameters.
    summary : pandas.DataFrame
        One row per parameter: mean, sd, interval, effective sample sizes, R-hat.
    convergence_failures : tuple of str
        Convergence rules that were not met; empty if sampling converged.
    evidence : LogEvidence
        Natural log evidence of ln mu, by importance sampling.
    rows : pandas.DataFrame
        The table with its held-out rows, and mu_median, mu_lower and mu_upper: 90 % bands of a
        measurement with the row's standard error on a new subject, session and rig.
    seed : int
        Seed of the run.
    table_digest : str
        Digest of the friction table.

    Examples
    --------
    >>> import pandas as pd
    >>> import ridgebayes as rb
    >>> rows = {"a_over_R": None, "b_over_R": None, "p_over_E": [0.004, 0.008], "mu": [1.3, 0.9]}
    >>> known = rb.FrictionModel(kappa=0, area_factor=0.8, beta=0.24, tau_session=0, tau_rig=0)
    >>> fit = rb.calibrate_friction(pd.DataFrame(rows), None, known, rng=1)
    >>> fit.converged, fit.to_dataframe()["parameter"].tolist(), fit.theta.shape[1]
    (True, ['tau0', 'tau_subject', 'sigma'], 9)
    >>> contact = rb.calibrate(rb.paper_sweep(), rb.Hybrid(), noise="iid", rng=1)
    >>> drawn = rb.friction_inputs(contact, rb.Scene.of([(0.022, 0.02)]), [0.009], n=100, rng=1)
    >>> len(fit.predict(drawn, rng=1).to_dataframe())
    1
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     fit.to_netcdf(f"{folder}/friction.nc")
    ...     again = rb.FrictionFit.from_netcdf(f"{folder}/friction.nc")
    >>> again.theta.shape == fit.theta.shape, again.to_arviz()["posterior"]["tau0"].dims
    (True, ('chain', 'draw'))
    """

    model: FrictionModel
    chains: Chains
    summary: pd.DataFrame
    convergence_failures: tuple[str, ...]
    evidence: LogEvidence
    rows: pd.DataFrame
    seed: int
    table_digest: str

    @property
    def converged(self) -> bool:
        """Whether all convergence rules were met."""
        return not self.convergence_failures

    @property
    def theta(self) -> FloatArray:
        """Draws of all nine parameters, with known values, shape (n_draw, 9)."""
        return self.model.theta(self.chains.u.reshape(-1, self.chains.u.shape[-1]))

    def to_dataframe(self) -> pd.DataFrame:
        """Return the summary of the posterior as a table.

        Returns
        -------
        pandas.DataFrame
            A copy of `summary`.
        """
        return self.summary.copy()

    def __repr__(self) -> str:
        state = "converged" if self.converged else f"NOT converged: {self.convergence_failures[0]}"
        return f"FrictionFit({values_text(self.summary)}; {state})"

    def predict(self, inputs: xr.Dataset, *, prob: float = 0.9, rng: Rng = 0) -> FrictionBands:
        """Predict a further measurement on a new subject, session and rig.

        Parameters
        ----------
        inputs : xarray.Dataset
            Draws of `friction_inputs`, with edges unless the model's kappa is 0.
        prob : float, optional
            Probability inside the bands.
        rng : int or numpy.random.Generator, optional
            Seed; the same seed gives the same bands.

        Returns
        -------
        FrictionBands
            Bands, and the shares of terms and inputs in their variance. Calibrated parameters
            depend on each other and share one index.

        Raises
        ------
        InputError
            If a variable is missing, or ridges are round.
        """
        theta = self.theta
        return predicted(
            FrictionInputs.of(inputs, edges=self.model.kappa != 0),
            lambda random, n: theta[random.integers(len(theta), size=n)],
            {"parameters": range(len(PARAMETERS))},
            seed=seed_of(rng),
            prob=prob,
        )

    def to_arviz(self) -> Any:
        """Return the draws in arviz's container.

        Returns
        -------
        arviz.InferenceData or xarray.DataTree
            InferenceData of arviz 0.x, DataTree of 1.x: posterior (chain = ensemble, draw),
            sample_stats, observed_data (mu), constant_data (the other columns of `rows`).
        """
        return arviz_object(datasets(self._groups()))

    def _groups(self) -> dict[str, Variables]:
        stats = sample_stats(self.chains)
        theta = self.model.theta(stats["u"][1])
        drawn = {name: theta[..., PARAMETERS.index(name)] for name in self.model.unknown}
        rows: Variables = {str(name): (("row",), self.rows[name].to_numpy()) for name in self.rows}
        return {
            "posterior": {name: (SAMPLE, draws) for name, draws in drawn.items()},
            "sample_stats": stats,
            "observed_data": {"mu": rows.pop("mu")},
            "constant_data": rows,
        }

    def to_netcdf(self, path: str | os.PathLike[str]) -> None:
        """Write the fit as a NetCDF file, which arviz also opens.

        Parameters
        ----------
        path : path
            File to write, atomically. An existing file is overwritten.
        """
        attrs = {
            "ridgebayes_version": __version__,
            "friction_model": json.dumps(_to_json(self.model)),
            "summary": self.summary.to_json(orient="records", double_precision=15),
            "missing": json.dumps(self.convergence_failures),
            "stopping_rule_missing": json.dumps(self.chains.convergence_failures),
            "evidence": json.dumps(asdict(self.evidence)),
            "columns": json.dumps(list(self.rows)),
            "seed": str(self.seed),
            "table_digest": self.table_digest,
            "n_walker": self.chains.u.shape[2],
        }
        write_groups(self._groups(), path, attrs)

    @classmethod
    def from_netcdf(cls, path: str | os.PathLike[str]) -> "FrictionFit":
        """Read a file written by `to_netcdf`.

        Parameters
        ----------
        path : path
            File to read.

        Returns
        -------
        FrictionFit

        Raises
        ------
        InputError
            If the file is missing, damaged, or not written by this package.
        """
        return read_tree(path, _read_fit)


def calibrate_friction(
    table: FrictionTable | pd.DataFrame | str | os.PathLike[str],
    inputs: Fit | Comparison | None,
    model: FrictionModel | None = None,
    *,
    nu: float = 0.5,
    rng: Rng = 0,
) -> FrictionFit:
    """Sample the posterior of friction parameters given measured friction.

    Parameters
    ----------
    table : FrictionTable, path or pandas.DataFrame
        Measurements. Rows of role ``calibration`` are fitted; all rows are predicted.
    inputs : Fit, Comparison or None
        Posterior from which `friction_inputs` draws the contact of rows on ridges; None if all
        surfaces are smooth.
    model : FrictionModel, optional
        Priors, and known parameters.
    nu : float, optional
        Poisson's ratio of the body.
    rng : int or numpy.random.Generator, optional
        Seed; the same seed gives the same draws.

    Returns
    -------
    FrictionFit
        Draws, diagnostics, evidence, and the convergence rules that were not met.

    Raises
    ------
    InputError
        If a cell of the table breaks a rule, there are no rows to fit, no parameter is unknown, or
        rows on ridges have no `inputs`.

    Notes
    -----
    ln mu is normal about the model's value. Effects of subjects, sessions of a subject and rigs are
    integrated out. The uncertainty of a row's contact is added to its error, to first order. Rows
    without a label share one subject, session or rig.

    *Cost.* A few seconds for a hundred rows of a few textures.

    Examples
    --------
    >>> import pandas as pd
    >>> p = [0.004, 0.008, 0.012]
    >>> smooth = {"a_over_R": None, "b_over_R": None, "p_over_E": p, "mu": [1.32, 0.94, 0.79]}
    >>> calibrate_friction(pd.DataFrame(smooth), None, FrictionModel(kappa=0), rng=1).converged
    True
    """
    table, seed, model = read_friction_table(table), seed_of(rng), model or FrictionModel()
    if not table.is_fitted.any():
        raise InputError(f"{table.where}: expected a row of role calibration, got none")
    if not model.unknown:
        raise InputError("model: expected a parameter with a distribution, got fixed values only")
    rows = rows_of(table.frame, inputs, nu, seed, edges=model.kappa != 0)
    density = FrictionDensity(model, rows.where(table.is_fitted))
    chains, summary, evidence = sampled(density, seed)
    failures = chains.convergence_failures + failed_diagnostics(summary)
    kept = chains.thinned(N_KEPT)
    theta = model.theta(kept.u.reshape(-1, kept.u.shape[-1]))
    bands = _row_bands(rows, theta, stream(seed, "friction", "rows"))
    frame = table.frame.assign(**bands)
    return FrictionFit(model, kept, summary, failures, evidence, frame, seed, table.digest())


def sampled(density: FrictionDensity, seed: int) -> tuple[Chains, pd.DataFrame, LogEvidence]:
    """Return importance-sampled draws of a density, their summary, and the evidence."""
    target, names, effort = density.target, density.model.unknown, Effort()
    drawn = importance_sample(target, effort, seed)
    while not drawn.evidence.ok and effort.n_draw < _MAX_DRAWS:
        effort = effort.doubled
        drawn = importance_sample(target, effort, seed)
    drawn = at_least(drawn, target, N_KEPT, effort, seed)
    theta = density.model.theta(drawn.chains.u)[..., [PARAMETERS.index(name) for name in names]]
    return drawn.chains, summarise(theta, names, share=drawn.share), drawn.evidence


def rows_of(
    frame: pd.DataFrame, source: Fit | Comparison | None, nu: float, seed: int, *, edges: bool
) -> FrictionRows:
    """Return the rows of a friction table's frame, with their contacts.

    Raises
    ------
    InputError
        If rows are on ridges and there is no posterior.
    """
    p, smooth = frame["p_over_E"].to_numpy(), frame["a_over_R"].isna().to_numpy()
    width = half_width(p, nu=nu)
    contact = np.stack([width / p, width, np.zeros(len(p))], axis=1)
    spread = [np.zeros((len(p), 3, 0))]
    widths = frame[["a_over_R", "b_over_R"]].to_numpy()
    for i, texture in enumerate(np.unique(widths[~smooth], axis=0)):
        if source is None:
            raise InputError("inputs: expected a Fit or a Comparison for rows on ridges, got None")
        here = np.flatnonzero((widths == texture).all(axis=1))
        loads, at = np.unique(p[here], return_inverse=True)
        scene, rng = Scene.of([tuple(texture.tolist())], nu=nu), stream(seed, f"texture {i}")
        drawn = friction_inputs(source, scene, loads, n=_N_INPUT, rng=rng, edges=edges)
        contacts = FrictionInputs.of(drawn, edges=edges).contact
        mean = contacts.mean(axis=0)
        scale = np.where(mean > 0, mean, 1.0)
        deviation = ((contacts - mean) / scale).reshape(_N_INPUT, -1) / np.sqrt(_N_INPUT)
        _, size, direction = np.linalg.svd(deviation, full_matrices=False)
        components = (size[:, None] * direction)[size > _MIN_DEVIATION].T.reshape(*mean.shape, -1)
        contact[here] = mean[at]
        spread.append(np.zeros((len(p), 3, components.shape[-1])))
        spread[-1][here] = (scale[..., None] * components)[at]
    return FrictionRows.of(frame, contact, np.concatenate(spread, axis=2))


def _row_bands(
    rows: FrictionRows, theta: FloatArray, rng: np.random.Generator
) -> dict[str, FloatArray]:
    """Return bands of mu of each row on a new subject, session and rig."""
    scales = theta[:, PARAMETERS.index("tau_subject") :]
    effect = (scales * rng.standard_normal(scales.shape)).sum(axis=1)
    score = rng.standard_normal((len(theta), rows.spread.shape[2]))
    bands = np.empty((3, len(rows.mu)))
    for r, relative_se in enumerate(rows.se / rows.mu):
        contact = rows.contact[r] + score @ rows.spread[r].T
        error = relative_se * rng.standard_normal(len(theta))
        mu = terms(contact, theta).sum(axis=1) * np.exp(effect + error)
        bands[:, r] = np.quantile(mu, (0.5, 0.05, 0.95))
    return dict(zip(("mu_median", "mu_lower", "mu_upper"), bands, strict=True))


def _to_json(model: FrictionModel) -> Json:
    priors = {name: getattr(model, name) for name in PARAMETERS}
    return {k: to_dict(v) if isinstance(v, Distribution) else float(v) for k, v in priors.items()}


def _read_fit(stored: Stored) -> FrictionFit:
    """Return the fit in a file; the caller converts errors of any type."""
    about = stored.attrs
    values = json.loads(about["friction_model"]).items()
    priors = {k: from_dict(v) if isinstance(v, dict) else float(v) for k, v in values}
    model = FrictionModel(**priors)
    chains = chains_of(stored, len(model.unknown))
    observed, constant = stored.groups["observed_data"], stored.groups["constant_data"]
    names = json.loads(about["columns"])
    summary = pd.DataFrame(json.loads(about["summary"]))
    evidence = LogEvidence(**json.loads(about["evidence"]))
    missing, seed = tuple(json.loads(about["missing"])), int(about["seed"])
    rows = pd.DataFrame({k: (observed if k == "mu" else constant)[k] for k in names})
    return FrictionFit(model, chains, summary, missing, evidence, rows, seed, about["table_digest"])
