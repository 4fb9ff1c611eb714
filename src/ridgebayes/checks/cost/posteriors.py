"""What posteriors, evidences and bands cost, on a table and one form."""

import math
from functools import partial

import numpy as np
from scipy import special

from ridgebayes._types import FloatArray
from ridgebayes.checks.cost.measured import Setting, Way, settings, turned
from ridgebayes.evidence import bridge_evidence, quadrature_evidence
from ridgebayes.evidence.nested import nested_evidence
from ridgebayes.inference.chains import SampleSettings
from ridgebayes.inference.importance_sampling import importance_posterior
from ridgebayes.inference.laplace import fit_laplace
from ridgebayes.inference.posterior import Posterior
from ridgebayes.inference.qmc_nodes import compress
from ridgebayes.model.forms import Form
from ridgebayes.model.model import Model
from ridgebayes.model.noise import Noise
from ridgebayes.model.observations import Observations
from ridgebayes.results import calibrate
from ridgebayes.table.table import ContactTable

_LONG = 65_536  # draws of each proposal of the reference
_LONGEST = 131_072  # the same for bands: errors of probabilities of 7e-4
_N_LOAD = 25
_PLACED = 4_096  # draws that tell where loads are looked at
_Q = (4, 6, 8, 10)
_TAIL = 0.05
_Draws = tuple[FloatArray, FloatArray | None]  # parameters, and weights where they differ
_Bands = tuple[FloatArray, FloatArray]  # probabilities of the curve, and of a simulation
_SAMPLED = (512, 2_560, 10_240, 40_960)  # importance draws
_WALKS = (  # moves, walkers, autocorrelation times
    ("stretch", 32, 50.0),
    ("differential evolution", 32, 50.0),
    ("independence", 128, 50.0),
    ("mixture", 32, 50.0),
    ("mixture", 128, 50.0),
    ("mixture", 128, 400.0),
    ("mixture", 512, 50.0),
)


