"""A posterior as a Gaussian mixture: a few numbers that other programs can take as a prior.

The mixture is of normal scores z of the parameters under simple distributions, the *transforms*: a
parameter is the value below which its transform has a standard normal's probability. A transform is
the parameter's prior where that has a closed form in every program, else a log-normal or a normal
of the draws, cut off where the prior is. Fitted by expectation maximisation, which keeps the draws'
mean and covariance of z whatever the number of components; that number is chosen by the density of
draws that were left out. docs/reuse.md shows how other programs read the file.
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
_MAX_STEPS, _MIN_GAIN = 200, 2e-5  # gain in nats of the mean log density
_N_COMPARED = 100_000
_FORMAT = "ridgebayes posterior mixture 1"
_ARRAYS = ("weights", "means", "covariances")
_Arrays = tuple[FloatArray, FloatArray, FloatArray]  # in the same order


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
        Weights of the components; they add up to 1.
    means : ndarray of float, shape (n_component, n_parameter)
        Means of z.
    covariances : ndarray of float, shape (n_component, n_parameter, n_parameter)
        Covariances of z.
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
        n, what = len(self.weights), f"{self.about['form']}, {self.about['noise']}"
        components = f"{n} component{'s' if n > 1 else ''}"
        return f"{type(self).__name__}({what}: {', '.join(self.names)}; {components})"

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
            Normalised, natural log; -inf where a parameter is outside its support.
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
        """Return plain values.

        Returns
        -------
        dict
            As `to_json` writes it.
        """
        arrays = {key: getattr(self, key).tolist() for key in _ARRAYS}
        transforms = [to_dict(transform) for transform in self.transforms]
        named = {"format": _FORMAT, "names": list(self.names), "transforms": transforms}
        return named | arrays | self.about

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
        # Damage turns up as errors of many kinds.
        with refusing(f"{path}: expected a file of PosteriorMixture.to_json"):
            content = json.loads(read_text(Path(path), LARGEST_TEXT))
            names = tuple(map(str, content.pop("names")))
            transforms = tuple(map(from_dict, content.pop("transforms")))
            weights, means, covariances = (np.array(content.pop(key), float) for key in _ARRAYS)
            k, d = len(weights), len(transforms)
            shapes = [weights.shape, means.shape, covariances.shape, (len(names),)]
            if content.pop("format") != _FORMAT or shapes != [(k,), (k, d), (k, d, d), (d,)]:
                raise ValueError("another format, or numbers of other shapes")
            np.linalg.cholesky(covariances)
            positive = (weights > 0).all() and abs(weights.sum() - 1) < 1e-9
            if not (positive and np.isfinite(means).all()):
                raise ValueError("weights that do not add up to 1, or means that are not finite")
            made = cls(names, transforms, weights, means, covariances, content)
            repr(made)
        return made


def fit_mixture(
    posterior: Posterior, validity: Json, n_component: int | None = None
) -> PosteriorMixture:
    """Fit a mixture to a posterior's draws.

    Parameters
    ----------
    posterior : Posterior
        Its thinned draws are fitted; each half of their ensembles is left out in turn.
    validity : dict
        Range that it was calibrated on, as plain values.
    n_component : int, optional
        Components; chosen by held-out draws if not given.

    Returns
    -------
    PosteriorMixture
        With the heaviest component first.

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
    n_component, scores = (n_component, {}) if n_component else _chosen(white, rng)
    weights, means, covariances = _fitted(white, n_component, rng)
    order = np.argsort(-weights)
    of_z = weights[order], centre + means[order] @ factor.T, factor @ covariances[order] @ factor.T
    data, priors = model.data, {name: to_dict(prior) for name, prior in model.priors.items()}
    about: Json = {"form": form, "noise": posterior.noise.name, "converged": posterior.converged}
    about |= {"priors": priors, "fitted_rows": len(data), "fitted_rows_digest": data.digest()}
    about |= {"validity": dict(validity), "held_out_log_density": scores}
    about["ridgebayes_version"] = __version__
    made = PosteriorMixture(model.parameter_names, transforms, *of_z, about)
    about["distance"] = _distance(made, theta, posterior.seed)
    return made


