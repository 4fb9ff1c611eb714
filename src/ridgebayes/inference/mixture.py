"""A posterior as a Gaussian mixture: a small file that other programs can use as a prior.

The mixture describes the parameters' normal scores z under simple distributions, the *transforms*:
a parameter is the quantile of its transform at probability Phi(z). A transform is the parameter's
prior if most programs have it in closed form, else a log-normal or normal distribution fitted to
the draws and truncated like the prior. The mixture is fitted by expectation maximisation, which
preserves mean and covariance of z for any number of components; held-out draws determine this
number. docs/reuse.md shows how other programs read the file.
"""

import json
import os
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ridgebayes._types import LOG_2PI, FloatArray, Json, Rng, __version__
from ridgebayes.distributions.bounded import Truncated, Uniform
from ridgebayes.distributions.distribution import Distribution, HalfNormal, LogNormal, Normal
from ridgebayes.distributions.grammar import from_dict, to_dict
from ridgebayes.errors import InputError
from ridgebayes.inference.posterior import Posterior
from ridgebayes.inference.proposal import MIN_RELATIVE_VARIANCE
from ridgebayes.model.joint_prior import JointPrior
from ridgebayes.runtime.atomic import write_text
from ridgebayes.runtime.randomness import seeded, stream
from ridgebayes.runtime.reading import LARGEST_TEXT, read_text, refusing

_MAX_COMPONENTS, _MAX_PARAMETERS = 8, 40
_MIN_GAIN = 2e-5  # nats of mean log density; the last step of expectation maximisation has less
_N_COMPARED = 100_000  # draws of the mixture that are compared with the posterior's draws
_FORMAT = "ridgebayes posterior mixture 1"
_ARRAY_KEYS = ("weights", "means", "covariances")
_Arrays = tuple[FloatArray, FloatArray, FloatArray]  # weights, means, covariances


@dataclass(frozen=True, eq=False)
class PosteriorMixture:
    """A posterior as a Gaussian mixture, made by `Fit.to_mixture`.

    Parameters
    ----------
    names : tuple of str, length n_parameter
        Parameters.
    transforms : tuple of Distribution, length n_parameter
        Distributions that convert normal scores z to parameters.
    weights : ndarray of float, shape (n_component,)
        Weights of the components, with sum 1.
    means : ndarray of float, shape (n_component, n_parameter)
        Means of z.
    covariances : ndarray of float, shape (n_component, n_parameter, n_parameter)
        Covariances of z.
    about : dict
        Origin: form, noise, converged, priors, rows, range of validity, held-out scores, and the
        distance between mixture and draws.

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
        n, what = len(self.weights), f"{self.about['form']}, {self.about['noise']}"
        components = f"{n} component{'s' if n > 1 else ''}"
        return f"{type(self).__name__}({what}: {', '.join(self.names)}; {components})"

    def rvs(self, n: int, *, rng: Rng = 0) -> FloatArray:
        """Draw parameters.

        Parameters
        ----------
        n : int
            Number of draws.
        rng : int or numpy.random.Generator, optional
            Seed or generator.

        Returns
        -------
        ndarray of float, shape (n, n_parameter)
            Parameters in the order of `names`.
        """
        generator = seeded(rng)
        which = generator.choice(len(self.weights), size=n, p=self.weights)
        normal = generator.standard_normal((n, len(self.names), 1))
        z = self.means[which] + (np.linalg.cholesky(self.covariances)[which] @ normal)[..., 0]
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
            Normalised, natural log; -inf if a parameter is outside its support.
        """
        theta, joint = np.asarray(theta, dtype=float), JointPrior(self.transforms)
        low, high = np.array([transform.support for transform in self.transforms]).T
        inside = ((theta > low) & (theta < high)).all(axis=-1)
        with np.errstate(all="ignore"):
            z = np.where(inside[..., None], joint.scores(theta), 0.0)
            logs = _log_densities(z, (self.weights, self.means, self.covariances))
            jacobian = joint.log_pdf(theta) + 0.5 * (z * z + LOG_2PI).sum(axis=-1)
        return np.where(inside, np.logaddexp.reduce(logs) + jacobian, -np.inf)

    def to_dict(self) -> Json:
        """Return the mixture as a dictionary of plain values.

        Returns
        -------
        dict
            Content of the file that `to_json` writes.
        """
        arrays = {key: getattr(self, key).tolist() for key in _ARRAY_KEYS}
        transforms = [to_dict(transform) for transform in self.transforms]
        named = {"format": _FORMAT, "names": list(self.names), "transforms": transforms}
        return named | arrays | self.about

    def to_json(self, path: str | os.PathLike[str]) -> None:
        """Write the mixture to a JSON file.

        Parameters
        ----------
        path : path
            File; an existing file is overwritten atomically.
        """
        write_text(json.dumps(self.to_dict(), indent=1) + "\n", Path(path))

    @classmethod
    def from_json(cls, path: str | os.PathLike[str]) -> "PosteriorMixture":
        """Read a file written by `to_json`.

        Parameters
        ----------
        path : path
            File.

        Returns
        -------
        PosteriorMixture
            Mixture.

        Raises
        ------
        InputError
            If the file is missing, damaged, or of another format.
        """
        # A damaged file raises exceptions of many types.
        with refusing(f"{path}: expected a file of PosteriorMixture.to_json"):
            content = json.loads(read_text(Path(path), LARGEST_TEXT))
            names = tuple(map(str, content.pop("names")))
            transforms = tuple(map(from_dict, content.pop("transforms")))
            weights, means, covariances = (np.array(content.pop(key), float) for key in _ARRAY_KEYS)
            k, d = len(weights), len(transforms)
            shapes = [weights.shape, means.shape, covariances.shape, (len(names),)]
            if content.pop("format") != _FORMAT or shapes != [(k,), (k, d), (k, d, d), (d,)]:
                raise ValueError("another format, or numbers of other shapes")
            np.linalg.cholesky(covariances)
            positive = (weights > 0).all() and abs(weights.sum() - 1) < 1e-9
            if not (positive and np.isfinite(means).all()):
                raise ValueError("weights that do not add up to 1, or means that are not finite")
            mixture = cls(names, transforms, weights, means, covariances, content)
            repr(mixture)  # raises KeyError if the form or error model is missing
        return mixture


