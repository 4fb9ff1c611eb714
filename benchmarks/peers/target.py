"""The posteriors that every peer samples, in NumPy alone, since a peer's environment has no more.

Three of them, on the same rows: ``hybrid`` and ``modified``, those forms with independent normal
errors, and ``texture+step``, the Hybrid form where the rows of a texture, and the rows of a step,
share a normal offset. There the offsets are integrated out and the rows' covariance is written out
in full, as one would who has no package for it. All densities are normalised, the priors' too, so
that their integral is the evidence. `compare.py` holds them against ridgebayes' own before it runs
anything.
"""

import math
from pathlib import Path

import numpy as np
from scipy.special import erfinv, ndtri

# Kind and fields: median and log sd; mean and sd; sd.
PRIORS = {
    "c": ("log-normal", 1.382, 0.1),
    "c1": ("log-normal", 1.382, 0.1),
    "c2": ("normal", 0.0, 0.05),
    "sigma": ("half-normal", 0.05),
    "tau_texture": ("half-normal", 0.03),
    "tau_step": ("half-normal", 0.03),
}
NAMES = {
    "hybrid": ("c1", "c2", "sigma"),
    "modified": ("c", "sigma"),
    "texture+step": ("c1", "c2", "sigma", "tau_texture", "tau_step"),
}
FORMS = tuple(NAMES)
LOG_2PI = math.log(2 * math.pi)


