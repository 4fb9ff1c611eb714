"""A posterior compressed to a few hundred weighted nodes, for predictions at very many places.

Raw draws know a probability to half over the root of their number: 250,000 of them for 1e-3. Nodes
are points of a Sobol' sequence, carried into the posterior's own shape and weighted by density over
proposal; for the smooth integrands of predictions their error falls nearly with their number. Two
halves, each shifted at random on its own, tell what it is.
"""

import inspect
import math
from dataclasses import dataclass

import numpy as np
from scipy import special

from ridgebayes._types import FloatArray
from ridgebayes.inference.laplace import Laplace
from ridgebayes.inference.pareto_smoothing import K_MAX, pareto_k
from ridgebayes.model.model import Model
from ridgebayes.runtime.randomness import stream

_DF = 8.0
_SCALE = 1.1  # tails wider than the posterior's, so that no weight is large
_MOST_COORDINATES = 40
_LEAST_EFFECTIVE = 0.3  # of the nodes: effective number below which weights are too uneven


@dataclass(frozen=True, eq=False)
class Nodes:
    """Weighted points that stand for a posterior.

    Parameters
    ----------
    u : ndarray of float, shape (n, n_coordinate)
        Unconstrained coordinates.
    theta : ndarray of float, shape (n, n_parameter)
        Parameters.
    weight : ndarray of float, shape (n, 2)
        Weights of the first half and of the second half of the nodes, each summing to 1, zero on
        the other half: two answers, whose mean is the estimate and half their difference its error.
    uniform : ndarray of float, shape (n,)
        A further coordinate, uniform from 0 to 1 and independent of the posterior, for predictions
        that need one.
    """

    u: FloatArray
    theta: FloatArray
    weight: FloatArray
    uniform: FloatArray


def compress(
    model: Model, laplace: Laplace, coordinates: FloatArray, n: int, *, seed: int
) -> Nodes | None:
    """Compress a posterior.

    Parameters
    ----------
    model : Model
        Posterior.
    laplace : Laplace
        Its approximation: nodes are made in its whitened coordinates.
    coordinates : ndarray of float, shape (n_draw, n_coordinate)
        Draws, which tell where it lies and how wide it is.
    n : int
        Nodes of both halves together: twice a power of two.
    seed : int
        Seed of the shifts.

    Returns
    -------
    Nodes or None
        None where nodes cannot stand for it: offsets are sampled, coordinates are more than 40, or
        weights are too uneven.

    Notes
    -----
    *Accuracy.* On the paper's sweep under 1e-3 in each probability with 2,048, see
    tests/inference/test_qmc_nodes.py.

    References
    ----------
    Owen (2013), Monte Carlo theory, methods and examples, chapters 9 and 17.
    """
    d = model.n_coordinate
    if model.is_latent or d > _MOST_COORDINATES:
        return None
    z = laplace.whiten(coordinates)[0]
    centre, factor = z.mean(axis=0), np.linalg.cholesky(np.cov(z.T).reshape(d, d))
    half = n // 2
    cube = np.concatenate([_sobol(d + 1, half, stream(seed, f"nodes {i}")) for i in range(2)])
    t = special.stdtrit(_DF, cube[:, :d])
    u, log_jacobian = laplace.unwhiten(centre + _SCALE * t @ factor.T)
    log_proposal = -0.5 * (_DF + 1) * np.log1p(t * t / _DF).sum(axis=1)
    log_weight = model.log_density(u) + log_jacobian - log_proposal
    weight = np.zeros((n, 2))
    for side in range(2):
        here = slice(side * half, (side + 1) * half)
        relative = np.exp(log_weight[here] - log_weight[here].max())
        relative /= relative.sum()
        effective = 1 / (relative @ relative) / half
        if not effective > _LEAST_EFFECTIVE or not pareto_k(log_weight[here]) < K_MAX:
            return None
        weight[here, side] = relative
    held = weight.any(axis=1)  # far out parameters overflow, at no weight
    return Nodes(u[held], model.to_theta(u[held]), weight[held], cube[held, d])


def _sobol(d: int, n: int, rng: np.random.Generator) -> FloatArray:
    """Return n scrambled points of the unit cube, none on its faces."""
    # SciPy calls the source of randomness `seed` before 1.15 and `rng` after.
    from scipy.stats import qmc  # a third of a second that not every command spends

    name = "rng" if "rng" in inspect.signature(qmc.Sobol).parameters else "seed"
    points = qmc.Sobol(d, **{name: rng}).random_base2(round(math.log2(n)))
    value: FloatArray = np.clip(points, 1e-12, 1 - 1e-12)
    return value