def _transform(prior: Distribution, draws: FloatArray) -> Distribution:
    """Return the prior, or its approximation where programs have no closed form."""
    if isinstance(prior, Truncated):
        return Truncated(_transform(prior.base, draws), prior.low, prior.high)
    if isinstance(prior, Normal | LogNormal | HalfNormal | Uniform):
        return prior
    if prior.support[0] < 0:
        return Normal(float(draws.mean()), float(draws.std()))
    return LogNormal(float(np.exp(np.log(draws).mean())), float(np.log(draws).std()))


def _chosen(z: FloatArray, rng: np.random.Generator) -> tuple[int, dict[str, float]]:
    """Return the number of components, and the mean log density of draws left out for each.

    It is the smallest within one standard error of the best; more are not tried after one that is
    no better.
    """
    # Draws run ensemble by ensemble, and there are four: two halves are independent of each other.
    first = np.arange(len(z)) < 2 * (len(z) // 4)
    scores: list[FloatArray] = []
    for k in range(1, _MAX_COMPONENTS + 1):
        halves = [_log_densities(z[~fold], _fitted(z[fold], k, rng)) for fold in (first, ~first)]
        scores.append(np.logaddexp.reduce(np.concatenate(halves, axis=1)))
        if k > 1 and scores[-1].mean() < scores[-2].mean():
            break
    means = [float(score.mean()) for score in scores]
    behind = scores[int(np.argmax(means))] - np.array(scores)
    near = behind.mean(axis=1) <= behind.std(axis=1) / len(z) ** 0.5
    return 1 + int(np.argmax(near)), {str(k): mean for k, mean in enumerate(means, 1)}


def _fitted(z: FloatArray, k: int, rng: np.random.Generator) -> _Arrays:
    """Maximise the mean log density from seeds of k-means++; return the mixture."""
    from scipy.cluster.vq import kmeans2  # not every command needs it

    share, last = np.eye(k)[:, kmeans2(z, k, iter=1, minit="++", rng=rng)[1]], -np.inf
    for _ in range(_MAX_STEPS):
        size = share.sum(axis=1)[:, None] + 1e-12
        means = share @ z / size
        apart = z - means[:, None]  # (k, n, d)
        scatter = (share[..., None] * apart).transpose(0, 2, 1) @ apart / size[..., None]
        mixture = (
            size[:, 0] / size.sum(),
            means,
            scatter + MIN_RELATIVE_VARIANCE * np.eye(z.shape[1]),
        )
        total = np.logaddexp.reduce(logs := _log_densities(z, mixture))
        gain, last, share = total.mean() - last, total.mean(), np.exp(logs - total)
        if gain < _MIN_GAIN:
            break
    return mixture


def _log_densities(z: FloatArray, mixture: _Arrays) -> FloatArray:
    """Return log weight and density of each component, shape (n_component, ...)."""
    terms = []
    for weight, mean, covariance in zip(*mixture, strict=True):
        inverse = np.linalg.inv(np.linalg.cholesky(covariance))
        height = np.log(weight) + np.log(np.diag(inverse)).sum()
        terms.append(height - 0.5 * (((z - mean) @ inverse.T) ** 2 + LOG_2PI).sum(axis=-1))
    return np.stack(terms)


def _distance(mixture: PosteriorMixture, theta: FloatArray, seed: int) -> Json:
    """Compare draws of a mixture with those that it was fitted to."""
    from scipy.stats import ks_2samp  # a third of a second that not every command spends

    drawn = mixture.rvs(_N_COMPARED, rng=stream(seed, "mixture", "distance"))
    sd, apart = theta.std(axis=0), np.abs(np.corrcoef(drawn.T) - np.corrcoef(theta.T)).max()
    shift, ratio = (drawn.mean(axis=0) - theta.mean(axis=0)) / sd, drawn.std(axis=0) / sd
    distances: Json = {"mean_shift_in_sd": shift, "sd_ratio": ratio}
    distances["kolmogorov_smirnov"] = ks_2samp(drawn, theta).statistic
    distances = {
        key: dict(zip(mixture.names, v.tolist(), strict=True)) for key, v in distances.items()
    }
    return distances | {"largest_correlation_difference": float(apart), "n_compared": _N_COMPARED}
