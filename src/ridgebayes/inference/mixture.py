r"""A posterior as a Gaussian mixture: a few numbers that other programs can take as a prior.

The mixture is of normal scores z of the parameters under simple distributions, the *transforms*: a
parameter is the value below which its transform has a standard normal's probability. A transform is
the parameter's prior where that has a closed form in every program, else a log-normal or a normal
of the draws, cut off where the prior is. Fitted by expectation maximisation, which keeps the draws'
mean and covariance of z whatever the number of components; that number is chosen by the density of
draws that were left out.
"""

import json
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy import linalg, special

from ridgebayes._types import FloatArray, Json, Rng, __version__
from ridgebayes.distributions.bounded import Truncated, Uniform
from ridgebayes.distributions.distribution import Distribution, HalfNormal, LogNormal, Normal
from ridgebayes.distributions.grammar import from_dict, to_dict
from ridgebayes.errors import InputError
from ridgebayes.inference.posterior import Posterior
from ridgebayes.model.joint_prior import JointPrior
from ridgebayes.runtime.atomic import write_text
from ridgebayes.runtime.randomness import seeded, stream
from ridgebayes.runtime.reading import LARGEST_TEXT, read_text
from ridgebayes.runtime.text import one_line_message

_MOST_COMPONENTS, _MOST_PARAMETERS = 8, 40
_MOST_STEPS, _SETTLED = 200, 2e-5  # nats of the mean log density
_FLOOR = 1e-6  # of the draws' variance, which no component falls below
_N_COMPARED = 100_000
_CLOSED = (Normal, LogNormal, HalfNormal, Uniform)
_FORMAT = "ridgebayes posterior mixture 1"
_LOG_2PI = math.log(2 * math.pi)


@dataclass(frozen=True, eq=False)
class PosteriorMixture:
    """A posterior as a Gaussian mixture, made by `Fit.to_mixture`.

    Parameters
    ----------
    names : tuple of str, length n_parameter
        Parameters.
    transforms : tuple of Distribution, length n_parameter
        A parameter is the value with the normal score z under its transform.
    weights : ndarray of float, shape (n_component,)
        Of the components; they add up to 1.
    means : ndarray of float, shape (n_component, n_parameter)
        Of z.
    covariances : ndarray of float, shape (n_component, n_parameter, n_parameter)
        Of z.
    about : dict
        Where it comes from: form, noise, converged, priors, rows, range of validity, held-out
        scores, and its distance from the draws.

    Examples
    --------
    >>> import ridgebayes as rb
    >>> fit = rb.calibrate(rb.paper_sweep(), rb.Modified(), noise="iid", rng=1)
    >>> mixture = fit.to_mixture()
    >>> mixture.names, mixture.rvs(1000, rng=1).mean(axis=0).round(2).tolist()
    (('c', 'sigma'), [1.37, 0.03])
    >>> mixture.log_pdf(fit.draws).shape == (len(fit.draws),)
    True
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     mixture.to_json(f"{folder}/m.json")
    ...     rb.PosteriorMixture.from_json(f"{folder}/m.json").to_dict() == mixture.to_dict()
    True
    """

    names: tuple[str, ...]
    transforms: tuple[Distribution, ...]
    weights: FloatArray
    means: FloatArray
    covariances: FloatArray
    about: Json = field(repr=False)

    def __repr__(self) -> str:
        n, about = len(self.weights), self.about
        return (
            f"{type(self).__name__}({about['form']}, {about['noise']}: {', '.join(self.names)}; "
            f"{n} component{'s' if n > 1 else ''})"
        )

    def rvs(self, n: int, *, rng: Rng = 0) -> FloatArray:
        """Draw parameters.

        Parameters
        ----------
        n : int
            Draws.
        rng : int or numpy.random.Generator, optional
            Seed.

        Returns
        -------
        ndarray of float, shape (n, n_parameter)
            Parameters in the order of `names`.
        """
        generator = seeded(rng)
        which = generator.choice(len(self.weights), size=n, p=self.weights)
        normal = generator.standard_normal((n, len(self.names)))
        factors = np.linalg.cholesky(self.covariances)
        z = self.means[which] + np.einsum("nij,nj->ni", factors[which], normal)
        return JointPrior(self.transforms).at_scores(z)

    def log_pdf(self, theta: FloatArray) -> FloatArray:
        """Return the log density of parameters.

        Parameters
        ----------
        theta : ndarray of float, shape (..., n_parameter)
            Parameters in the order of `names`.

        Returns
        -------
        ndarray of float, shape (...)
            Normalised, natural log; -inf where a parameter is outside its support.
        """
        theta = np.asarray(theta, dtype=float)
        ends = np.array([one.support for one in self.transforms])
        inside = np.asarray(((theta > ends[:, 0]) & (theta < ends[:, 1])).all(axis=-1))
        joint = JointPrior(self.transforms)
        with np.errstate(all="ignore"):
            z = np.where(inside[..., None], joint.scores(theta), 0.0)
            normal = -0.5 * (z * z + _LOG_2PI).sum(axis=-1)
            found = _component_log_densities(z, self.weights, self.means, self.covariances)
            value = special.logsumexp(found, axis=-1) + joint.log_pdf(theta) - normal
        return np.where(inside, value, -np.inf)

    def to_dict(self) -> Json:
        """Return plain values.

        Returns
        -------
        dict
            As `to_json` writes it.
        """
        return {
            "format": _FORMAT,
            "names": list(self.names),
            "transforms": [to_dict(one) for one in self.transforms],
            "weights": self.weights.tolist(),
            "means": self.means.tolist(),
            "covariances": self.covariances.tolist(),
            **self.about,
        }

    def to_json(self, path: str | os.PathLike[str]) -> None:
        """Write a file.

        Parameters
        ----------
        path : path
            File, whole or not at all; one that is there is replaced.
        """
        write_text(json.dumps(self.to_dict(), indent=1) + "\n", Path(path))

    @classmethod
    def from_json(cls, path: str | os.PathLike[str]) -> "PosteriorMixture":
        """Read what `to_json` wrote.

        Parameters
        ----------
        path : path
            File.

        Returns
        -------
        PosteriorMixture
            The same mixture.

        Raises
        ------
        InputError
            If the file is missing, or not such a file.
        """
        text = read_text(Path(path), LARGEST_TEXT)
        try:
            given = json.loads(text)
            if given.pop("format") != _FORMAT:
                raise ValueError("another format")
            names = tuple(map(str, given.pop("names")))
            transforms = tuple(from_dict(one) for one in given.pop("transforms"))
            weights, means, covariances = (
                np.array(given.pop(key), float) for key in ("weights", "means", "covariances")
            )
            k, d = len(weights), len(names)
            shapes = [one.shape for one in (weights, means, covariances)]
            if shapes != [(k,), (k, d), (k, d, d)] or len(transforms) != d:
                raise ValueError("numbers of other shapes")
            np.linalg.cholesky(covariances)
            if not (
                np.isfinite(means).all() and (weights > 0).all() and abs(weights.sum() - 1) < 1e-9
            ):
                raise ValueError("weights that do not add up to 1, or means that are not finite")
            made = cls(names, transforms, weights, means, covariances, given)
            repr(made)
        except InputError:
            raise
        # Damage turns up as errors of many kinds.
        except Exception as error:
            raise InputError(
                f"{path}: expected a file of PosteriorMixture.to_json ({one_line_message(error)})"
            ) from None
        return made