def fit_mixture(
    posterior: Posterior, validity: Json, n_component: int | None = None
) -> PosteriorMixture:
    """Fit a mixture to a posterior's draws.

    Parameters
    ----------
    posterior : Posterior
        Posterior, whose thinned draws are fitted.
    validity : dict
        Calibrated range, as plain values.
    n_component : int, optional
        Number of components. If not given, it is chosen by fits to each half of the draws, scored
        on the other half.

    Returns
    -------
    PosteriorMixture
        Mixture with its components sorted by weight, largest first.

    Raises
    ------
    InputError
        If there are more than 40 parameters, or `n_component` is not 1 to 8.
    """
    model, theta, form = posterior.model, posterior.draws, posterior.form.name
    if (d := theta.shape[1]) > _MAX_PARAMETERS:
        raise InputError(f"{form}: {d} parameters; expected at most {_MAX_PARAMETERS}")
    if n_component is not None and n_component not in range(1, _MAX_COMPONENTS + 1):
        raise InputError(f"n_component: expected 1 to {_MAX_COMPONENTS}, got {n_component!r}")
    transforms = tuple(map(_transform, model.priors.values(), theta.T))
    z = JointPrior(transforms).scores(theta)
    centre, factor = z.mean(axis=0), np.linalg.cholesky(np.atleast_2d(np.cov(z.T)))
    white = np.linalg.solve(factor, (z - centre).T).T
    rng = stream(posterior.seed, "mixture")
    n_component, scores = (n_component, {}) if n_component else _choose_n_component(white, rng)
    weights, means, covariances = _fit(white, n_component, rng)
    order = np.argsort(-weights)
    in_z = weights[order], centre + means[order] @ factor.T, factor @ covariances[order] @ factor.T
    data, priors = model.data, {name: to_dict(prior) for name, prior in model.priors.items()}
    about: Json = {"form": form, "noise": posterior.noise.name, "converged": posterior.converged}
    about |= {"priors": priors, "fitted_rows": len(data), "fitted_rows_digest": data.digest()}
    about |= {"validity": dict(validity), "held_out_log_density": scores}
    about["ridgebayes_version"] = __version__
    mixture = PosteriorMixture(model.parameter_names, transforms, *in_z, about)
    about["distance"] = _distance(mixture, theta, posterior.seed)
    return mixture


