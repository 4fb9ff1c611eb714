"""What posteriors, evidences and bands cost, on a table and one form."""

from collections.abc import Callable
from functools import partial

import numpy as np

from ridgebayes._types import FloatArray
from ridgebayes.checks.cost.measured import Setting
from ridgebayes.evidence import bridge_evidence, quadrature_evidence
from ridgebayes.evidence.nested import nested_evidence
from ridgebayes.inference.chains import SampleSettings
from ridgebayes.inference.importance_sampling import importance_posterior
from ridgebayes.inference.laplace import fit_laplace
from ridgebayes.inference.posterior import Posterior
from ridgebayes.model.forms import Form
from ridgebayes.model.model import Model
from ridgebayes.model.noise import Noise
from ridgebayes.model.observations import Observations
from ridgebayes.results import calibrate
from ridgebayes.table.table import ContactTable

_LONG = 65_536  # draws of each proposal of the reference
_TAIL = 0.05
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

    def sampled(n: int) -> FloatArray:
        return all_draws(importance_posterior(model, seed=seed, n_draw=n)[0])

    def walked(settings: SampleSettings) -> FloatArray:
        return all_draws(calibrate(table, form, rng=seed, settings=settings))

    def off(
        draws: Callable[[], FloatArray | tuple[FloatArray, FloatArray]],
    ) -> Callable[[], dict[str, float]]:
        def error() -> dict[str, float]:
            drawn = draws()
            found = _moments(*drawn) if isinstance(drawn, tuple) else _moments(drawn)
            return {
                name: float(np.abs((found[name] - best[name]) / best["sd"]).max()) for name in best
            }

        return error

    def laplace() -> FloatArray:
        found = fit_laplace(model)
        z = np.random.default_rng(seed).standard_normal((20_000, found.mode.size))
        return model.to_theta(found.unwhiten(z)[0])

    def grid(n: int) -> tuple[FloatArray, FloatArray]:
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

    settings = [Setting("posterior", "Laplace", "normal at the mode", off(laplace), reference)]
    for n in (128, 640, 2_560, 10_240):
        settings.append(
            Setting(
                "posterior",
                "importance sampling",
                f"{4 * n} draws",
                off(partial(sampled, n)),
                reference,
            )
        )
    settings += [
        Setting(
            "posterior", "quadrature", f"{n} nodes a parameter", off(partial(grid, n)), reference
        )
        for n in (4, 8, 16)
    ]
    for moves, walkers, n_tau in _WALKS:
        length = SampleSettings(n_walker=walkers, n_tau=n_tau, tau_change=0.1, moves=moves)
        settings.append(
            Setting(
                "posterior",
                f"emcee, {moves}, 4 x {walkers} walkers",
                f"{n_tau:g} autocorrelation times",
                off(partial(walked, length)),
                reference,
            )
        )
    return settings


def evidence_settings(table: ContactTable, form: Form, *, seed: int = 0) -> list[Setting]:
    """List ways to a log evidence; errors are absolute, as a relative error of the evidence."""
    model = Model(Observations.from_table(table), form, Noise.named("iid"))
    laplace = fit_laplace(model)
    best = quadrature_evidence(model.log_density, laplace, tol=1e-9).value
    fit = calibrate(table, form, rng=seed)
    reference = "quadrature, tolerance 1e-9"

    def off(value: Callable[[], float]) -> Callable[[], dict[str, float]]:
        return lambda: {"ln Z": value() - best}

    def bridge(n: int) -> float:
        rng = np.random.default_rng(seed)
        chains = fit.kept_chains
        return bridge_evidence(model.log_density, chains, laplace, rng=rng, draws_max=n).value

    def quadrature(tol: float) -> float:
        return quadrature_evidence(model.log_density, laplace, tol=tol).value

    def sampled(n: int) -> float:
        return importance_posterior(model, seed=seed, n_draw=n)[1].value

    def nested(n: int) -> float:
        return nested_evidence(model, rng=np.random.default_rng(seed), n_live=n).value

    settings = [
        Setting(
            "evidence",
            "Laplace",
            "at the mode",
            off(lambda: fit_laplace(model).log_evidence),
            reference,
        )
    ]
    settings += [
        Setting(
            "evidence",
            "quadrature",
            f"tolerance {tol:g}",
            off(partial(quadrature, tol)),
            reference,
        )
        for tol in (1e-1, 1e-2, 1e-4, 1e-6)
    ]
    settings += [
        Setting(
            "evidence", "bridge, given draws", f"{n} of them", off(partial(bridge, n)), reference
        )
        for n in (1_000, 10_000, 100_000)
    ]
    settings += [
        Setting(
            "evidence",
            "importance sampling",
            f"{4 * n} draws",
            off(partial(sampled, n)),
            reference,
        )
        for n in (128, 2_560, 10_240)
    ]
    settings += [
        Setting(
            "evidence",
            "dynesty",
            f"{n} live points",
            off(partial(nested, n)),
            reference,
        )
        for n in (50, 200)
    ]
    return settings


def all_draws(fit: Posterior) -> FloatArray:
    """Return every draw, where a fit's own are thinned."""
    u = fit.chains.u
    return fit.model.to_theta(u.reshape(-1, u.shape[-1]))


def _moments(theta: FloatArray, weight: FloatArray | None = None) -> dict[str, FloatArray]:
    if weight is None:
        tail = np.quantile(theta, _TAIL, axis=0)
        return {"mean": theta.mean(axis=0), "sd": theta.std(axis=0), "5 % quantile": tail}
    mean = weight @ theta
    order = np.argsort(theta, axis=0)
    quantiles = [
        np.interp(_TAIL, np.cumsum(weight[i]) - 0.5 * weight[i], column[i])
        for i, column in zip(order.T, theta.T, strict=True)
    ]
    return {
        "mean": mean,
        "sd": np.sqrt(weight @ (theta - mean) ** 2),
        "5 % quantile": np.array(quantiles),
    }
