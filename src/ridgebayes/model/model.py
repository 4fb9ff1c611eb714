r"""The posterior of a form's coefficients and an error model's parameters, given rows.

The model is a latent Gaussian model, or mixed model. Given the *outer* parameters (the form's
coefficients, and scales, lengths and degrees of freedom of the error model), the linear predictor
of a row's log load is

.. math:: \eta = m(\theta) + Z x, \qquad x = L(\phi) s, \qquad s \sim N(0, I),

where x contains shared offsets and the power law's log K. `ridgebayes.model.rows` defines the
densities of rows given their predictors. The scores s are integrated out in
`ridgebayes.inference.latent`.

References: Rue, Martino & Chopin (2009), doi:10.1111/j.1467-9868.2008.00700.x.
"""

from collections.abc import Mapping

import numpy as np

from ridgebayes._types import LOG_2PI, FloatArray, IntArray
from ridgebayes.distributions.distribution import Distribution, LogNormal
from ridgebayes.errors import ComputationError, InputError
from ridgebayes.model.default_priors import replaced_priors
from ridgebayes.model.forms import Form, PowerLaw
from ridgebayes.model.forms.base import MAX_COEFFICIENT
from ridgebayes.model.joint_prior import JointPrior
from ridgebayes.model.noise import Noise
from ridgebayes.model.observations import Observations
from ridgebayes.model.offsets import Offsets
from ridgebayes.model.rows import Rows

MAX_COEFFICIENTS = 20  # one proposal is fitted to all coefficients together
MAX_LATENT_ROWS = 2_000  # a likelihood call takes a few hundredths of a second
_GRADIENT_STEP = 1e-4  # prior sds; step of the differences that check a form's gradient


