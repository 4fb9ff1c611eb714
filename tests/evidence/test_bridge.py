import importlib
import math

import numpy as np
import pytest
from scipy import stats

from ridgebayes.evidence import bridge_evidence, power_law_evidence, quadrature_evidence
from ridgebayes.inference.chains import Chains, SampleSettings
from ridgebayes.inference.emcee_sampling import sample
from ridgebayes.inference.laplace import fit_laplace
from ridgebayes.inference.power_law_exact import sample_power_law
from ridgebayes.model.forms import PowerLaw
from ridgebayes.model.model import Model
from ridgebayes.model.observations import Observations

# Reference: log evidence of the 41 rows, iid, default priors; independent code, printed to 1e-4.
KNOWN = {"hybrid": 83.3869, "modified": 78.8628, "classic": 19.1987}


@pytest.mark.parametrize("name", KNOWN)
def test_bridge_evidence__of_the_sweep_is_the_reference_value(fits, laplaces, name):
    fit = fits[name]
    found = bridge_evidence(
        fit.model.log_density, fit.chains, laplaces[name], rng=np.random.default_rng(2)
    )
    assert found.ok
    assert found.method == "bridge"
    assert found.value == pytest.approx(KNOWN[name], abs=0.01)
    assert 0 < found.se < 0.002


def independent(log_density, draws):
    """Chains of exact draws, shape (n_ensemble, n_step, n_walker, n_parameter)."""
    flat = draws.reshape(-1, draws.shape[-1])
    log_p = log_density(flat).reshape(draws.shape[:-1])
    return Chains(draws, log_p, np.ones(len(draws)), np.ones(draws.shape[-1] + 1), ())


def skewed(u):
    """Two independent skew-normals, log integral 2.5."""
    return 2.5 + stats.skewnorm.logpdf(u, 4.0).sum(axis=-1)


def skewed_draws(seed, shape=(4, 100, 16, 2)):
    return stats.skewnorm.rvs(4.0, size=shape, random_state=seed)


@pytest.mark.parametrize("repeats", [1, 10])
def test_bridge_evidence__of_exact_draws_errs_as_its_standard_error_says(repeats, affine):
    # Repeated draws add steps and no information: the standard error must not fall for them.
    z = []
    for seed in range(30):
        chains = independent(skewed, skewed_draws(seed).repeat(repeats, axis=1))
        found = bridge_evidence(
            skewed, chains, affine(np.zeros(2), np.eye(2)), rng=np.random.default_rng(1000 + seed)
        )
        z.append((found.value - 2.5) / found.se)
    # Monte Carlo: the rms of 30 normal values is 1 +- 0.13, their mean 0 +- 0.18; four of each.
    assert 0.48 < np.sqrt(np.mean(np.square(z))) < 1.52
    assert abs(np.mean(z)) < 0.73


@pytest.mark.parametrize("still", [0.0, 0.1, 1 / 3, 1e3])
def test_bridge_evidence__of_draws_that_do_not_move_has_no_value_on_any_machine(still, affine):
    draws = skewed_draws(1)
    draws[..., 1] = still  # rounding gives it a variance of zero or of next to nothing
    found = bridge_evidence(
        skewed,
        independent(skewed, draws),
        affine(np.zeros(2), np.eye(2)),
        rng=np.random.default_rng(1),
    )
    assert np.isnan(found.value)
    assert found.status == "the draws of half of the ensembles do not move in every direction"


@pytest.mark.long
def test_bridge_evidence__over_seeds_errs_as_its_standard_error_says(fits, laplaces):
    model, laplace = fits["hybrid"].model, laplaces["hybrid"]
    exact = quadrature_evidence(model.log_density, laplace).value
    z = []
    for seed in range(8):
        chains = sample(
            model.log_density,
            laplace,
            seed=seed,
            names=model.parameter_names,
            settings=SampleSettings(n_walker=64),
        )
        found = bridge_evidence(
            model.log_density, chains, laplace, rng=np.random.default_rng(100 + seed)
        )
        assert abs(found.value - exact) < 0.01
        z.append((found.value - exact) / found.se)
    # Monte Carlo: the rms of 8 normal values lies within these bounds with probability 0.98.
    assert 0.5 < np.sqrt(np.mean(np.square(z))) < 2


def test_bridge_evidence__says_so_where_its_iteration_does_not_settle(affine):
    chains = independent(skewed, skewed_draws(1))
    found = bridge_evidence(
        skewed,
        chains,
        affine(np.zeros(2), np.eye(2)),
        rng=np.random.default_rng(1),
        iterations_max=1,
    )
    assert not found.ok
    assert np.isnan(found.value)
    assert found.status.startswith("bridge iteration not settled after 1 steps")


def test_bridge_evidence__says_so_where_the_halves_disagree(affine):
    # The last two ensembles sampled something else.
    draws = skewed_draws(1)
    draws[2:] = 0.5 + 0.5 * draws[2:]
    found = bridge_evidence(
        skewed,
        independent(skewed, draws),
        affine(np.zeros(2), np.eye(2)),
        rng=np.random.default_rng(1),
    )
    assert not found.ok
    assert found.status.startswith("halves of the ensembles disagree by ")
    assert found.status.endswith(" se")


def test_bridge_evidence__does_not_mind_how_the_coordinates_are_whitened(fits, laplaces, affine):
    # No funnel and another scale: the Jacobians have to make up for it.
    fit, laplace = fits["hybrid"], laplaces["hybrid"]
    plain = affine(laplace.mode, 1.7 * laplace.factor)
    values = [
        bridge_evidence(fit.model.log_density, fit.chains, where, rng=np.random.default_rng(3))
        for where in (laplace, plain)
    ]
    se = np.hypot(values[0].se, values[1].se)
    assert abs(values[0].value - values[1].value) < 4 * se  # Monte Carlo


