"""Prior distributions of coefficients and error scales, and the defaults.

Each prior is a small frozen record with a normalised log density. `stretched` widens it by a
factor, which is how Bayes factors are shown against every prior scale.

Sampling and integration run in normal scores: u is where a standard normal has the prior's
probability. There every prior is a standard normal, a scale that tends to zero falls off like one
too, and nothing is cut off: tails are computed from log probabilities, not from a unit cube.
"""

import json
import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import asdict, astuple, dataclass, replace
from typing import Any, ClassVar

import numpy as np
from scipy import special

from ridgebayes._types import FloatArray, Json
from ridgebayes.errors import InputError
from ridgebayes.model.forms import Form, PowerLaw
from ridgebayes.model.noise import Noise

_LOG_2PI = math.log(2 * math.pi)
HERTZ = 1.382  # the smooth Hertz coefficient at nu = 0.5, as the paper prints it


@dataclass(frozen=True)
class Prior(ABC):
    """One parameter's prior density.

    `positive` says whether the parameter lives on (0, inf) or on the whole line. `scale_name` is
    the field that says how wide the prior is.
    """

    kind: ClassVar[str]
    positive: ClassVar[bool]
    scale_name: ClassVar[str]

    def __post_init__(self) -> None:
        for name, value in asdict(self).items():
            positive = name != "mean"
            if not math.isfinite(value) or (positive and value <= 0):
                rule = "finite and > 0" if positive else "finite"
                raise InputError(f"{self.kind} prior: expected {rule}, got {name} = {value!r}")

    @staticmethod
    @abstractmethod
    def log_density(x: Any, *fields: Any) -> FloatArray:
        """Return the log density for fields given as numbers or arrays; -inf off the support."""

    @staticmethod
    @abstractmethod
    def at_score(u: Any, *fields: Any) -> FloatArray:
        """Return the value whose prior probability is a standard normal's at `u`."""

    @staticmethod
    @abstractmethod
    def score(x: Any, *fields: Any) -> FloatArray:
        """Return the normal score of a value inside the support: the inverse of `at_score`."""

    @staticmethod
    @abstractmethod
    def at_score_slope(u: Any, x: Any, *fields: Any) -> FloatArray:
        """Return dx/du at a score and its value."""

    def log_pdf(self, x: FloatArray) -> FloatArray:
        """Return the log density at `x`, elementwise; -inf outside the support."""
        return self.log_density(x, *astuple(self))

    def value_at(self, u: FloatArray | float) -> FloatArray:
        """Return the value at normal score `u`, elementwise."""
        return self.at_score(u, *astuple(self))

    def slope_at(self, u: FloatArray | float) -> FloatArray:
        """Return d value_at / du, elementwise."""
        return self.at_score_slope(u, self.value_at(u), *astuple(self))

    @abstractmethod
    def rvs(self, rng: np.random.Generator, size: int) -> FloatArray:
        """Return `size` draws, shape (size,)."""

    @property
    def scale(self) -> float:
        """How wide the prior is, in the unit of `scale_name`."""
        return float(getattr(self, self.scale_name))

    def stretched(self, factor: float) -> "Prior":
        """Return the same prior with its scale multiplied by `factor`."""
        return replace(self, **{self.scale_name: self.scale * factor})

    def describe(self) -> Json:
        """Return kind and numbers, ready for a file."""
        return {"kind": self.kind, **asdict(self)}


