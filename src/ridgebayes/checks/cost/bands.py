"""What bands cost: probabilities of counts, by draws and by nodes."""

import math
from collections.abc import Callable
from functools import partial

import numpy as np
from scipy import special

from ridgebayes._types import FloatArray
from ridgebayes.checks.cost.measured import Setting
from ridgebayes.checks.cost.posteriors import all_draws
from ridgebayes.inference.importance_sampling import importance_posterior
from ridgebayes.inference.qmc_nodes import Nodes, compress
from ridgebayes.model.forms import Form
from ridgebayes.model.model import Model
from ridgebayes.model.noise import Noise
from ridgebayes.model.observations import Observations
from ridgebayes.table.table import ContactTable

_LONG = 131_072  # draws of each of four proposals: errors of probabilities of 7e-4
_N_LOAD = 25
_PLACED = 4_096  # draws that tell where loads are looked at
_Q = (4, 6, 8, 10)


def band_settings(
    table: ContactTable, form: Form, texture: tuple[float, float], *, seed: int = 0
) -> list[Setting]:
    """List ways to the probabilities of a texture's counts.

    Parameters
    ----------
    table : ContactTable
        Its calibration rows, taken as independent.
    form : Form
        With at most three coefficients.
    texture : (float, float)
        a/R and b/R.
    seed : int, optional
        Seed of all draws.

    Returns
    -------
    list of Setting
        Errors are the largest of P(Q >= 4), ..., P(Q >= 10) over loads, for the form's own curve
        and for a further simulation.
    """
    model = Model(Observations.from_table(table), form, Noise.named("iid"))
    k = model.n_coefficient
    exact = importance_posterior(model, seed=seed + 1, n_draw=_LONG)[0]
    known, reference = all_draws(exact), f"{4 * _LONG} importance draws"
    some = known[:: len(known) // _PLACED]
    # Loads where probabilities change: three standard deviations about each transition.
    places = np.linspace(-3.0, 3.0, _N_LOAD)
    spread = []
    for Q in _Q:
        mean = np.log(form.load(Q, *texture, some[:, :k]))
        spread.append((mean.mean(), mean.std(), math.hypot(mean.std(), some[:, k].mean())))

    def probabilities(
        theta: FloatArray, weight: FloatArray | None = None
    ) -> tuple[FloatArray, FloatArray]:
        curve, simulation = list[FloatArray](), list[FloatArray]()
        for Q, (centre, narrow, wide) in zip(_Q, spread, strict=True):
            mean, sigma = np.log(form.load(Q, *texture, theta[:, :k])), theta[:, k]
            reached = (centre + narrow * places)[:, None] >= mean
            z = ((centre + wide * places)[:, None] - mean) / sigma
            curve.append(np.average(reached, axis=1, weights=weight))
            simulation.append(np.average(special.ndtr(z), axis=1, weights=weight))
        return np.array(curve), np.array(simulation)

    best = probabilities(known)

    def drawn(n: int) -> tuple[FloatArray, FloatArray]:
        return probabilities(known[np.random.default_rng(seed).choice(len(known), n)])

    def nodes(n: int) -> tuple[FloatArray, FloatArray]:
        found: Nodes | None = compress(
            exact.model, exact.laplace, exact.coordinates, n, seed=exact.seed
        )
        if found is None:
            raise ValueError("no nodes stand for this posterior")
        return probabilities(found.theta, found.weight.mean(axis=1))

    def off(
        compute: Callable[[], tuple[FloatArray, FloatArray]],
    ) -> Callable[[], dict[str, float]]:
        def error() -> dict[str, float]:
            pairs = zip(("curve", "simulation"), compute(), best, strict=True)
            return {name: float(np.abs(one - other).max()) for name, one, other in pairs}

        return error

    return [
        Setting("bands", "posterior draws", f"{n} draws", off(partial(drawn, n)), reference)
        for n in (100, 1_000, 10_000, 100_000)
    ] + [
        Setting("bands", "nodes", f"{n} nodes", off(partial(nodes, n)), reference)
        for n in (256, 1_024, 4_096)
    ]