def _transform(prior: Distribution, draws: FloatArray) -> Distribution:
    """Return the prior, or a simpler distribution fitted to the draws if the prior is unusual."""
    if isinstance(prior, Truncated):
        return Truncated(_transform(prior.base, draws), prior.low, prior.high)
    if isinstance(prior, Normal | LogNormal | HalfNormal | Uniform):
        return prior
    if prior.support[0] < 0:
        return Normal(float(draws.mean()), float(draws.std()))
    return LogNormal(float(np.exp(np.log(draws).mean())), float(np.log(draws).std()))


def _choose_n_component(z: FloatArray, rng: np.random.Generator) -> tuple[int, dict[str, float]]:
    """Return the number of components, and the mean held-out log density for each number tried.

    The smallest number within one standard error of the best is chosen. The search stops at the
    first number with a lower score than the number before it.
    """
    # Draws are ordered by ensemble, and there are at least four, so the halves are independent.
    first = np.arange(len(z)) < 2 * (len(z) // 4)
    scores: list[FloatArray] = []
    for k in range(1, _MAX_COMPONENTS + 1):
        halves = [_log_densities(z[~fold], _fit(z[fold], k, rng)) for fold in (first, ~first)]
        scores.append(np.logaddexp.reduce(np.concatenate(halves, axis=1)))
        if k > 1 and scores[-1].mean() < scores[-2].mean():
            break
    means = [float(score.mean()) for score in scores]
    behind = scores[int(np.argmax(means))] - np.array(scores)
    near = behind.mean(axis=1) <= behind.std(axis=1) / len(z) ** 0.5
    return 1 + int(np.argmax(near)), {str(k): mean for k, mean in enumerate(means, 1)}


def _fit(z: FloatArray, k: int, rng: np.random.Generator) -> _Arrays:
    """Fit k components by expectation maximisation, started from k-means++."""
    from scipy.cluster.vq import kmeans2  # few commands need it

    share = np.eye(k)[:, kmeans2(z, k, iter=1, minit="++", rng=rng)[1]]
    last, gain = -np.inf, np.inf
    while gain >= _MIN_GAIN:
        size = share.sum(axis=1)[:, None] + 1e-12
        means = share @ z / size
        deviation = z - means[:, None]  # (k, n, d)
        scatter = (share[..., None] * deviation).transpose(0, 2, 1) @ deviation / size[..., None]
        mixture = (
            size[:, 0] / size.sum(),
            means,
            scatter + MIN_RELATIVE_VARIANCE * np.eye(z.shape[1]),
        )
        total = np.logaddexp.reduce(logs := _log_densities(z, mixture))
        gain, last, share = total.mean() - last, total.mean(), np.exp(logs - total)
    return mixture


def _log_densities(z: FloatArray, mixture: _Arrays) -> FloatArray:
    """Return log (weight times density) of each component, shape (n_component, ...)."""
    terms = []
    for weight, mean, covariance in zip(*mixture, strict=True):
        inverse = np.linalg.inv(np.linalg.cholesky(covariance))
        height = np.log(weight) + np.log(np.diag(inverse)).sum()
        terms.append(height - 0.5 * (((z - mean) @ inverse.T) ** 2 + LOG_2PI).sum(axis=-1))
    return np.stack(terms)


def _distance(mixture: PosteriorMixture, theta: FloatArray, seed: int) -> Json:
    """Return distances between draws of a mixture and the posterior's draws."""
    from scipy.stats import ks_2samp  # imported here because it takes a third of a second

    drawn = mixture.rvs(_N_COMPARED, rng=stream(seed, "mixture", "distance"))
    sd, r_gap = theta.std(axis=0), np.abs(np.corrcoef(drawn.T) - np.corrcoef(theta.T)).max()
    shift, ratio = (drawn.mean(axis=0) - theta.mean(axis=0)) / sd, drawn.std(axis=0) / sd
    distances: Json = {"mean_shift_in_sd": shift, "sd_ratio": ratio}
    distances["kolmogorov_smirnov"] = ks_2samp(drawn, theta).statistic
    distances = {
        key: dict(zip(mixture.names, v.tolist(), strict=True)) for key, v in distances.items()
    }
    return distances | {"largest_correlation_difference": float(r_gap), "n_compared": _N_COMPARED}