@dataclass(frozen=True)
class LogNormal(Prior):
    """Log-normal: log x is normal about log(median) with standard deviation log_sd.

    Examples
    --------
    >>> round(float(LogNormal(1.0, 0.5).log_pdf(np.array(1.0))), 12)
    -0.225791352645
    """

    median: float
    log_sd: float
    kind: ClassVar[str] = "log-normal"
    positive: ClassVar[bool] = True
    scale_name: ClassVar[str] = "log_sd"

    @staticmethod
    def log_density(x: Any, *fields: Any) -> FloatArray:
        median, log_sd = fields
        with np.errstate(divide="ignore", invalid="ignore"):
            log_x = np.log(x)
            z = (log_x - np.log(median)) / log_sd
            value = -0.5 * z * z - log_x - np.log(log_sd) - 0.5 * _LOG_2PI
        return np.where(np.greater(x, 0), value, -np.inf)

    @staticmethod
    def at_score(u: Any, *fields: Any) -> FloatArray:
        median, log_sd = fields
        with np.errstate(over="ignore"):
            return median * np.exp(log_sd * u)

    @staticmethod
    def score(x: Any, *fields: Any) -> FloatArray:
        median, log_sd = fields
        return np.log(x / median) / log_sd

    @staticmethod
    def at_score_slope(u: Any, x: Any, *fields: Any) -> FloatArray:
        _, log_sd = fields
        return log_sd * x

    def rvs(self, rng: np.random.Generator, size: int) -> FloatArray:
        return self.median * np.exp(self.log_sd * rng.standard_normal(size))


@dataclass(frozen=True)
class Normal(Prior):
    """Normal with mean and standard deviation.

    Examples
    --------
    >>> round(float(Normal(0.0, 1.0).log_pdf(np.array(0.0))), 12)
    -0.918938533205
    """

    mean: float
    sd: float
    kind: ClassVar[str] = "normal"
    positive: ClassVar[bool] = False
    scale_name: ClassVar[str] = "sd"

    @staticmethod
    def log_density(x: Any, *fields: Any) -> FloatArray:
        mean, sd = fields
        z = (np.asarray(x) - mean) / sd
        return -0.5 * z * z - np.log(sd) - 0.5 * _LOG_2PI

    @staticmethod
    def at_score(u: Any, *fields: Any) -> FloatArray:
        mean, sd = fields
        return mean + sd * np.asarray(u)

    @staticmethod
    def score(x: Any, *fields: Any) -> FloatArray:
        mean, sd = fields
        return (np.asarray(x) - mean) / sd

    @staticmethod
    def at_score_slope(u: Any, x: Any, *fields: Any) -> FloatArray:
        _, sd = fields
        return sd + 0 * np.asarray(u)

    def rvs(self, rng: np.random.Generator, size: int) -> FloatArray:
        return self.mean + self.sd * rng.standard_normal(size)


@dataclass(frozen=True)
class HalfNormal(Prior):
    """Half-normal on (0, inf): the absolute value of a normal with standard deviation sd.

    Examples
    --------
    >>> round(float(HalfNormal(1.0).log_pdf(np.array(1e-300))), 12)
    -0.225791352645
    """

    sd: float
    kind: ClassVar[str] = "half-normal"
    positive: ClassVar[bool] = True
    scale_name: ClassVar[str] = "sd"

    @staticmethod
    def log_density(x: Any, *fields: Any) -> FloatArray:
        (sd,) = fields
        z = np.asarray(x) / sd
        value = -0.5 * z * z - np.log(sd) + 0.5 * math.log(2 / math.pi)
        return np.where(np.greater(x, 0), value, -np.inf)

    @staticmethod
    def at_score(u: Any, *fields: Any) -> FloatArray:
        (sd,) = fields
        u = np.asarray(u, dtype=float)
        # The smaller of P(X <= x) = erf(x / sd sqrt 2) and its complement, so that none cancels.
        tail, low = special.ndtr(-np.abs(u)), u < 0
        if low.all():
            return sd * (math.sqrt(2) * special.erfinv(tail))
        z = math.sqrt(2) * np.where(low, special.erfinv(tail), special.erfcinv(tail))
        if np.any(far := u > 35):  # where even the tail underflows, its logarithm does not
            log_half_tail = special.log_ndtr(-np.where(far, u, 0)) - math.log(2)
            z = np.where(far, -special.ndtri_exp(log_half_tail), z)
        return sd * z

    @staticmethod
    def score(x: Any, *fields: Any) -> FloatArray:
        (sd,) = fields
        z = np.asarray(x) / sd
        with np.errstate(divide="ignore"):
            low = special.ndtri_exp(np.log(special.erf(z / math.sqrt(2))))
        high = -special.ndtri_exp(np.minimum(special.log_ndtr(-z) + math.log(2), 0.0))
        return np.where(z < 0.67, low, high)

    @staticmethod
    def at_score_slope(u: Any, x: Any, *fields: Any) -> FloatArray:
        (sd,) = fields
        z = np.asarray(x) / sd
        return 0.5 * sd * np.exp(0.5 * (z - u) * (z + u))  # standard normal over this density

    def rvs(self, rng: np.random.Generator, size: int) -> FloatArray:
        return np.abs(self.sd * rng.standard_normal(size))


