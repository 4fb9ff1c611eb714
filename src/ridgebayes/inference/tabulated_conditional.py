r"""Coefficients of one texture each, given the error model: their exact distributions, tabulated.

The power law has a K for each texture. Where rows share nothing, K's are independent given sigma
(and df), and the distribution of each is a one-dimensional integral. It may have several humps
(Student rows that disagree) or one bounded side (brackets without a lower end), of which a normal
knows nothing.

Quantiles are tabulated by sigma and df, and interpolated linearly: a piecewise linear map of
standard normals, whose Jacobian is exact whatever the table's errors are.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.model.forms import PowerLaw
from ridgebayes.model.model import Model

_SIGMA = np.geomspace(1e-8, 10.0, 31)
_DF = np.geomspace(0.3, 100.0, 7)
# Nodes about the loads of rows in units of their errors: where a row says most, and far out.
_NEAR = np.sinh(np.linspace(-5.0, 5.0, 21))
_PRIOR = np.linspace(-8.0, 8.0, 33)  # nodes in prior sds
_FURTHEST = 40.0  # prior sds at which a coefficient is looked for
_STEP, _LAST = 0.25, 6.0  # of the standard normals of the quantiles
_W = np.arange(-_LAST, _LAST + _STEP / 2, _STEP)
_FLOOR = -60.0  # log density relative to the highest that counts as none
_LEAST_SLOPE = 1e-13
_AT_ONCE = 300_000  # numbers, of which rows take some twenty arrays


@dataclass(frozen=True, eq=False)
class TabulatedConditional:
    """The map between coefficients and standard normals, given the error model's parameters.

    Parameters
    ----------
    axes : tuple of ndarray of float
        Logarithms of the error model's parameters that quantiles are tabulated at.
    quantiles : ndarray of float, shape (n_1, ..., n_coefficient, n_w)
        Unconstrained coordinates of each coefficient at the standard normals `_W`.
    model : Model
        What tells the error model's parameters from their unconstrained coordinates.
    """

    axes: tuple[FloatArray, ...]
    quantiles: FloatArray
    model: Model

    @classmethod
    def serves(cls, model: Model) -> bool:
        """Return whether rows share nothing, and each is of one coefficient."""
        return (
            isinstance(model.form, PowerLaw)
            and model.offsets is None
            and not model.is_iid_gaussian
            and len(model.noise.parameter_names) <= 2
        )

    @classmethod
    def of(cls, model: Model) -> "TabulatedConditional":
        """Tabulate the coefficients of a model that `serves` is true of."""
        values = (_SIGMA, _DF)[: model.n_parameter - model.n_coefficient]
        shape = tuple(map(len, values))
        eta = np.stack(np.meshgrid(*values, indexing="ij"), axis=-1).reshape(-1, len(values))
        nodes = [_nodes(model, sigma) for sigma in _SIGMA]
        each = np.repeat(np.arange(len(_SIGMA)), len(eta) // len(_SIGMA))
        n_at_once = max(_AT_ONCE // (len(nodes[0]) * len(model.data)), 1)
        tables = []
        for i in range(0, len(eta), n_at_once):
            u = np.stack([nodes[j] for j in each[i : i + n_at_once]])
            tables.append(_quantiles(u, _log_densities(model, u, eta[i : i + n_at_once])))
        quantiles = np.concatenate(tables).reshape(*shape, model.n_coefficient, len(_W))
        return cls(tuple(map(np.log, values)), quantiles, model)

    @property
    def n_coefficient(self) -> int:
        """Coefficients."""
        value: int = self.quantiles.shape[-2]
        return value

    def forward(self, w: FloatArray, u_noise: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return coefficients' coordinates of standard normals `w`, and log |du/dw|."""
        cell = np.clip(((w + _LAST) / _STEP).astype(np.int64), 0, len(_W) - 2)
        low, high = (self._between(u_noise, cell + i) for i in (0, 1))
        slope = (high - low) / _STEP
        return low + slope * (w - _W[cell]), np.log(slope).sum(axis=-1)

    def inverse(self, u: FloatArray, u_noise: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the standard normals of coefficients' coordinates: the inverse of `forward`."""
        cell = np.zeros(u.shape, dtype=np.int64)
        for half in 2 ** np.arange(5, -1, -1):  # by halving: quantiles rise
            up = np.minimum(cell + half, len(_W) - 2)
            cell = np.where(self._between(u_noise, up) <= u, up, cell)
        low, high = (self._between(u_noise, cell + i) for i in (0, 1))
        slope = (high - low) / _STEP
        return _W[cell] + (u - low) / slope, np.log(slope).sum(axis=-1)

    def _between(self, u_noise: FloatArray, cell: IntArray) -> FloatArray:
        """Return the quantiles of a cell of each coefficient, shape (..., n_coefficient)."""
        k = self.n_coefficient
        u = np.concatenate([np.zeros((*u_noise.shape[:-1], k)), u_noise], axis=-1)
        with np.errstate(divide="ignore"):
            at = np.log(self.model.to_theta(u)[..., k:])
        corners: list[tuple[tuple[IntArray, ...], FloatArray]] = [((), np.ones(at.shape[:-1]))]
        for value, axis in zip(np.moveaxis(at, -1, 0), self.axes, strict=True):
            place = np.clip((value - axis[0]) / (axis[1] - axis[0]), 0, len(axis) - 1)
            first = np.minimum(place.astype(np.int64), len(axis) - 2)
            share = place - first
            corners = [
                ((*index, first + i), weight * part)
                for index, weight in corners
                for i, part in ((0, 1 - share), (1, share))
            ]
        found = np.zeros(np.broadcast_shapes(cell.shape, (*at.shape[:-1], k)))
        for index, weight in corners:
            spread = tuple(i[..., None] for i in index)
            found += weight[..., None] * self.quantiles[(*spread, np.arange(k), cell)]
        return found


def _nodes(model: Model, sigma: float) -> FloatArray:
    """Return coordinates of each coefficient at which its density is worked out, (m, k)."""
    rows, k = model.rows, model.n_coefficient
    scale = np.sqrt(sigma**2 + rows.rel_se**2)
    # log load = 2 log shape - 2 log K: the log K of a row's either end.
    ends = -0.5 * np.where(
        [np.ones_like(rows.exact), ~rows.exact], [rows.upper, rows.lower], np.inf
    )
    around = ends[..., None] + 0.5 * scale[:, None] * _NEAR
    own = [around[:, rows.texture == j].reshape(-1) for j in range(k)]
    log_k = np.full((max(map(len, own)), k), np.nan)
    for j, nodes in enumerate(own):
        log_k[: len(nodes), j] = nodes
    theta = np.tile(model.to_theta(np.zeros(model.n_parameter)), (len(log_k), 1))
    with np.errstate(all="ignore"):
        theta[:, :k] = np.exp(np.where(np.isnan(log_k), 0.0, log_k))
        u = model.to_unconstrained(theta)[:, :k]
    # Nodes that stand for nothing join the prior's: two at one place have no width.
    u = np.where(np.isfinite(log_k) & np.isfinite(u), np.clip(u, -_FURTHEST, _FURTHEST), 0.0)
    return np.sort(np.concatenate([u, np.repeat(_PRIOR[:, None], k, axis=1)]), axis=0)


def _log_densities(model: Model, u: FloatArray, eta: FloatArray) -> FloatArray:
    """Return log prior times likelihood of each coefficient's rows, (n, m, k)."""
    k, texture = model.n_coefficient, model.rows.texture
    own = (texture[:, None] == np.arange(k)).astype(float)
    of_noise = np.concatenate([np.ones((len(eta), k)), eta], axis=1)
    u_noise = np.clip(model.to_unconstrained(of_noise)[:, None, k:], -_FURTHEST, _FURTHEST)
    u_noise = np.broadcast_to(u_noise, (*u.shape[:2], eta.shape[1]))
    everything = np.concatenate([u, u_noise], axis=-1)
    rows = np.maximum(model.pointwise_log_likelihood(everything), -1e30)
    value: FloatArray = rows @ own - 0.5 * u * u
    return value


def _quantiles(u: FloatArray, log_density: FloatArray) -> FloatArray:
    """Return the coordinates at standard normals `_W`, (n, k, n_w), from (n, m, k)."""
    density = np.exp(np.maximum(log_density - log_density.max(axis=1, keepdims=True), _FLOOR))
    area = 0.5 * np.diff(u, axis=1) * (density[:, 1:] + density[:, :-1])
    none = np.zeros_like(area[:, :1])
    below = np.concatenate([none, np.cumsum(area, axis=1)], axis=1)
    above = np.concatenate([np.cumsum(area[:, ::-1], axis=1)[:, ::-1], none], axis=1)
    total = below + above
    # Both tails by their own probability: a difference from 1 has no digits left.
    w = np.where(below < above, ndtri(below / total), -ndtri(above / total))
    w = np.clip(w, -38.0, 38.0)
    found = np.empty((len(u), u.shape[2], len(_W)))
    for i, j in np.ndindex(found.shape[:2]):
        found[i, j] = np.interp(_W, w[i, :, j], u[i, :, j])
    value: FloatArray = np.maximum.accumulate(found, axis=-1)
    return value + _LEAST_SLOPE * _STEP * np.arange(len(_W))