def fit_mixture(
    posterior: Posterior, validity: Mapping[str, object], n_component: int | None = None
) -> PosteriorMixture:
    """Fit a mixture to a posterior's draws.

    Parameters
    ----------
    posterior : Posterior
        Its thinned draws are fitted, their ensembles left out in turn.
    validity : mapping
        Range that it was calibrated on, as plain values.
    n_component : int, optional
        Components; chosen by held-out draws if not given.

    Raises
    ------
    InputError
        If there are more than 40 parameters, or `n_component` is not 1 to 8.
    """
    model = posterior.model
    if model.n_parameter > _MOST_PARAMETERS:
        raise InputError(
            f"{posterior.form.name}: {model.n_parameter} parameters; expected at most "
            f"{_MOST_PARAMETERS} for a mixture"
        )
    if n_component is not None and n_component not in range(1, _MOST_COMPONENTS + 1):
        raise InputError(f"n_component: expected 1 to {_MOST_COMPONENTS}, got {n_component!r}")
    theta = posterior.draws
    transforms = tuple(
        _transform(prior, theta[:, i]) for i, prior in enumerate(model.priors.values())
    )
    z = JointPrior(transforms).scores(theta)
    centre, factor = z.mean(axis=0), np.linalg.cholesky(np.cov(z.T).reshape(2 * z.shape[1:]))
    white = linalg.solve_triangular(factor, (z - centre).T, lower=True).T
    rng = stream(posterior.seed, "mixture")
    scores: dict[str, float] = {}
    if n_component is None:
        n_component, scores = _chosen(white, len(posterior.chains.u), rng)
    weights, means, covariances = _fitted(white, n_component, rng)
    order = np.argsort(-weights)
    about: Json = {
        "form": posterior.form.name,
        "noise": posterior.noise.name,
        "converged": posterior.converged,
        "priors": {name: to_dict(prior) for name, prior in model.priors.items()},
        "fitted_rows": len(model.data),
        "fitted_rows_digest": model.data.digest(),
        "validity": dict(validity),
        "held_out_log_density": scores,
        "ridgebayes_version": __version__,
    }
    covariances = factor @ covariances[order] @ factor.T
    means = centre + means[order] @ factor.T
    made = PosteriorMixture(
        model.parameter_names, transforms, weights[order], means, covariances, about
    )
    about["distance"] = _distance(made, theta, posterior.seed)
    return made


