r"""The posterior of a form's coefficients and an error model's parameters, given rows.

Which likelihood serves depends on the rows and the error model:

- independent normal errors, exact rows: O(textures), by each one's number, mean, sum of squares;
- normal errors and shared offsets, exact rows: offsets are integrated out in closed form;
- independent rows with Student errors, brackets or counts: row by row;
- these with shared offsets: the integral over the offsets is estimated, and their scores are drawn
  with it (`is_latent`).
"""

import math
from collections.abc import Mapping

import numpy as np

from ridgebayes._types import FloatArray
from ridgebayes.distributions.distribution import Distribution
from ridgebayes.errors import ComputationError, InputError
from ridgebayes.model.default_priors import replaced_priors
from ridgebayes.model.forms import Form
from ridgebayes.model.joint_prior import JointPrior
from ridgebayes.model.likelihood_independent import IndependentNormalRows, IndependentRows
from ridgebayes.model.likelihood_latent import Estimate, SampledOffsets
from ridgebayes.model.likelihood_marginal import IntegratedOffsets, IntegratedSmoothOffsets
from ridgebayes.model.noise import Noise
from ridgebayes.model.observations import Observations
from ridgebayes.model.offsets_given import OffsetsGiven
from ridgebayes.model.rows import Rows
from ridgebayes.model.shared_offsets import SmoothOffsets, offsets_of