class Model:
    """A form, an error model, priors and the rows to which they are fitted.

    Parameters
    ----------
    data : Observations
        Rows.
    form : Form
        Contact form; it is bound to the textures of the rows.
    noise : Noise, optional
        Error model; independent normal errors if not given.
    priors : mapping of str to Distribution, optional
        Priors by parameter name: replacements for default priors, and priors of coefficients
        without a default. ``K`` is the prior of all power-law slopes, including those of new
        textures.

    Raises
    ------
    InputError
        If a prior is given for a parameter that the model does not have, or its support begins
        below that of the default; if a prior of K is not log-normal; if a coefficient has neither
        a default nor a given prior; if the form has no load for a row's count.
    ComputationError
        If there are too many offsets, rows or coefficients.

    Notes
    -----
    The last axis of `theta` holds the form's coefficients, then the error model's parameters;
    leading axes are draws. `u` holds their normal scores under the priors. `outer` has the indices
    of the outer parameters, which are sampled: all but the power law's K.
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
        self.tail = self.noise.distribution
        self.priors, self.prior_of_slopes = replaced_priors(self.form, self.noise, priors)
        self.n_coefficient = len(self.form.parameter_names)
        self.has_slopes = isinstance(self.form, PowerLaw)
        # Number of sampled coefficients: all but the power law's.
        self.n_outer_coefficient = 0 if self.has_slopes else self.n_coefficient
        first = self.n_coefficient - self.n_outer_coefficient
        self.outer: IntArray = np.arange(first, len(self.priors))
        self.parameter_names = tuple(self.priors)  # on the last axis of `theta`
        self.outer_names = tuple(self.parameter_names[i] for i in self.outer)
        self.n_parameter, self.n_outer = len(self.priors), len(self.outer)
        self._joint = JointPrior(self.priors.values())
        self._outer_prior = JointPrior([self.priors[name] for name in self.outer_names])
        self._a, self._b = data.a_over_R, data.b_over_R
        self.rows = Rows.of(data, self.form, share_offsets=bool(self.noise.factors))
        slope_sd = None
        if self.has_slopes:
            self._slope_medians, slope_sd = self._slope_priors()
        self.offsets = Offsets(self.noise, data, slope_sd)
        self.is_normal = self.noise.tail == "normal" and bool(self.rows.exact.all())
        self._check_size()

    def _slope_priors(self) -> tuple[FloatArray, FloatArray]:
        """Return logs of the prior medians of K, and prior sds of the textures' log loads."""
        priors = [self.priors[name] for name in self.form.parameter_names]
        for name, prior in zip(self.form.parameter_names, priors, strict=True):
            if not isinstance(prior, LogNormal):
                raise InputError(
                    f"prior of {name!r}: expected log-normal, since log K is integrated in closed "
                    f"form, got {prior.words}"
                )
        medians = np.array([prior.median for prior in priors])  # type: ignore[attr-defined]
        return np.log(medians), 2 * np.array([prior.scale for prior in priors])

    def _check_size(self) -> None:
        n_latent = self.offsets.n_level
        if not self.is_normal and n_latent and len(self.data) > MAX_LATENT_ROWS:
            raise ComputationError(
                f"{self.noise.name}: {len(self.data)} rows; expected at most {MAX_LATENT_ROWS} "
                "where Student errors, brackets or counts share offsets: these have no closed-form "
                "integral"
            )
        if self.n_outer_coefficient > MAX_COEFFICIENTS:
            raise ComputationError(
                f"{self.form.name}: {self.n_outer_coefficient} coefficients; expected at most "
                f"{MAX_COEFFICIENTS}"
            )

    @property
    def given_priors(self) -> dict[str, Distribution]:
        """Priors that rebuild the model: of all parameters, and of all slopes if given."""
        return {**self.priors, **self.prior_of_slopes}

    def log_prior(self, theta: FloatArray) -> FloatArray:
        """Return the log prior density in theta, shape ``theta.shape[:-1]``."""
        return self._joint.log_pdf(theta)

    def to_theta(self, u: FloatArray) -> FloatArray:
        """Convert normal scores to parameters."""
        return self._joint.at_scores(u)

    def to_scores(self, theta: FloatArray) -> FloatArray:
        """Convert parameters to normal scores."""
        return self._joint.scores(theta)

    def outer_theta(self, u: FloatArray) -> FloatArray:
        """Convert normal scores to outer parameters, (..., n_outer)."""
        return self._outer_prior.at_scores(u)

    def log_outer_prior(self, u: FloatArray) -> FloatArray:
        """Return the log prior density of the outer parameters in `u`, shape ``u.shape[:-1]``."""
        squares: FloatArray = np.square(u.clip(-MAX_COEFFICIENT, MAX_COEFFICIENT)).sum(axis=-1)
        return -0.5 * (squares + self.n_outer * LOG_2PI)

    def log_rates(self, theta: FloatArray) -> FloatArray:
        """Return the log rate of each texture, shape (..., n_texture); -inf if not positive.

        Parameters
        ----------
        theta : ndarray of float, shape (..., n_parameter)
            All parameters, K included.

        Raises
        ------
        ComputationError
            If the form returns a rate that is NaN or infinite at finite coefficients.
        InputError
            If the rates have not the shape of draws times textures.
        """
        coefficients = theta[..., : self.n_coefficient]
        rate = self.form.rate(coefficients, self._a, self._b)
        self._check_shape("rate", rate, (*theta.shape[:-1], len(self._a)))
        with np.errstate(divide="ignore", invalid="ignore"):
            value = np.log(rate)
        if np.isfinite(value).all():
            return value
        self._refuse_undefined(coefficients, rate)
        return np.where(rate > 0, value, -np.inf)

    def outer_log_rates(self, theta: FloatArray) -> FloatArray:
        """Return log rates from outer parameters; the power law's are at the prior medians of K."""
        if self.has_slopes:
            return np.broadcast_to(self._slope_medians, (*theta.shape[:-1], len(self._a)))
        return self.log_rates(theta)

    def _refuse_undefined(self, coefficients: FloatArray, rate: FloatArray) -> None:
        """Raise ComputationError if a form returns NaN or infinity at coefficients within range.

        Treating such rates as likelihood zero would silently remove part of the posterior.
        """
        near = np.asarray((np.abs(coefficients) < MAX_COEFFICIENT).all(axis=-1))
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

    def jacobian(self, u: FloatArray) -> FloatArray:
        """Return d (2 log rate) / du of each texture in the outer coefficients' scores.

        Parameters
        ----------
        u : ndarray of float, shape (n_outer,)
            Scores of the outer parameters.

        Returns
        -------
        ndarray of float, shape (n_texture, n_outer_coefficient)
            Minus the derivative of the log load.
        """
        theta, k = self.outer_theta(u), self.n_outer_coefficient
        if not k:
            return np.empty((len(self._a), 0))
        with np.errstate(all="ignore"):  # coefficients can underflow to 0 far from the mode
            slope = 2 * self._outer_prior.at_scores_slope(u, theta)[:k]
            return slope * self.form.log_rate_gradient(theta[:k], self._a, self._b)

    def check_form(self, u: FloatArray) -> None:
        """Raise InputError if the methods of the form contradict each other.

        Pairs have to invert the shape, and the gradient has to match the differences of rates.
        """
        k = self.n_outer_coefficient
        if not k:
            return
        Q, at = self.data.Q, (self._a[self.data.texture], self._b[self.data.texture])
        pairs = self.form.pairs(self.form.shape(Q, *at), *at)
        self._check_shape("pairs", pairs, Q.shape)
        for i in np.flatnonzero((Q > 2) & ~np.isclose(pairs, Q / 2 - 1))[:1]:
            raise InputError(
                f"{self.form.name}: pairs: expected the inverse of shape, {Q[i] / 2 - 1:g} at "
                f"Q = {Q[i]}, got {pairs[i]:g}"
            )
        theta = self.outer_theta(u)
        step = np.zeros(self.n_outer)
        size = np.abs(self.outer_theta(u + _GRADIENT_STEP) - theta)[:k]
        # The step of a vague prior can be far larger than the coefficient.
        size = np.where(theta[:k] == 0, size, np.minimum(size, _GRADIENT_STEP * np.abs(theta[:k])))
        # The cosines differ and none is 0, so that errors of coefficients do not cancel.
        step[:k] = size * np.cos(np.arange(k))
        ahead, behind = theta + step, theta - step
        with np.errstate(all="ignore"):
            change = self.log_rates(ahead) - self.log_rates(behind)
            gradient = self.form.log_rate_gradient(theta[:k], self._a, self._b)
            self._check_shape("log_rate_gradient", gradient, (len(self._a), k))
            claimed = gradient @ (ahead - behind)[:k]
            difference = np.abs(claimed - change)
            largest = np.abs(change).max() + np.abs(claimed).max()
        # If a rate is not positive near the point, the gradient cannot be checked.
        worst = int(np.argmax(difference))
        if np.isfinite(change).all() and not difference[worst] <= 1e-3 * largest + 1e-12:
            a, b = self.data.textures[worst]
            raise InputError(
                f"{self.form.name}: log_rate_gradient: expected the derivative of log rate, got a "
                f"change of {claimed[worst]:.6g} where that of texture a/R = {a!r}, b/R = {b!r} "
                f"changes by {change[worst]:.6g}"
            )

    def _check_shape(self, method: str, values: FloatArray, shape: tuple[int, ...]) -> None:
        if np.shape(values) != shape:
            raise InputError(
                f"{self.form.name}: {method}: expected shape {shape}, got {np.shape(values)}"
            )

    def slopes_given(
        self, total: FloatArray, eta: FloatArray, rng: np.random.Generator
    ) -> tuple[FloatArray, FloatArray]:
        """Split each texture's offset into the parts of log K and of the error model.

        The log load depends on the sum of both parts only. Given the sum, the part of log K is
        normally distributed, and is drawn at random.

        Parameters
        ----------
        total : ndarray of float, shape (n_draw, n_texture)
            Sum of both parts in the log load.
        eta : ndarray of float, shape (n_draw, n_noise)
            Error model parameters.
        rng : numpy.random.Generator
            Source of the draws.

        Returns
        -------
        score, own : ndarray of float, both of shape (n_draw, n_texture)
            Normal scores of K, and the error model's offsets of the textures.
        """
        sd = self.offsets.slope_sd
        assert sd is not None
        own_variance, prior_variance = self.offsets.tau("texture", eta)[:, None] ** 2, sd**2
        with np.errstate(invalid="ignore"):
            share = prior_variance / (prior_variance + own_variance)
        spread = np.sqrt(prior_variance * (1 - share))
        slope = share * total + spread * rng.standard_normal(total.shape)
        return -slope / sd, total - slope
