"""The log-likelihood of rows, given the form's rates and what the error model adds.

Residuals are of log loads: ``r = log load - 2 log shape + 2 log rate - offset``, in which the rate
shifts all rows of a texture alike. An exact row has the density of its error at r; a bracket and a
count have the probability of the errors between two residuals.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ridgebayes._types import BoolArray, FloatArray, IntArray
from ridgebayes.errors import InputError
from ridgebayes.model.forms import Form
from ridgebayes.model.observations import Observations
from ridgebayes.model.tails import Tail

# Relative standard error that a load has at least where rows share offsets: the tolerance of
# half-plane loads. Without it rows that agree to rounding, as noiseless loads of two textures of
# equal a/b do, leave sigma no lower bound, and no covariance holds their digits.
LEAST_REL_SE = 1e-8


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows with the form's shape taken off, one by one.

    Parameters
    ----------
    texture : ndarray of int, shape (n_obs,)
        Index of each row's texture.
    rel_se : ndarray of float, shape (n_obs,), dimensionless
        Known relative standard error of the load.
    exact : ndarray of bool, shape (n_obs,)
        Rows that give the load itself.
    upper : ndarray of float, shape (n_obs,), dimensionless
        log load less 2 log shape: of the load itself, of a bracket's upper end, of the load at
        which a count was seen. Infinite for a count of 2, which any load is enough for.
    lower : ndarray of float, shape (n_obs,), dimensionless
        The same of a bracket's lower end, and of a count's load less the shape of Q + 2.
    """

    texture: IntArray
    rel_se: FloatArray
    exact: BoolArray
    upper: FloatArray
    lower: FloatArray

    @classmethod
    def of(cls, data: Observations, form: Form, *, share_offsets: bool = False) -> "Rows":
        """Take the shape of a form off some rows.

        Parameters
        ----------
        data : Observations
            Rows.
        form : Form
            Contact form.
        share_offsets : bool, optional
            Whether rows share offsets; none is known better than `LEAST_REL_SE` then.

        Raises
        ------
        InputError
            If the form has no load for a row's count.
        """
        a, b = data.a_over_R[data.texture], data.b_over_R[data.texture]
        shape = form.shape(data.Q, a, b)
        touched = data.is_count & (data.Q == 2)
        if not np.all((shape > 0) | touched):
            raise InputError(
                f"{form.name}: expected Q >= 4, got a row whose load is zero by this form"
            )
        with np.errstate(divide="ignore"):
            log_shape = np.log(np.where(touched, 1.0, shape))
        upper = np.where(touched, np.inf, data.log_load - 2 * log_shape)
        lower = data.log_lower - 2 * log_shape
        counts = np.flatnonzero(data.is_count)
        if len(counts):
            later = form.shape(data.Q[counts] + 2, a[counts], b[counts])
            lower[counts] = data.log_load[counts] - 2 * np.log(later)
        exact = data.is_exact
        lower[exact] = upper[exact]
        rel_se = np.maximum(data.rel_se, LEAST_REL_SE) if share_offsets else data.rel_se
        return cls(data.texture, rel_se, exact, upper, lower)

    @cached_property
    def centre(self) -> tuple[FloatArray, FloatArray]:
        """Each row's middle and the variance of a uniform error within its width.

        Where one end is infinite, or the width above 1 (a factor of 2.7 in load), a width of 1 at
        the other end stands for it: a rough value for approximations that are corrected later.
        """
        upper = np.where(np.isfinite(self.upper), self.upper, self.lower + 1)
        lower = np.maximum(self.lower, upper - 1)
        return 0.5 * (upper + lower), (upper - lower) ** 2 / 12

    def normal_variance(self, eta: FloatArray, tail: Tail) -> FloatArray:
        """Return the variances of normal errors that come near the rows' own, (..., n_obs)."""
        own = eta[..., :1] ** 2 + self.rel_se**2
        df = eta[..., -1:] if tail.parameter_names else None
        return own * tail.site_variance(df) + self.centre[1]

    def log_likelihood(
        self,
        log_rates: FloatArray,
        sigma: FloatArray,
        tail: Tail,
        df: FloatArray | None,
        offset: FloatArray | float = 0.0,
        offset_next: FloatArray | None = None,
    ) -> FloatArray:
        """Return the log-likelihood of each row.

        Parameters
        ----------
        log_rates : ndarray of float, shape (..., n_texture)
            log rate of each texture.
        sigma, df : ndarray of float, shape (...)
            Scale and degrees of freedom of the rows' own errors.
        tail : Tail
            Their distribution.
        offset, offset_next : ndarray of float, shape (..., n_obs), optional
            Shared offset of each row's log load; for counts, that of the load of Q + 2.

        Returns
        -------
        ndarray of float, shape (..., n_obs)
            Log density of exact rows, log probability of the others.
        """
        shift = 2 * log_rates[..., self.texture]
        scale = np.sqrt(sigma[..., None] ** 2 + self.rel_se**2)
        nu = None if df is None else df[..., None]
        if self.exact.all():
            return tail.log_density((self.upper + shift - offset) / scale, nu) - np.log(scale)
        value = np.empty(np.broadcast_shapes(shift.shape, np.shape(offset)))
        # All rows are taken as they lie, without a copy.
        here, there = self.exact, ~self.exact if self.exact.any() else slice(None)
        offset = np.broadcast_to(offset, value.shape)
        after = offset if offset_next is None else offset_next
        z = (self.upper[here] + shift[..., here] - offset[..., here]) / scale[..., here]
        value[..., here] = tail.log_density(z, nu) - np.log(scale[..., here])
        high = (self.upper[there] + shift[..., there] - offset[..., there]) / scale[..., there]
        low = (self.lower[there] + shift[..., there] - after[..., there]) / scale[..., there]
        apart = after[..., there] - offset[..., there]
        width = (self.upper[there] - self.lower[there] + apart) / scale[..., there]
        # P(Q >= n) is the running minimum over n: where offsets turn two loads round, the nearer
        # ridge is not reached later than the further one.
        value[..., there] = tail.log_probability(
            np.minimum(low, high), high, nu, np.maximum(width, 0)
        )
        return value