def posterior_settings(table: ContactTable, form: Form, *, seed: int = 0) -> list[Setting]:
    """List ways to a posterior: mean, sd and 5 % quantile of the worst parameter.

    Parameters
    ----------
    table : ContactTable
        Its calibration rows, taken as independent.
    form : Form
        With at most three coefficients.
    seed : int, optional
        Seed of all draws.

    Returns
    -------
    list of Setting
        Errors are over the posterior sd.
    """
    model = Model(Observations.from_table(table), form, Noise.named("iid"))
    best = _moments(all_draws(importance_posterior(model, seed=seed + 1, n_draw=_LONG)[0]))
    reference = f"importance sampling, {4 * _LONG} draws"

    def sampled(n: int) -> _Draws:
        return all_draws(importance_posterior(model, seed=seed, n_draw=n // 4)[0]), None

    def walked(moves: str, n_walker: int, n_tau: float) -> _Draws:
        walk = SampleSettings(n_walker=n_walker, n_tau=n_tau, tau_change=0.1, moves=moves)
        return all_draws(calibrate(table, form, noise="iid", rng=seed, settings=walk)), None

    def off(draws: _Draws) -> dict[str, float]:
        found = _moments(*draws)
        return {name: float(np.abs((found[name] - best[name]) / best["sd"]).max()) for name in best}

    def laplace() -> _Draws:
        found = fit_laplace(model)
        z = np.random.default_rng(seed).standard_normal((20_000, found.mode.size))
        return model.to_theta(found.unwhiten(z)[0]), None

    def grid(n: int) -> _Draws:
        """Gauss-Hermite nodes about the mode, weighted by density over normal."""
        found = fit_laplace(model)
        nodes, weights = np.polynomial.hermite_e.hermegauss(n)
        d = found.mode.size
        z = np.stack(np.meshgrid(*[nodes] * d, indexing="ij"), axis=-1).reshape(-1, d)
        log_weight = np.sum(np.meshgrid(*[np.log(weights)] * d, indexing="ij"), axis=0).reshape(-1)
        u, log_jacobian = found.unwhiten(z)
        log_weight = log_weight + model.log_density(u) + log_jacobian + 0.5 * (z * z).sum(axis=1)
        weight = np.exp(log_weight - log_weight.max())
        return model.to_theta(u), weight / weight.sum()

    ways: list[Way[_Draws]] = [
        ("Laplace", "normal at the mode", laplace),
        *turned("importance sampling", "{} draws", sampled, _SAMPLED),
        *turned("quadrature", "{} nodes a parameter", grid, (4, 8, 16)),
    ]
    for moves, n_walker, n_tau in _WALKS:
        method = f"emcee, {moves}, 4 x {n_walker} walkers"
        walk = partial(walked, moves, n_walker)
        ways += turned(method, "{:g} autocorrelation times", walk, [n_tau])
    return settings("posterior", reference, off, ways)


def evidence_settings(table: ContactTable, form: Form, *, seed: int = 0) -> list[Setting]:
    """List ways to a log evidence; errors are absolute, as a relative error of the evidence."""
    model = Model(Observations.from_table(table), form, Noise.named("iid"))
    laplace = fit_laplace(model)
    best = quadrature_evidence(model.log_density, laplace, tol=1e-9).value
    fit = calibrate(table, form, noise="iid", rng=seed)

    def bridge(n: int) -> float:
        rng = np.random.default_rng(seed)
        chains = fit.kept_chains
        return bridge_evidence(model.log_density, chains, laplace, rng=rng, draws_max=n).value

    def quadrature(tol: float) -> float:
        return quadrature_evidence(model.log_density, laplace, tol=tol).value

    def sampled(n: int) -> float:
        return importance_posterior(model, seed=seed, n_draw=n // 4)[1].value

    def nested(n: int) -> float:
        return nested_evidence(model, rng=np.random.default_rng(seed), n_live=n).value

    ways: list[Way[float]] = [
        ("Laplace", "at the mode", lambda: fit_laplace(model).log_evidence),
        *turned("quadrature", "tolerance {:g}", quadrature, (1e-1, 1e-2, 1e-4, 1e-6)),
        *turned("bridge, given draws", "{} of them", bridge, (1_000, 10_000, 100_000)),
        *turned("importance sampling", "{} draws", sampled, (512, 10_240, 40_960)),
        *turned("dynesty", "{} live points", nested, (50, 200)),
    ]
    reference = "quadrature, tolerance 1e-9"
    return settings("evidence", reference, lambda value: {"ln Z": value - best}, ways)


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
        and for a further simulation or measurement.
    """
    model = Model(Observations.from_table(table), form, Noise.named("iid"))
    k = model.n_coefficient
    exact = importance_posterior(model, seed=seed + 1, n_draw=_LONGEST)[0]
    known, reference = all_draws(exact), f"{4 * _LONGEST} importance draws"
    some = known[:: len(known) // _PLACED]
    # Loads where probabilities change: three standard deviations about each transition.
    places = np.linspace(-3.0, 3.0, _N_LOAD)
    spread = []
    for Q in _Q:
        mean = np.log(form.load(Q, *texture, some[:, :k]))
        spread.append((mean.mean(), mean.std(), math.hypot(mean.std(), some[:, k].mean())))

    def probabilities(theta: FloatArray, weight: FloatArray | None = None) -> _Bands:
        curve, simulation = list[FloatArray](), list[FloatArray]()
        for Q, (centre, narrow, wide) in zip(_Q, spread, strict=True):
            mean, sigma = np.log(form.load(Q, *texture, theta[:, :k])), theta[:, k]
            reached = (centre + narrow * places)[:, None] >= mean
            z = ((centre + wide * places)[:, None] - mean) / sigma
            curve.append(np.average(reached, axis=1, weights=weight))
            simulation.append(np.average(special.ndtr(z), axis=1, weights=weight))
        return np.array(curve), np.array(simulation)

    best = probabilities(known)

    def drawn(n: int) -> _Bands:
        return probabilities(known[np.random.default_rng(seed).choice(len(known), n)])

    def nodes(n: int) -> _Bands:
        found = compress(exact.model, exact.laplace, exact.coordinates, n, seed=exact.seed)
        if found is None:
            raise ValueError("no nodes stand for this posterior")
        return probabilities(found.theta, found.weight.mean(axis=1))

    def off(bands: _Bands) -> dict[str, float]:
        pairs = zip(("curve", "simulation"), bands, best, strict=True)
        return {name: float(np.abs(one - other).max()) for name, one, other in pairs}

    ways = turned("posterior draws", "{} draws", drawn, (100, 1_000, 10_000, 100_000))
    ways += turned("nodes", "{} nodes", nodes, (256, 1_024, 4_096))
    return settings("bands", reference, off, ways)


def all_draws(fit: Posterior) -> FloatArray:
    """Return every draw, where a fit's own are thinned."""
    u = fit.chains.u
    return fit.model.to_theta(u.reshape(-1, u.shape[-1]))


def _moments(theta: FloatArray, weight: FloatArray | None = None) -> dict[str, FloatArray]:
    if weight is None:
        tail = np.quantile(theta, _TAIL, axis=0)
    else:
        tail = np.quantile(theta, _TAIL, axis=0, weights=weight, method="inverted_cdf")
    mean = np.average(theta, axis=0, weights=weight)
    sd = np.sqrt(np.average((theta - mean) ** 2, axis=0, weights=weight))
    return {"mean": mean, "sd": sd, "5 % quantile": tail}