def test_bridge_evidence__error_falls_as_draws_are_added(affine):
    few, many = (
        bridge_evidence(
            skewed,
            independent(skewed, skewed_draws(1, (4, n, 16, 2))),
            affine(np.zeros(2), np.eye(2)),
            rng=np.random.default_rng(1),
        ).se
        for n in (50, 800)
    )
    assert few / many == pytest.approx(4, rel=0.2)  # Monte Carlo: 1/sqrt(n), se of an se


def test_bridge_evidence__says_so_where_halves_share_no_place(affine):
    def skewed(u):
        return 2.5 + stats.skewnorm.logpdf(u, 4.0).sum(axis=-1)

    draws = stats.skewnorm.rvs(4.0, size=(4, 100, 16, 2), random_state=1)
    draws[2:] = 3 + 0.1 * draws[2:]
    chains = independent(skewed, draws)
    rng = np.random.default_rng(1)
    assert not bridge_evidence(skewed, chains, affine(np.zeros(2), np.eye(2)), rng=rng).ok


@pytest.mark.parametrize("n_ensemble", [2, 4])
def test_bridge_evidence__needs_no_more_than_two_ensembles(n_ensemble, affine):
    chains = independent(skewed, skewed_draws(3, (n_ensemble, 200, 16, 2)))
    found = bridge_evidence(
        skewed, chains, affine(np.zeros(2), np.eye(2)), rng=np.random.default_rng(3)
    )
    assert found.ok
    assert abs(found.value - 2.5) < 4 * found.se  # Monte Carlo


@pytest.mark.parametrize(("draws_max", "asked"), [(100_000, 6400), (3200, 6400), (1600, 3200)])
def test_bridge_evidence__uses_so_many_draws_of_each_half_and_no_more(draws_max, asked, affine):
    points = []

    def counted(u):
        points.append(len(u))
        return skewed(u)

    bridge_evidence(
        counted,
        independent(skewed, skewed_draws(1)),
        affine(np.zeros(2), np.eye(2)),
        rng=np.random.default_rng(1),
        draws_max=draws_max,
    )
    assert sum(points) == asked  # as many of the proposal as of the posterior, of both halves


@pytest.mark.parametrize(("apart", "is_ok"), [(4.9, True), (5.1, False)])
def test_bridge_evidence__doubts_halves_over_five_standard_errors_apart(
    apart, is_ok, affine, monkeypatch
):
    # Variances of the halves: the standard error of their difference is 0.5. And covariances.
    halves = iter([(1.0, 0.09, 0.02), (1.0 + 0.5 * apart, 0.16, 0.04)])
    module = importlib.import_module("ridgebayes.evidence.bridge")
    monkeypatch.setattr(module, "_bridge", lambda *_: next(halves))
    found = bridge_evidence(
        skewed,
        independent(skewed, skewed_draws(1)),
        affine(np.zeros(2), np.eye(2)),
        rng=np.random.default_rng(1),
    )
    assert found.value == pytest.approx(1.0 + 0.25 * apart, rel=1e-14)  # algebra: their mean
    expected = 0.5 * math.sqrt(0.09 + 0.16 + 2 * 0.03)
    assert found.se == pytest.approx(expected, rel=1e-14)
    assert found.status == ("ok" if is_ok else f"halves of the ensembles disagree by {apart} se")


@pytest.mark.parametrize("n_parameter", [2, 6])
def test_bridge_evidence__of_a_normal_posterior_errs_as_its_standard_error_says(
    n_parameter, affine
):
    # Either half is off from the other's proposal by the same number.
    def normal(u):
        return 2.5 + stats.norm.logpdf(u).sum(axis=-1)

    where, z = affine(np.zeros(n_parameter), np.eye(n_parameter)), []
    for seed in range(600):
        draws = np.random.default_rng(seed).standard_normal((4, 10, 32, n_parameter))
        rng = np.random.default_rng(10_000 + seed)
        found = bridge_evidence(normal, independent(normal, draws), where, rng=rng)
        z.append((found.value - 2.5) / found.se)
    # Monte Carlo: the rms of 600 normal values is 1 +- 0.03; three of them. Halves taken as
    # independent have 1.22, and short chains taken for more draws than they are 1.2 or more.
    assert 0.91 < np.sqrt(np.mean(np.square(z))) < 1.09


@pytest.mark.parametrize("n_row", [3, pytest.param(5, marks=pytest.mark.long), 8])
def test_bridge_evidence__of_few_rows_errs_as_its_standard_error_says(n_row, paper):
    # One row of each texture: sigma may be next to zero, where K follows its row.
    data = Observations.from_table(paper)
    first = [np.flatnonzero(data.texture == j)[0] for j in range(n_row)]
    model = Model(data.take(np.isin(np.arange(len(data)), first)), PowerLaw())
    exact, laplace = power_law_evidence(model, tol=1e-9).value, fit_laplace(model)
    z = []
    for seed in range(20):
        found = bridge_evidence(
            model.log_density,
            sample_power_law(model, seed=seed),
            laplace,
            rng=np.random.default_rng(100 + seed),
        )
        assert found.ok
        assert found.se < 2e-3  # about a single centre: 4e-3, of a few draws that are far out
        z.append((found.value - exact) / found.se)
    # Monte Carlo: the rms of 20 normal values is 1 +- 0.16; about three of them.
    assert 0.55 < np.sqrt(np.mean(np.square(z))) < 1.5