@dataclass(frozen=True, eq=False)
class RowGroups:
    """Exact rows alike in texture, known error and shared offsets: number, mean, sum of squares.

    Parameters
    ----------
    texture : ndarray of int, shape (n_group,)
        Index of the texture.
    row : ndarray of int, shape (n_group,)
        A row of each group.
    rel_se : ndarray of float, shape (n_group,), dimensionless
        Known relative standard error.
    n, mean, sum_of_squares : ndarray of float, shape (n_group,)
        Number of rows, and the mean and the sum of squares about it of their `Rows.upper`.
    of_row : ndarray of int, shape (n_obs,)
        Group of each row.
    """

    texture: IntArray
    row: IntArray
    rel_se: FloatArray
    n: FloatArray
    mean: FloatArray
    sum_of_squares: FloatArray
    of_row: IntArray

    @classmethod
    def of(cls, rows: Rows, codes: IntArray | None = None) -> "RowGroups":
        """Group rows; `codes` of shape (n_factor, n_obs) are the levels of their offsets."""
        keys = [rows.texture, np.unique(rows.rel_se, return_inverse=True)[1]]
        keys += [] if codes is None else list(codes)
        _, first, group = np.unique(np.stack(keys), axis=1, return_index=True, return_inverse=True)
        group = group.reshape(-1)
        n = np.bincount(group).astype(float)
        mean = np.bincount(group, rows.upper) / n
        # About the mean, not as a difference of squares: residuals are 1e-2 on values of 10.
        squares = np.bincount(group, (rows.upper - mean[group]) ** 2)
        return cls(
            rows.texture[first], first, rows.rel_se[first], n, mean, squares.astype(float), group
        )
