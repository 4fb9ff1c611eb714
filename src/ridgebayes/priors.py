"""Prior distributions of coefficients and error scales, and the defaults.

Each prior is a small frozen record with a normalised log density. `stretched` widens it by a
factor, which is how Bayes factors are shown against every prior scale.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable
from dataclasses import asdict, astuple, dataclass, replace
from typing import Any, ClassVar

import numpy as np

from ridgebayes._types import FloatArray, Json
from ridgebayes.errors import InputError
from ridgebayes.forms import Form, PowerLaw

_LOG_2PI = math.log(2 * math.pi)
HERTZ = 1.382  # the smooth Hertz coefficient at nu = 0.5, as the paper prints it


@dataclass(frozen=True)
class Prior(ABC):
    """One parameter's prior density.

    `positive` says whether the parameter lives on (0, inf) and is sampled by its logarithm, or on
    the whole line. `scale_name` is the field that says how wide the prior is.
    """

    kind: ClassVar[str]
    positive: ClassVar[bool]
    scale_name: ClassVar[str]

    def __post_init__(self) -> None:
        for name, value in asdict(self).items():
            positive = name != "mean"
            if not math.isfinite(value) or (positive and value <= 0):
                rule = "finite and > 0" if positive else "finite"
                raise InputError(f"{self.kind} prior: {name} = {value!r} given; rule: {rule}")

    @staticmethod
    @abstractmethod
    def log_density(x: Any, *fields: Any) -> FloatArray:
        """Return the log density for fields given as numbers or arrays; -inf off the support."""

    @staticmethod
    @abstractmethod
    def log_density_slope(x: Any, *fields: Any) -> FloatArray:
        """Return d log_density / dx inside the support."""

    def log_pdf(self, x: FloatArray) -> FloatArray:
        """Return the log density at `x`, elementwise; -inf outside the support."""
        return self.log_density(x, *astuple(self))

    @abstractmethod
    def rvs(self, rng: np.random.Generator, size: int) -> FloatArray:
        """Return `size` draws, shape (size,)."""

    @property
    @abstractmethod
    def centre(self) -> float:
        """A point of high density inside the support, where searches start."""

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
    def log_density_slope(x: Any, *fields: Any) -> FloatArray:
        median, log_sd = fields
        return -(np.log(x / median) / log_sd**2 + 1) / x

    def rvs(self, rng: np.random.Generator, size: int) -> FloatArray:
        return self.median * np.exp(self.log_sd * rng.standard_normal(size))

    @property
    def centre(self) -> float:
        return self.median


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
    def log_density_slope(x: Any, *fields: Any) -> FloatArray:
        mean, sd = fields
        return -(np.asarray(x) - mean) / sd**2

    def rvs(self, rng: np.random.Generator, size: int) -> FloatArray:
        return self.mean + self.sd * rng.standard_normal(size)

    @property
    def centre(self) -> float:
        return self.mean


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
    def log_density_slope(x: Any, *fields: Any) -> FloatArray:
        (sd,) = fields
        return -np.asarray(x) / sd**2

    def rvs(self, rng: np.random.Generator, size: int) -> FloatArray:
        return np.abs(self.sd * rng.standard_normal(size))

    @property
    def centre(self) -> float:
        return 0.5 * self.sd


class JointPrior:
    """The independent product of priors, evaluated for all parameters of a kind at once.

    Parameters
    ----------
    priors : iterable of Prior
        One per parameter, in the order of the last axis of `theta`.
    """

    def __init__(self, priors: Iterable[Prior]) -> None:
        self._priors = tuple(priors)
        self.positive = np.array([prior.positive for prior in self._priors])
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

    def log_pdf_gradient(self, theta: FloatArray) -> FloatArray:
        """Return d log_pdf / d theta, shape of `theta`."""
        gradient = np.empty(theta.shape)
        for kind, columns, fields in self._groups:
            gradient[..., columns] = kind.log_density_slope(theta[..., columns], *fields)
        return gradient

    def rvs(self, rng: np.random.Generator, size: int) -> FloatArray:
        """Return draws of all parameters, shape (size, n_parameter)."""
        return np.stack([prior.rvs(rng, size) for prior in self._priors], axis=-1)


def default_priors(form: Form) -> dict[str, Prior]:
    """Return the default prior of each coefficient of a form and of the error scale sigma.

    Parameters
    ----------
    form : Form
        A form; PowerLaw bound to its textures.

    Returns
    -------
    dict of str to Prior
        In the order of the parameters, sigma last.

    Examples
    --------
    >>> from ridgebayes.forms import Hybrid
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
        priors = {name: known[name] for name in form.parameter_names}
    return priors | {"sigma": HalfNormal(0.05)}