@dataclass(frozen=True)
class Gamma(Prior):
    """Gamma on (0, inf) with shape and rate: mean shape/rate.

    Examples
    --------
    >>> round(float(Gamma(2.0, 0.1).log_pdf(np.array(10.0))), 12)
    -3.302585092994
    """

    shape: float
    rate: float
    kind: ClassVar[str] = "gamma"
    positive: ClassVar[bool] = True
    scale_name: ClassVar[str] = "rate"

    @staticmethod
    def log_density(x: Any, *fields: Any) -> FloatArray:
        shape, rate = fields
        with np.errstate(divide="ignore", invalid="ignore"):
            value = shape * np.log(rate) + (shape - 1) * np.log(x) - rate * np.asarray(x)
            value = value - special.gammaln(shape)
        return np.where(np.greater(x, 0), value, -np.inf)

    @staticmethod
    def at_score(u: Any, *fields: Any) -> FloatArray:
        shape, rate = fields
        u = np.asarray(u, dtype=float)
        # The smaller of the two tail probabilities, so that none cancels.
        tail = special.ndtr(-np.abs(u))
        with np.errstate(under="ignore"):
            x = np.where(u < 0, special.gammaincinv(shape, tail), special.gammainccinv(shape, tail))
        if np.any(low := u < -37):  # where the tail underflows, P is x^shape / Gamma(shape + 1)
            log_tail = special.log_ndtr(np.where(low, u, 0))
            x = np.where(low, np.exp((log_tail + special.gammaln(shape + 1)) / shape), x)
        return x / rate

    @staticmethod
    def score(x: Any, *fields: Any) -> FloatArray:
        shape, rate = fields
        z = np.asarray(x) * rate
        low, high = special.gammainc(shape, z), special.gammaincc(shape, z)
        return np.where(low < high, special.ndtri(low), -special.ndtri(high))

    @staticmethod
    def at_score_slope(u: Any, x: Any, *fields: Any) -> FloatArray:
        u = np.asarray(u, dtype=float)
        return np.exp(-0.5 * (u * u + _LOG_2PI) - Gamma.log_density(x, *fields))

    def stretched(self, factor: float) -> "Gamma":
        """Return the prior with its mean and width multiplied by `factor`."""
        return replace(self, rate=self.rate / factor)

    def rvs(self, rng: np.random.Generator, size: int) -> FloatArray:
        return rng.gamma(self.shape, 1 / self.rate, size)


