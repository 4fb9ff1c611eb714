"""Posterior density of friction parameters, with subjects, sessions and rigs integrated out.

ln mu of row r is ln m_r + effects + error. Effects are normal, and the uncertainty of the contact
is linearised. Both enter the covariance of the rows, D + U U', in which D is diagonal and U has few
columns. A row belongs to three groups, so a call costs O(rows + columns^3).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pandas as pd
from scipy import sparse

from ridgebayes._types import LOG_2PI, BoolArray, FloatArray
from ridgebayes.friction.friction_model import FrictionModel
from ridgebayes.friction.terms import PARAMETERS, coefficients
from ridgebayes.inference.target import PlainTarget
from ridgebayes.model.linear_algebra import cholesky_or_nan, solve_lower
from ridgebayes.table.rules import row_codes

_MIN_VARIANCE = 1e-10  # of ln mu: well below errors of measurement, and above rounding
_MAX_NUMBERS = 2_000_000  # numbers in the arrays of one batch, to limit memory
_GROUP_SCALES = slice(PARAMETERS.index("tau_subject"), PARAMETERS.index("sigma"))


@dataclass(frozen=True, eq=False)
class FrictionRows:
    """Measured friction, and the contacts of its rows.

    Parameters
    ----------
    mu, se : ndarray of float, shape (n_row,)
        Coefficient of friction and its standard error.
    contact : ndarray of float, shape (n_row, 3)
        Means of E A/W, w/R and I/W.
    spread : ndarray of float, shape (n_row, 3, k)
        Deviations of the contact along k independent standard normals.
    groups : sequence of ndarray of int, each of shape (n_row,)
        Codes of subjects, of sessions of a subject, and of rigs.
    """

    mu: FloatArray
    se: FloatArray
    contact: FloatArray
    spread: FloatArray
    groups: Sequence[np.ndarray]

    @classmethod
    def of(cls, frame: pd.DataFrame, contact: FloatArray, spread: FloatArray) -> "FrictionRows":
        """Return the rows of a friction table's frame."""
        subject, session, rig = (frame[name] for name in ("subject", "session", "rig"))
        groups = row_codes(subject), row_codes(subject, session), row_codes(rig)
        mu, se = frame["mu"].to_numpy(), frame["mu_se"].to_numpy()
        return cls(mu, se, contact, spread, groups)

    def where(self, keep: BoolArray) -> "FrictionRows":
        """Return a subset of the rows."""
        columns = (self.mu, self.se, self.contact, self.spread)
        mu, se, contact, spread = (column[keep] for column in columns)
        return FrictionRows(mu, se, contact, spread, [codes[keep] for codes in self.groups])


@dataclass(frozen=True, eq=False)
class FrictionDensity:
    """Posterior density in normal scores of the unknown parameters.

    Parameters
    ----------
    model : FrictionModel
        Priors.
    rows : FrictionRows
        Rows to fit.
    """

    model: FrictionModel
    rows: FrictionRows

    @cached_property
    def _member(self) -> tuple[FloatArray, np.ndarray, sparse.csr_array]:
        """Return indicators of rows in groups, the kinds of groups, and products of indicators."""
        kinds = [np.unique(codes, return_inverse=True) for codes in self.rows.groups]
        member = np.concatenate([np.eye(len(names))[codes] for names, codes in kinds], axis=1)
        kind = np.repeat(np.arange(len(kinds)), [len(names) for names, _ in kinds])
        pairs = sparse.csr_array([np.outer(row, row).ravel() for row in member])
        return member, kind, pairs

    def log_density(self, u: FloatArray) -> FloatArray:
        """Return the log posterior density, (n, k) to (n,)."""
        prior = -0.5 * ((u * u).sum(axis=-1) + u.shape[-1] * LOG_2PI)
        value: FloatArray = prior + self.log_likelihood(self.model.theta(u))
        return value

    def log_likelihood(self, theta: FloatArray) -> FloatArray:
        """Return the log-likelihood of ln mu for parameters (n, 9), shape (n,)."""
        n_row, _, k = self.rows.spread.shape
        size = (self._member[0].shape[1] + k) ** 2 + n_row * (k + 1)
        n_part = math.ceil(len(theta) * size / _MAX_NUMBERS)
        parts = np.array_split(theta, max(n_part, 1))
        return np.concatenate([self._log_likelihood(part) for part in parts])

    def _log_likelihood(self, theta: FloatArray) -> FloatArray:
        rows, (member, kind, pairs) = self.rows, self._member
        factors, scale = coefficients(theta), theta[:, _GROUP_SCALES][:, kind]
        with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
            mean = factors[:, :3] @ rows.contact.T + factors[:, 3:]
            residual = np.log(rows.mu) - np.log(mean)
            spread = np.einsum("tj,njk->tnk", factors[:, :3], rows.spread) / mean[:, :, None]
            variance = theta[:, -1:] ** 2 + (rows.se / rows.mu) ** 2
        variance = np.maximum(variance, _MIN_VARIANCE)
        finite = (residual, variance, scale, spread.reshape(len(theta), -1))
        usable = np.logical_and.reduce([np.isfinite(part).all(axis=1) for part in finite])
        for part in (residual, scale, spread):
            part[~usable] = 0.0
        variance[~usable] = 1.0
        weight, n = 1.0 / variance, member.shape[1]
        weighted = np.swapaxes(weight[:, :, None] * spread, 1, 2)
        precision = np.eye(n + spread.shape[2]) + np.zeros((len(theta), 1, 1))
        within = (weight @ pairs).reshape(-1, n, n)
        precision[:, :n, :n] += scale[:, :, None] * within * scale[:, None, :]
        precision[:, n:, :n] = (weighted @ member) * scale[:, None, :]  # lower half only
        precision[:, n:, n:] += weighted @ spread
        right = [(weight * residual) @ member * scale, (weighted @ residual[:, :, None])[:, :, 0]]
        root = cholesky_or_nan(precision)
        explained = solve_lower(root, np.concatenate(right, axis=1)[:, :, None])[:, :, 0]
        square = (weight * residual**2).sum(axis=1) - (explained * explained).sum(axis=1)
        log_volume = np.log(np.diagonal(root, axis1=1, axis2=2)).sum(axis=1)
        constant = np.log(variance).sum(axis=1) + residual.shape[1] * LOG_2PI
        value = -0.5 * (square + constant) - log_volume
        return np.where(usable & np.isfinite(value), value, -np.inf)

    @property
    def target(self) -> PlainTarget:
        """Target of importance sampling and random walks."""
        return PlainTarget("friction model", self.model.unknown, self.log_density)