_CACHED = 100_000  # textures, or rows, times draws whose arrays fit in a processor's cache
_COVARIANCE = 5  # numbers of a covariance that count as one texture
_COEFFICIENTS_MAX = 100  # with errors that leave them no closed-form posterior
_LATENT_ROWS_MAX = 2_000  # of which a call takes some hundredths of a second
_HUGE = 1e100  # coefficients beyond which a rate may overflow
_DIFFERENCE = 1e-4  # prior sds, of the differences that a form's gradient is held to
_LOG_2PI = math.log(2 * math.pi)


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
    priors : mapping of str to Distribution, optional
        Replacements for some of the default priors, by parameter name; the priors of coefficients
        that have no default. ``K`` is that of the power law's slopes, also at new textures.

    Raises
    ------
    InputError
        If a prior is given for a parameter that the model does not have, or has another support
        than the default; if a coefficient has no default and none is given; if the form cannot
        compute a row's count.
    ComputationError
        If the error model cannot serve that many places, rows or coefficients.

    Notes
    -----
    `theta` holds the coefficients and then the error model's parameters on its last axis; any
    leading axes are draws. `u` is the same in unconstrained coordinates: the prior's normal scores,
    in which the prior is a standard normal. Scores of offsets that are drawn (`is_latent`) follow.
    """

    def __init__(
        self,
        data: Observations,
        form: Form,
        noise: Noise | None = None,
        priors: Mapping[str, Distribution] | None = None,
    ) -> None:
        self.data = data
        self.form = form.bind(data.textures, data.labels)
        self.noise = noise or Noise()
        # Coefficients of the form; the error model's parameters follow them, sigma first.
        self.n_coefficient = len(self.form.parameter_names)
        self.priors, self.prior_of_slopes = replaced_priors(self.form, self.noise, priors)
        self._joint = JointPrior(self.priors.values())
        self._of_noise = JointPrior(list(self.priors.values())[self.n_coefficient :])
        self._a, self._b = data.a_over_R, data.b_over_R
        self.rows = Rows.of(data, self.form, share_offsets=bool(self.noise.factors))
        self._known_variance = float(np.mean(self.rows.rel_se**2))
        self.offsets = offsets_of(self.noise, data)
        self.likelihood = self._chosen()
        if self.is_latent and len(data) > _LATENT_ROWS_MAX:
            raise ComputationError(
                f"{self.noise.name}: {len(data)} rows; expected at most {_LATENT_ROWS_MAX} where "
                "Student errors, brackets or counts share offsets: these have no closed-form "
                "integral"
            )
        if self.n_coefficient > _COEFFICIENTS_MAX and not self.is_iid_gaussian:
            raise ComputationError(
                f"{form.name} under {self.noise.name}: {self.n_coefficient} coefficients; expected "
                f"at most {_COEFFICIENTS_MAX}, since the cost of a likelihood call grows with "
                "their cube; iid serves any number of exact loads"
            )

    def _chosen(self) -> IndependentRows | IntegratedOffsets | SampledOffsets:
        is_normal = self.noise.tail == "normal" and bool(self.rows.exact.all())
        if self.offsets is None:
            kind = IndependentNormalRows if is_normal else IndependentRows
            return kind(self.rows, self.noise.distribution)
        if not is_normal:
            return SampledOffsets(self.rows, self.offsets, self.noise.distribution)
        if isinstance(self.offsets, SmoothOffsets):
            return IntegratedSmoothOffsets(self.rows, self.offsets)
        return IntegratedOffsets(self.rows, self.offsets)

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names on the last axis of `theta`."""
        return tuple(self.priors)

    @property
    def given_priors(self) -> dict[str, Distribution]:
        """The priors that make this model again: of all parameters, and of slopes if given."""
        return {**self.priors, **self.prior_of_slopes}

    @property
    def n_parameter(self) -> int:
        """Length of the last axis of `theta`."""
        return len(self.priors)

    @property
    def is_latent(self) -> bool:
        """Whether shared offsets have no closed-form integral, and are drawn beside parameters."""
        return isinstance(self.likelihood, SampledOffsets)

    @property
    def n_coordinate(self) -> int:
        """Length of the last axis of `u`: parameters, and offsets where these are drawn."""
        return self.n_parameter + self.likelihood.n_latent

    @property
    def is_iid_gaussian(self) -> bool:
        """Whether rows are exact with independent normal errors: the case with short cuts."""
        return isinstance(self.likelihood, IndependentNormalRows)

    @property
    def n_at_once(self) -> int:
        """Draws whose likelihoods are worked out together.

        Fewer where textures are many, rows count one by one, or each draw has a covariance of many
        places: arrays stay in the processor's cache, and memory does not grow with the draws.
        """
        per_draw = len(self._a)
        if self.offsets is not None:
            per_draw = max(per_draw, self.offsets.n_held // _COVARIANCE)
        if isinstance(self.likelihood, SampledOffsets | IndependentRows):
            per_draw = max(per_draw, self.likelihood.n_held)
        return max(_CACHED // per_draw, 1)

    def with_priors(self, priors: Mapping[str, Distribution]) -> "Model":
        """Return the model with some priors replaced."""
        return Model(self.data, self.form, self.noise, {**self.given_priors, **priors})

    def log_prior(self, theta: FloatArray) -> FloatArray:
        """Return the log prior density in theta, shape ``theta.shape[:-1]``."""
        return self._joint.log_pdf(theta)

    def log_rates(self, theta: FloatArray) -> FloatArray:
        """Return log rate of each texture, shape (..., n_texture); -inf where not positive.

        Raises
        ------
        ComputationError
            If the form returns a rate that is NaN or infinite at finite coefficients.
        """
        coefficients = theta[..., : self.n_coefficient]
        rate = self.form.rate(coefficients, self._a, self._b)
        with np.errstate(divide="ignore", invalid="ignore"):
            value = np.log(rate)
        if np.isfinite(value).all():
            return value
        self._refuse_undefined(coefficients, rate)
        return np.where(rate > 0, value, -np.inf)

    def _refuse_undefined(self, coefficients: FloatArray, rate: FloatArray) -> None:
        """Raise ComputationError where a form has no rate at coefficients that a float can hold.

        Taken as likelihood zero, it would cut off part of a posterior without a word.
        """
        near = np.asarray((np.abs(coefficients) < _HUGE).all(axis=-1))
        undefined = (np.isnan(rate) | np.isposinf(rate)) & near[..., None]
        if undefined.any():
            *draw, j = np.argwhere(undefined)[0]
            at = zip(self.form.parameter_names, coefficients[tuple(draw)].tolist(), strict=True)
            a, b = self.data.textures[j]
            raise ComputationError(
                f"{self.form.name}: rate of texture a/R = {a!r}, b/R = {b!r} at "
                f"{', '.join(f'{name} = {value!r}' for name, value in at)}: expected a finite "
                "number, <= 0 where no load reaches a further ridge, got "
                f"{float(rate[(*draw, j)])}"
            )

    def check_gradient(self, u: FloatArray) -> None:
        """Raise InputError if the form's gradient is not the difference of its rates on a line."""
        k, theta = self.n_coefficient, self.to_theta(u)
        step = np.zeros(self.n_parameter)
        size = np.abs(self.to_theta(u + _DIFFERENCE) - theta)[:k]
        # A vague prior's step may be far wider than the coefficient itself.
        size = np.where(theta[:k] == 0, size, np.minimum(size, _DIFFERENCE * np.abs(theta[:k])))
        step[:k] = size * np.cos(np.arange(k))  # no coefficient, and no pair alike, is left out
        ahead, behind = theta + step, theta - step
        with np.errstate(all="ignore"):
            change = self.log_rates(ahead) - self.log_rates(behind)
            gradient = self.form.log_rate_gradient(theta[:k], self._a, self._b)
            claimed = gradient @ (ahead - behind)[:k]
            off = np.abs(claimed - change)
            size = np.abs(change).max() + np.abs(claimed).max()
        # Where a rate vanishes beside the point there is nothing to compare.
        worst = int(np.argmax(off))
        if np.isfinite(change).all() and not off[worst] <= 1e-3 * size + 1e-12:
            a, b = self.data.textures[worst]
            raise InputError(
                f"{self.form.name}: log_rate_gradient: expected the derivative of log rate, got a "
                f"change of {claimed[worst]:.6g} where that of texture a/R = {a!r}, b/R = {b!r} "
                f"changes by {change[worst]:.6g}"
            )

    def log_likelihood(self, theta: FloatArray) -> FloatArray:
        """Return the log-likelihood of all rows, shape ``theta.shape[:-1]``.

        A texture whose rate is not positive has likelihood zero. Where offsets are drawn this may
        be Laplace's approximation; `log_density` is exact.
        """
        n_at_once = self.n_at_once
        if theta.ndim == 2 and len(theta) > n_at_once:
            starts = range(0, len(theta), n_at_once)
            return np.concatenate([self.log_likelihood(theta[i : i + n_at_once]) for i in starts])
        with np.errstate(all="ignore"):
            eta = theta[..., self.n_coefficient :]
            value = self.likelihood.marginal(self.log_rates(theta), eta)
        return np.where(np.isnan(value), -np.inf, value)

    def pointwise_log_likelihood(self, u: FloatArray) -> FloatArray:
        """Return each row's log predictive density, from (n_draw, n_coordinate): (n_draw, n_obs).

        Where offsets are integrated out, it is conditional on the parameters and all other rows;
        where they are drawn, on the parameters and the offsets.
        """
        with np.errstate(all="ignore"):
            value = self.likelihood.pointwise(*self._parts(u))
        return np.where(np.isnan(value), -np.inf, value)

    def to_theta(self, u: FloatArray) -> FloatArray:
        """Return parameters from unconstrained coordinates."""
        return self._joint.at_scores(u[..., : self.n_parameter])

    def to_unconstrained(self, theta: FloatArray) -> FloatArray:
        """Return unconstrained coordinates of parameters."""
        return self._joint.scores(theta)

    def log_density(self, u: FloatArray) -> FloatArray:
        """Return the log posterior density in `u`, not normalised, shape ``u.shape[:-1]``.

        Its integral over `u` is the evidence.
        """
        if not isinstance(self.likelihood, SampledOffsets):
            return self.marginal_log_density(u)
        with np.errstate(all="ignore"):
            value = self.log_prior_density(u) + self.likelihood.joint(*self._parts(u))
        return np.where(np.isnan(value), -np.inf, value)

    def marginal_log_density(self, u: FloatArray) -> FloatArray:
        """Return the log posterior density of the parameters alone, offsets integrated out.

        Exact unless offsets are drawn: then it is what `log_likelihood` is.
        """
        value = self.log_prior_density(u) + self.log_likelihood(self.to_theta(u))
        return np.where(np.isnan(value), -np.inf, value)

    def estimated(self, u: FloatArray, rng: np.random.Generator, n_point: int) -> Estimate:
        """Estimate the log posterior density of the parameters, offsets integrated out.

        Parameters
        ----------
        u : ndarray of float, shape (n_draw, n_parameter)
            Unconstrained coordinates.
        rng : numpy.random.Generator
            For offsets that have no closed-form integral.
        n_point : int
            Points at which these are drawn for each draw of the parameters.

        Returns
        -------
        Estimate
            Exact, without coordinates of offsets, unless the model is latent.
        """
        if not isinstance(self.likelihood, SampledOffsets):
            value = self.marginal_log_density(u)
            return Estimate(value, value, np.empty((len(u), 0)))
        with np.errstate(all="ignore"):
            found = self.likelihood.estimated(*self._parts(u)[:2], rng, n_point)
        both = self.log_prior_density(u) + np.stack([found.log_density, found.log_joint])
        value, joint = np.where(np.isnan(both), -np.inf, both)
        return Estimate(value, joint, found.latent)

    def gradient(self, u: FloatArray) -> FloatArray:
        """Return d log_density / d u, shape (n_parameter,), of independent normal rows."""
        likelihood = self.likelihood
        assert isinstance(likelihood, IndependentNormalRows)
        theta, k = self.to_theta(u), self.n_coefficient
        by_group, by_sigma = likelihood.gradient(self.log_rates(theta), theta[k:])
        by_theta = self.form.log_rate_gradient(theta[:k], self._a, self._b)
        gradient = np.append(by_group @ by_theta[likelihood.groups.texture], by_sigma)
        return gradient * self._joint.at_scores_slope(u, theta) - u

    def offsets_given(self, u: FloatArray) -> OffsetsGiven | None:
        """Return what the rows tell of shared offsets at draws (n_draw, n_coordinate), if any.

        A calibrated texture, a calibrated step keep the offset that their rows tell of.
        """
        return self.likelihood.given(*self._parts(u))

    def linearised(self, u_coefficient: FloatArray) -> FloatArray:
        """Return the rows' derivatives by the coefficients' coordinates, and their residuals.

        Parameters
        ----------
        u_coefficient : ndarray of float, shape (n_coefficient,)
            Unconstrained coordinates.

        Returns
        -------
        ndarray of float, shape (n_obs, n_coefficient + 1)
            Residuals are of the rows' middles, and last.
        """
        u = np.append(u_coefficient, np.zeros(self.n_parameter - self.n_coefficient))
        theta, jacobian = self._jacobian(u)
        residual = self.rows.centre[0] + 2 * self.log_rates(theta)[self.data.texture]
        return np.column_stack([jacobian[self.data.texture], residual])

    def products(self, u_noise: FloatArray, columns: FloatArray) -> FloatArray:
        """Return X' inverse(Sigma) X of columns X of the rows, for each error model's parameters.

        Parameters
        ----------
        u_noise : ndarray of float, shape (..., n_noise)
            Their unconstrained coordinates; the rows' covariance Sigma follows from them.
        columns : ndarray of float, shape (n_obs, m)
            X.

        Returns
        -------
        ndarray of float, shape (..., m, m)
            Rows that are not normal are taken as such.
        """
        return self.likelihood.products(self._of_noise.at_scores(u_noise), columns)

    def error_variance(self, u_noise: FloatArray) -> FloatArray:
        """Return the mean variance of independent normal rows, shape (...), from (..., n_noise)."""
        sigma = self._of_noise.at_scores(u_noise)[..., 0]
        return sigma**2 + self._known_variance

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
        _, jacobian = self._jacobian(u)
        n = np.bincount(self.data.texture, minlength=len(self._a))
        return (jacobian.T * n) @ jacobian

    def _jacobian(self, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return theta, and d(log load) / d(coefficients' coordinates) but for its sign."""
        theta, k = self.to_theta(u), self.n_coefficient
        with np.errstate(all="ignore"):  # where a search runs off, a coefficient may vanish
            slope = 2 * self._joint.at_scores_slope(u, theta)[:k]
            return theta, slope * self.form.log_rate_gradient(theta[:k], self._a, self._b)

    def _parts(self, u: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return log rates, error parameters and coordinates of offsets that are drawn."""
        theta = self.to_theta(u)
        return self.log_rates(theta), theta[..., self.n_coefficient :], u[..., self.n_parameter :]

    def log_prior_density(self, u: FloatArray) -> FloatArray:
        """Return the log prior density of the parameters in `u`, shape ``u.shape[:-1]``."""
        squares: FloatArray = np.square(u[..., : self.n_parameter].clip(-_HUGE, _HUGE)).sum(-1)
        return -0.5 * (squares + self.n_parameter * _LOG_2PI)