def _transform(prior: Distribution, draws: FloatArray) -> Distribution:
    """Return the prior, or what stands for it where programs have no closed form of it."""
    if isinstance(prior, Truncated):
        return Truncated(_transform(prior.base, draws), prior.low, prior.high)
    if isinstance(prior, _CLOSED):
        return prior
    if prior.support[0] < 0:
        return Normal(float(draws.mean()), float(draws.std()))
    logs = np.log(draws)
    return LogNormal(float(np.exp(logs.mean())), float(logs.std()))


def _chosen(
    z: FloatArray, n_ensemble: int, rng: np.random.Generator
) -> tuple[int, dict[str, float]]:
    """Return the number of components, and the mean log density of draws left out for each.

    It is the smallest within one standard error of the best; more are not tried after one that is
    no better.
    """
    # Draws run ensemble by ensemble: halves of whole ensembles are independent of each other.
    first = np.arange(len(z)) < len(z) // n_ensemble * max(n_ensemble // 2, 1)
    scores: list[FloatArray] = []
    for k in range(1, _MOST_COMPONENTS + 1):
        held_out = np.empty(len(z))
        for fold in (first, ~first):
            held_out[~fold] = _log_density(z[~fold], *_fitted(z[fold], k, rng))
        scores.append(held_out)
        if k > 1 and held_out.mean() < scores[-2].mean():
            break
    best = scores[int(np.argmax([one.mean() for one in scores]))]
    behind = [best - one for one in scores]
    near = [bool(gap.mean() <= gap.std() / math.sqrt(len(gap))) for gap in behind]
    return 1 + near.index(True), {str(k): float(one.mean()) for k, one in enumerate(scores, 1)}


def _fitted(
    z: FloatArray, k: int, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Maximise the mean log density from seeds of k-means++; return the mixture."""
    n, d = z.shape
    seeds = z[rng.integers(n, size=1)]
    apart = np.full(n, np.inf)
    for _ in range(k - 1):
        apart = np.minimum(apart, ((z - seeds[-1]) ** 2).sum(axis=1))
        seeds = np.vstack([seeds, z[rng.choice(n, p=apart / apart.sum())]])
    nearest = ((z[:, None] - seeds) ** 2).sum(axis=-1).argmin(axis=1)
    share = np.eye(k)[nearest]
    last = -math.inf
    for _ in range(_MOST_STEPS):
        size = share.sum(axis=0) + 1e-12
        means = share.T @ z / size[:, None]
        apart_of = z - means[:, None]  # (k, n, d)
        covariances = (share.T[..., None] * apart_of).transpose(0, 2, 1) @ apart_of
        covariances = covariances / size[:, None, None] + _FLOOR * np.eye(d)
        mixture = size / size.sum(), means, covariances
        logs = _component_log_densities(z, *mixture)
        total = special.logsumexp(logs, axis=1)
        value = float(total.mean())
        if value - last < _SETTLED:
            break
        last, share = value, np.exp(logs - total[:, None])
    return mixture


def _log_density(
    z: FloatArray, weights: FloatArray, means: FloatArray, covariances: FloatArray
) -> FloatArray:
    found = _component_log_densities(z, weights, means, covariances)
    return np.asarray(special.logsumexp(found, axis=-1))


def _component_log_densities(
    z: FloatArray, weights: FloatArray, means: FloatArray, covariances: FloatArray
) -> FloatArray:
    """Return log weight and density of each component, shape (..., n_component)."""
    found = []
    for weight, mean, factor in zip(weights, means, np.linalg.cholesky(covariances), strict=True):
        scaled = linalg.solve_triangular(factor, (z - mean).reshape(-1, len(mean)).T, lower=True)
        log_volume = np.log(np.diag(factor)).sum() + 0.5 * len(mean) * _LOG_2PI
        value = math.log(weight) - 0.5 * (scaled**2).sum(axis=0) - log_volume
        found.append(value.reshape(z.shape[:-1]))
    return np.stack(found, axis=-1)


def _distance(mixture: PosteriorMixture, theta: FloatArray, seed: int) -> Json:
    """Compare draws of a mixture with those that it was fitted to."""
    drawn = mixture.rvs(_N_COMPARED, rng=stream(seed, "mixture", "distance"))
    sd = theta.std(axis=0)
    shift, ratio = (drawn.mean(axis=0) - theta.mean(axis=0)) / sd, drawn.std(axis=0) / sd
    apart = np.abs(np.corrcoef(drawn.T) - np.corrcoef(theta.T)).max()
    from scipy.stats import ks_2samp  # a third of a second that not every command spends

    columns = zip(drawn.T, theta.T, strict=True)
    ks = [float(ks_2samp(one, other).statistic) for one, other in columns]
    by_name: Sequence[tuple[str, Sequence[float]]] = [
        ("mean_shift_in_sd", shift.tolist()),
        ("sd_ratio", ratio.tolist()),
        ("kolmogorov_smirnov", ks),
    ]
    found: Json = {key: dict(zip(mixture.names, v, strict=True)) for key, v in by_name}
    return found | {"largest_correlation_difference": float(apart), "n_compared": _N_COMPARED}