class Target:
    """One posterior.

    Parameters
    ----------
    form : str
        One of `FORMS`.
    rows : mapping of str to ndarray, shape (n_row,)
        a_over_R, b_over_R, Q and p_over_E.
    """

    def __init__(self, form: str, rows) -> None:
        self.form, self.names = form, NAMES[form]
        self.n = len(self.names)
        self.priors = [PRIORS[name] for name in self.names]
        self.ridge = np.asarray(rows["a_over_R"])
        self.pitch = self.ridge + np.asarray(rows["b_over_R"])
        self.pairs = np.asarray(rows["Q"]) / 2 - 1
        self.log_load = np.log(rows["p_over_E"])
        alike = (self.ridge[:, None] == self.ridge) & (self.pitch[:, None] == self.pitch)
        self.same_texture = alike.astype(float)
        self.same_step = (self.pairs[:, None] == self.pairs).astype(float)

    @classmethod
    def of(cls, form: str, path: Path) -> "Target":
        """Read the rows that `compare.py` wrote."""
        with np.load(path) as rows:
            return cls(form, dict(rows))

    @property
    def has_offsets(self) -> bool:
        """Whether rows share offsets."""
        return self.form == "texture+step"

    def log_probability_of_one(self, theta: np.ndarray) -> float:
        """Return the log posterior density at one point, shape (n,)."""
        log_prior = self.log_prior_of_one(theta)
        if log_prior == -math.inf:
            return -math.inf
        return log_prior + self.log_likelihood_of_one(theta)

    def log_prior_of_one(self, theta: np.ndarray) -> float:
        """Return the log prior density at one point."""
        total = 0.0
        for x, (kind, *fields) in zip(theta.tolist(), self.priors, strict=True):
            if kind != "normal" and x <= 0:
                return -math.inf
            if kind == "log-normal":
                median, sd = fields
                total += -0.5 * (math.log(x / median) / sd) ** 2 - math.log(x * sd) - LOG_2PI / 2
            elif kind == "normal":
                mean, sd = fields
                total += -0.5 * ((x - mean) / sd) ** 2 - math.log(sd) - LOG_2PI / 2
            else:
                (sd,) = fields
                total += -0.5 * (x / sd) ** 2 - math.log(sd) + 0.5 * math.log(2 / math.pi)
        return total

    def log_likelihood_of_one(self, theta: np.ndarray) -> float:
        """Return the log likelihood at one point that the prior allows."""
        rate = self._rate(theta)
        if np.any(rate <= 0):
            return -math.inf
        residual = self.log_load - 2 * np.log(self.pairs / rate)
        if not self.has_offsets:
            sigma = theta[-1]
            return float(
                np.sum(-0.5 * (residual / sigma) ** 2 - np.log(sigma) - 0.5 * np.log(2 * np.pi))
            )
        try:
            factor = np.linalg.cholesky(self._covariance(theta))
        except np.linalg.LinAlgError:  # sigma so small that rounding errors are larger
            return -math.inf
        half = np.linalg.solve(factor, residual)
        log_root = np.log(np.diagonal(factor)).sum()
        return float(-0.5 * half @ half - log_root - 0.5 * len(residual) * LOG_2PI)

    def log_probability(self, theta: np.ndarray) -> np.ndarray:
        """Return the log posterior density at many points, from (m, n) to (m,)."""
        log_prior = self.log_prior(theta)
        value = np.full(len(theta), -np.inf)
        allowed = np.isfinite(log_prior)
        value[allowed] = log_prior[allowed] + self.log_likelihood(theta[allowed])
        return value

    def log_prior(self, theta: np.ndarray) -> np.ndarray:
        """Return the log prior density at many points."""
        total = np.zeros(len(theta))
        for x, (kind, *fields) in zip(theta.T, self.priors, strict=True):
            if kind == "normal":
                mean, sd = fields
                total += -0.5 * ((x - mean) / sd) ** 2 - math.log(sd) - LOG_2PI / 2
                continue
            inside = x > 0
            x = np.where(inside, x, 1.0)
            if kind == "log-normal":
                median, sd = fields
                log_x = np.log(x)
                total += -0.5 * ((log_x - math.log(median)) / sd) ** 2 - log_x
                total -= math.log(sd) + LOG_2PI / 2
            else:
                (sd,) = fields
                total += -0.5 * (x / sd) ** 2 - math.log(sd) + 0.5 * math.log(2 / math.pi)
            total[~inside] = -np.inf
        return total

    def log_likelihood(self, theta: np.ndarray) -> np.ndarray:
        """Return the log likelihood at many points that the prior allows."""
        rate = self._rate(theta)
        inside = np.all(rate > 0, axis=1)
        if not inside.all():
            value = np.full(len(theta), -np.inf)
            if inside.any():
                value[inside] = self.log_likelihood(theta[inside])
            return value
        residual = self.log_load - 2 * np.log(self.pairs / rate)
        n_row = len(self.log_load)
        if not self.has_offsets:
            sigma = theta[:, -1]
            value = -0.5 * np.sum(residual**2, axis=1) / sigma**2
            return value - n_row * (np.log(sigma) + LOG_2PI / 2)
        try:
            factor = np.linalg.cholesky(self._covariance(theta))
        except np.linalg.LinAlgError:  # one of them: find out which
            return np.array([self.log_likelihood_of_one(one) for one in theta])
        half = np.linalg.solve(factor, residual[..., None])[..., 0]
        log_root = np.log(np.diagonal(factor, axis1=1, axis2=2)).sum(axis=1)
        return -0.5 * np.sum(half**2, axis=1) - log_root - 0.5 * n_row * LOG_2PI

    def from_cube(self, cube: np.ndarray) -> np.ndarray:
        """Return parameters from prior probabilities below them, shape (..., n)."""
        theta = np.empty(np.shape(cube))
        for i, (kind, *fields) in enumerate(self.priors):
            if kind == "log-normal":
                median, sd = fields
                theta[..., i] = median * np.exp(sd * ndtri(cube[..., i]))
            elif kind == "normal":
                mean, sd = fields
                theta[..., i] = mean + sd * ndtri(cube[..., i])
            else:
                (sd,) = fields
                theta[..., i] = sd * math.sqrt(2) * erfinv(cube[..., i])
        return theta

    def prior_draws(self, n: int, seed: int) -> np.ndarray:
        """Return draws from the prior, shape (n, n_parameter)."""
        return self.from_cube(np.random.default_rng(seed).random((n, self.n)))

    def start(self, n: int, seed: int) -> np.ndarray:
        """Return points near the prior's centre, shape (n, n_parameter): where ensembles start.

        Each parameter between its prior's 45 % and 55 % quantiles. That costs nothing and needs no
        optimiser. Draws from all of the prior would have some with a sigma near zero, a log density
        of minus millions there, and slice steps that carry such a walker far out, for good.
        """
        cube = np.random.default_rng(seed).random((n, self.n))
        return self.from_cube(0.45 + 0.1 * cube)

    def _rate(self, theta: np.ndarray) -> np.ndarray:
        if self.form == "modified":
            return theta[..., :1] / self.pitch
        return theta[..., :1] / self.pitch + theta[..., 1:2] / self.ridge

    def _covariance(self, theta: np.ndarray) -> np.ndarray:
        own, texture, step = (theta[..., i, None, None] ** 2 for i in (2, 3, 4))
        return own * np.eye(len(self.pairs)) + texture * self.same_texture + step * self.same_step