class JointPrior:
    """The independent product of priors, evaluated for all parameters of a kind at once.

    Parameters
    ----------
    priors : iterable of Prior
        One per parameter, in the order of the last axis of `theta`.
    """

    def __init__(self, priors: Iterable[Prior]) -> None:
        self._priors = tuple(priors)
        self._groups: list[tuple[type[Prior], list[int], list[FloatArray]]] = []
        for kind in dict.fromkeys(type(prior) for prior in self._priors):
            columns = [i for i, prior in enumerate(self._priors) if type(prior) is kind]
            rows = [astuple(self._priors[i]) for i in columns]
            self._groups.append((kind, columns, [np.array(f) for f in zip(*rows, strict=True)]))

    def log_pdf(self, theta: FloatArray) -> FloatArray:
        """Return the joint log density, shape ``theta.shape[:-1]``."""
        total = np.zeros(theta.shape[:-1])
        for kind, columns, fields in self._groups:
            total += kind.log_density(theta[..., columns], *fields).sum(axis=-1)
        return total

    def at_scores(self, u: FloatArray) -> FloatArray:
        """Return the parameters at normal scores `u`, shape of `u`."""
        theta = np.empty(u.shape)
        for kind, columns, fields in self._groups:
            theta[..., columns] = kind.at_score(u[..., columns], *fields)
        return theta

    def scores(self, theta: FloatArray) -> FloatArray:
        """Return the normal scores of parameters, shape of `theta`."""
        u = np.empty(theta.shape)
        for kind, columns, fields in self._groups:
            u[..., columns] = kind.score(theta[..., columns], *fields)
        return u

    def at_scores_slope(self, u: FloatArray, theta: FloatArray) -> FloatArray:
        """Return d theta / du of each parameter, shape of `u`."""
        slope = np.empty(u.shape)
        for kind, columns, fields in self._groups:
            slope[..., columns] = kind.at_score_slope(u[..., columns], theta[..., columns], *fields)
        return slope

    def rvs(self, rng: np.random.Generator, size: int) -> FloatArray:
        """Return draws of all parameters, shape (size, n_parameter)."""
        return np.stack([prior.rvs(rng, size) for prior in self._priors], axis=-1)


def default_priors(
    form: Form, noise: Noise | None = None, given: Mapping[str, Prior] | None = None
) -> dict[str, Prior]:
    """Return the default prior of each parameter of a form and an error model.

    Parameters
    ----------
    form : Form
        A form; PowerLaw bound to its textures.
    noise : Noise, optional
        Error model; independent normal errors if not given.
    given : mapping of str to Prior, optional
        Priors of coefficients that have no default: those of forms not of this package.

    Returns
    -------
    dict of str to Prior
        Coefficients, then the error model's parameters, sigma first.

    Raises
    ------
    InputError
        If a coefficient has no default and none is given.

    Examples
    --------
    >>> from ridgebayes.model.forms import Hybrid
    >>> list(default_priors(Hybrid()))
    ['c1', 'c2', 'sigma']
    """
    priors: dict[str, Prior]
    if isinstance(form, PowerLaw):
        # K = 2 c / L: smooth Hertz at the texture's pitch, known to 30 %.
        priors = {
            name: LogNormal(2 * HERTZ / (a + b), 0.3)
            for name, (a, b) in zip(form.parameter_names, form.textures, strict=True)
        }
    else:
        known: dict[str, Prior] = {
            "c": LogNormal(1.0 if form.name == "half-plane" else HERTZ, 0.1),
            "c1": LogNormal(HERTZ, 0.1),
            "c2": Normal(0.0, 0.05),
        }
        own = {name: prior for name, prior in (given or {}).items() if name not in _NOISE}
        lost = [name for name in form.parameter_names if name not in known | own]
        if lost:
            raise InputError(
                f"{form.name}: no prior of {', '.join(map(repr, lost))} given; expected "
                "coefficients "
                f"other than {', '.join(known)} have no default, pass priors={{name: prior}}"
            )
        priors = {name: (own | known)[name] for name in form.parameter_names}
    return priors | {name: _NOISE[name] for name in (noise or Noise()).parameter_names}


_NOISE: dict[str, Prior] = {
    "sigma": HalfNormal(0.05),
    "tau_texture": HalfNormal(0.03),
    "tau_step": HalfNormal(0.03),
    # Of a smooth offset: in log h, where the steps 4 and 6 are 0.7 apart, and in a/pitch, which
    # lies between 0 and 1.
    "length_h": LogNormal(1.0, 0.7),
    "length_ratio": LogNormal(0.3, 0.7),
    "df": Gamma(2.0, 0.1),
}


def priors_from_json(text: str) -> dict[str, Prior]:
    """Return priors from the JSON text that `priors_to_json` wrote."""
    kinds = {kind.kind: kind for kind in Prior.__subclasses__()}
    return {name: kinds[fields.pop("kind")](**fields) for name, fields in json.loads(text).items()}


def priors_to_json(priors: Mapping[str, Prior]) -> str:
    """Return priors as JSON text."""
    return json.dumps({name: prior.describe() for name, prior in priors.items()})
