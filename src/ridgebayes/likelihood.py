r"""The log-likelihood of any form with any error model, and the posterior a sampler needs.

The data are log loads, reduced to nu = 0.5. Row i of texture j has the residual

    r_i = y_i - 2 log shape_i + 2 log rate_j(theta),

in which the coefficients shift all rows of a texture alike. With independent normal errors the rows
of a texture that share a known error enter through their number, mean and sum of squares alone, so
a call costs O(textures) whatever the number of rows.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.errors import InputError
from ridgebayes.forms import Form, Texture, reduced_load
from ridgebayes.noise import Noise
from ridgebayes.priors import JointPrior, Prior, default_priors
from ridgebayes.table import ContactTable


@dataclass(frozen=True, eq=False)
class Observations:
    """The rows a posterior is conditioned on, as arrays.

    Parameters
    ----------
    textures : tuple of (float, float), length n_texture
        (a/R, b/R) in order of first appearance.
    texture : ndarray of int, shape (n_obs,)
        Index of each row's texture.
    Q : ndarray of int, shape (n_obs,)
        Count reached.
    log_load : ndarray of float, shape (n_obs,), dimensionless
        log of the load p/E reduced to nu = 0.5.
    rel_se : ndarray of float, shape (n_obs,), dimensionless
        Known relative standard error of the load.
    labels : tuple of str, length n_texture
        Names of the textures.
    """

    textures: tuple[Texture, ...]
    texture: IntArray
    Q: IntArray
    log_load: FloatArray
    rel_se: FloatArray
    labels: tuple[str, ...] = ()

    @classmethod
    def from_table(cls, table: ContactTable) -> "Observations":
        """Take the calibration rows of a table.

        Raises
        ------
        InputError
            If there is no such row, or a row of a kind that this version does not fit: brackets,
            counts, laterally offset bodies.
        """
        rows = table.calibration
        frame = rows.frame
        if frame.empty:
            raise InputError(
                f"{table.where}: no row with role calibration and status ok; rule: at least 1"
            )
        _refuse_kinds(table)
        widths = frame[["a_over_R", "b_over_R"]].to_numpy()
        codes, textures = pd.factorize(pd.MultiIndex.from_arrays([widths[:, 0], widths[:, 1]]))
        return cls(
            textures=tuple((float(a), float(b)) for a, b in textures),
            texture=codes.astype(np.int64),
            Q=frame["Q"].to_numpy(np.int64),
            log_load=np.log(reduced_load(frame["p_over_E"].to_numpy(), frame["nu"].to_numpy())),
            rel_se=frame["rel_se"].to_numpy(float),
            labels=rows.labels,
        )

    def __len__(self) -> int:
        return len(self.log_load)

    @property
    def a_over_R(self) -> FloatArray:
        """Ridge widths of the textures, shape (n_texture,)."""
        return np.array([a for a, _ in self.textures])

    @property
    def b_over_R(self) -> FloatArray:
        """Groove widths of the textures, shape (n_texture,)."""
        return np.array([b for _, b in self.textures])


def _refuse_kinds(table: ContactTable) -> None:
    """Name the first row that is not a plain transition of a centred body."""
    everything = table.frame
    fitted = (everything["status"] == "ok") & (everything["role"] == "calibration")
    other = {
        "kind": everything["kind"] != "transition",
        "p_over_E_lower": everything["p_over_E_lower"].notna(),
        "offset_over_R": everything["offset_over_R"] != 0,
    }
    for column, bad in other.items():
        rows = np.flatnonzero(fitted & bad)
        if len(rows):
            value = everything[column].tolist()[rows[0]]
            more = f" and {len(rows) - 1} more rows" if len(rows) > 1 else ""
            raise InputError(
                f"{table.where}, row {rows[0] + 1}{more}: {column} = {value!r}; rule: this version "
                "fits transition loads of centred bodies, no counts and no brackets"
            )


class Model:
    """A form, an error model and priors, conditioned on rows: what is sampled and integrated.

    Parameters
    ----------
    data : Observations
        Rows.
    form : Form
        Contact form; it is bound to the textures of the rows.
    noise : Noise, optional
        Error model.
    priors : mapping of str to Prior, optional
        Replacements for some of the default priors, by parameter name.

    Raises
    ------
    InputError
        If a prior is given for a parameter that the model does not have, or has another support
        than the default; if the form cannot compute a row's count.

    Notes
    -----
    `theta` holds the coefficients and then the error model's parameters on its last axis; any
    leading axes are draws. `u` is the same in unconstrained coordinates: the prior's normal scores,
    in which the prior is a standard normal.
    """

    def __init__(
        self,
        data: Observations,
        form: Form,
        noise: Noise | None = None,
        priors: Mapping[str, Prior] | None = None,
    ) -> None:
        self.data = data
        self.form = form.bind(data.textures, data.labels)
        self.noise = noise or Noise()
        self.priors = default_priors(self.form)
        for name, prior in (priors or {}).items():
            if name not in self.priors or prior.positive != self.priors[name].positive:
                raise InputError(
                    f"prior of {name!r}: {prior} given; rule: one of {', '.join(self.priors)}, "
                    "with the support of its default"
                )
            self.priors[name] = prior
        self._joint = JointPrior(self.priors.values())
        self._a, self._b = data.a_over_R, data.b_over_R
        shape = self.form.shape(data.Q, self._a[data.texture], self._b[data.texture])
        if not np.all(shape > 0):
            raise InputError(f"{form.name}: a row's load is zero by this form; rule: Q >= 4")
        self.centred_log_load = data.log_load - 2 * np.log(shape)
        self.groups = _group_rows(self.centred_log_load, data)

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names on the last axis of `theta`."""
        return tuple(self.priors)

    @property
    def n_parameter(self) -> int:
        """Length of the last axis of `theta`."""
        return len(self.priors)

    @property
    def n_coefficient(self) -> int:
        """Coefficients of the form; the error model's parameters follow them, sigma first."""
        return len(self.form.parameter_names)

    def with_priors(self, priors: Mapping[str, Prior]) -> "Model":
        """Return the model with some priors replaced, the data statistics shared."""
        return Model(self.data, self.form, self.noise, {**self.priors, **priors})

    def log_prior(self, theta: FloatArray) -> FloatArray:
        """Return the log prior density in theta, shape ``theta.shape[:-1]``."""
        return self._joint.log_pdf(theta)

    def log_rates(self, theta: FloatArray) -> FloatArray:
        """Return log rate of each texture, shape (..., n_texture); -inf where not positive."""
        rate = self.form.rate(theta[..., :-1], self._a, self._b)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(rate > 0, np.log(rate), -np.inf)

    def log_likelihood(self, theta: FloatArray) -> FloatArray:
        """Return the log-likelihood, the density of the log loads, shape ``theta.shape[:-1]``.

        A texture whose rate is not positive has likelihood zero.
        """
        group = self.groups
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            r = group.mean + 2 * self.log_rates(theta)[..., group.texture]
            variance = theta[..., -1:] ** 2 + group.rel_se**2
            misfit = (group.sum_of_squares + group.n * r * r) / variance
            value = -0.5 * (group.n * np.log(2 * math.pi * variance) + misfit).sum(axis=-1)
        return np.where(np.isnan(value), -np.inf, value)

    def pointwise_log_likelihood(self, theta: FloatArray) -> FloatArray:
        """Return the log-likelihood of each row, shape ``theta.shape[:-1] + (n_obs,)``."""
        r = self.centred_log_load + 2 * self.log_rates(theta)[..., self.data.texture]
        variance = theta[..., -1:] ** 2 + self.data.rel_se**2
        return -0.5 * (np.log(2 * math.pi * variance) + r * r / variance)

    def to_theta(self, u: FloatArray) -> FloatArray:
        """Return parameters from unconstrained coordinates."""
        return self._joint.at_scores(u)

    def to_unconstrained(self, theta: FloatArray) -> FloatArray:
        """Return unconstrained coordinates of parameters."""
        return self._joint.scores(theta)

    def log_density(self, u: FloatArray) -> FloatArray:
        """Return the log posterior density in `u`, not normalised, shape ``u.shape[:-1]``.

        Its integral over `u` is the evidence.
        """
        log_prior = -0.5 * ((u * u).sum(axis=-1) + u.shape[-1] * math.log(2 * math.pi))
        value = log_prior + self.log_likelihood(self.to_theta(u))
        return np.where(np.isnan(value), -np.inf, value)

    def log_density_gradient(self, u: FloatArray) -> FloatArray:
        """Return d log_density / d u where it is finite, shape of `u`."""
        theta, groups = self.to_theta(u), self.groups
        r = groups.mean + 2 * self.log_rates(theta)[..., groups.texture]
        variance = theta[..., -1:] ** 2 + groups.rel_se**2
        by_rate = -2 * groups.n * r / variance
        by_theta = self.form.log_rate_gradient(theta[..., :-1], self._a, self._b)
        gradient = np.empty(theta.shape)
        gradient[..., :-1] = np.einsum(
            "...g,...gp->...p", by_rate, by_theta[..., groups.texture, :]
        )
        misfit = (groups.sum_of_squares + groups.n * r * r) / variance
        gradient[..., -1] = theta[..., -1] * ((misfit - groups.n) / variance).sum(axis=-1)
        return gradient * self._joint.at_scores_slope(u, theta) - u

    def information(self, u: FloatArray) -> FloatArray:
        """Return the rows' Fisher information of the coefficients for an error variance of 1.

        Parameters
        ----------
        u : ndarray of float, shape (n_parameter,)
            Unconstrained coordinates.

        Returns
        -------
        ndarray of float, shape (n_coefficient, n_coefficient)
            In unconstrained coordinates; over the error variance it is that of the likelihood.
        """
        theta = self.to_theta(u)
        slope = self._joint.at_scores_slope(u, theta)[:-1]
        jacobian = 2 * self.form.log_rate_gradient(theta[:-1], self._a, self._b) * slope
        n = np.bincount(self.groups.texture, self.groups.n, len(self._a))
        return (jacobian.T * n) @ jacobian


@dataclass(frozen=True, eq=False)
class RowGroups:
    """Rows of one texture and one known error: number, mean and sum of squares about the mean."""

    texture: IntArray
    rel_se: FloatArray
    n: FloatArray
    mean: FloatArray
    sum_of_squares: FloatArray


def _group_rows(centred: FloatArray, data: Observations) -> RowGroups:
    se, se_code = np.unique(data.rel_se, return_inverse=True)
    codes, group = np.unique(data.texture * len(se) + se_code, return_inverse=True)
    n = np.bincount(group).astype(float)
    mean = np.bincount(group, centred) / n
    # About the mean, not as a difference of squares: residuals are 1e-2 on values of 10.
    squares = np.bincount(group, (centred - mean[group]) ** 2)
    return RowGroups(codes // len(se), se[codes % len(se)], n, mean, squares.astype(float))
