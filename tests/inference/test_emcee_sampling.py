import re
from dataclasses import replace

import numpy as np
import pytest

from ridgebayes.errors import ComputationError, InputError
from ridgebayes.inference import emcee_sampling
from ridgebayes.inference.chains import SampleSettings, walkers_for
from ridgebayes.inference.diagnostics import effective_sample_size, failed_diagnostics, summarise
from ridgebayes.inference.emcee_sampling import sample

NAMES = ("x", "y", "z")
SHORT = SampleSettings(n_walker=32, n_burn=20, n_step_max=100)


def worst_z(draws, mean, square):
    """Largest |estimate - exact| of E[x] and E[(x - mean)^2], in Monte Carlo standard errors."""
    flat, worst = draws - mean, 0.0
    for values, exact in ((flat, 0.0), (flat**2, square)):
        se = values.std(axis=(0, 1, 2)) / np.sqrt(effective_sample_size(values))
        worst = max(worst, float(np.abs((values.mean(axis=(0, 1, 2)) - exact) / se).max()))
    return worst


FACTOR = np.array([[0.02, 0, 0], [-0.3, 0.1, 0], [1.0, -2.0, 5.0]])
MEAN = np.array([1.35, 0.02, -40.0])


def normal(u):
    z = np.linalg.solve(FACTOR, (u - MEAN).T)
    return -0.5 * (z * z).sum(axis=0)


@pytest.mark.slow
def test_sample__reproduces_means_and_spreads_of_a_normal(affine):
    # The approximation is off by a fifth in width and half an sd in place.
    chains = sample(normal, affine(MEAN + 0.5 * FACTOR[:, 0], 1.2 * FACTOR), seed=3, names=NAMES)
    assert chains.convergence_failures == ()
    square = (FACTOR**2).sum(axis=1)
    assert worst_z(chains.u, MEAN, square) < 4  # Monte Carlo: the largest of six
    np.testing.assert_allclose(
        chains.log_density.ravel(), normal(chains.u.reshape(-1, 3)), rtol=1e-9, atol=1e-9
    )  # algebra: the density is the one in u, without the coordinates' Jacobian
    assert np.all((chains.acceptance > 0.3) & (chains.acceptance < 1))


def funnel(u):
    """u2 ~ normal(-3, 0.3) as log sigma; u0, u1 ~ normal(0, sigma)."""
    sigma = np.exp(u[:, 2])
    return (
        -0.5 * ((u[:, 2] + 3) / 0.3) ** 2
        - 0.5 * (u[:, :2] / sigma[:, None]) ** 2 @ np.ones(2)
        - 2 * u[:, 2]
    )


@pytest.mark.slow
@pytest.mark.parametrize("straightened", [0.0, 0.5, 1.0])
def test_sample__reproduces_means_and_spreads_of_a_funnel(straightened, affine):
    class Coordinates(affine):
        """Coefficients widen with this power of sigma; the Jacobian has to make up for it."""

        def unwhiten(self, z):
            u, _ = super().unwhiten(z)
            log_scale = straightened * (u[..., 2] + 3)
            u[..., :2] *= np.exp(log_scale)[..., None]
            return u, 2 * log_scale

    start = Coordinates([0, 0, -3.0], np.diag([np.exp(-3), np.exp(-3), 0.3]))
    chains = sample(funnel, start, seed=4, names=NAMES)
    assert chains.convergence_failures == ()
    square = np.array([np.exp(-6 + 2 * 0.09)] * 2 + [0.09])  # E[sigma^2] of a log-normal
    assert worst_z(chains.u, np.array([0, 0, -3.0]), square) < 4  # Monte Carlo: largest of six


def test_sample__reproduces_the_posterior_that_quadrature_gives(fits, laplaces):
    # Modified: two parameters on a grid of posterior sds, the trapezoidal rule.
    fit, laplace = fits["modified"], laplaces["modified"]
    axis = np.linspace(-9, 9, 181)
    z = np.stack(np.meshgrid(axis, axis, indexing="ij"), axis=-1).reshape(-1, 2)
    u, log_jacobian = laplace.unwhiten(z)
    log_weight = fit.model.log_density(u) + log_jacobian
    weight = np.exp(log_weight - log_weight.max())
    weight /= weight.sum()
    theta = fit.model.to_theta(u)
    mean = weight @ theta
    draws = fit.model.to_theta(fit.chains.u)
    assert worst_z(draws, mean, weight @ (theta - mean) ** 2) < 4  # Monte Carlo: largest of four


@pytest.mark.slow
def test_sample__same_seed_same_bytes_other_seed_others(affine):
    runs = [
        sample(normal, affine(MEAN, FACTOR), seed=seed, names=NAMES, settings=SHORT)
        for seed in (7, 7, 8)
    ]
    assert runs[0].u.tobytes() == runs[1].u.tobytes()
    assert runs[0].log_density.tobytes() == runs[1].log_density.tobytes()
    assert not np.any(runs[0].u == runs[2].u)


def test_sample__more_ensembles_leave_the_first_ones_as_they_were(affine):
    more = SampleSettings(n_ensemble=6, n_walker=32, n_burn=20, n_step_max=100)
    four, six = (
        sample(normal, affine(MEAN, FACTOR), seed=7, names=NAMES, settings=settings)
        for settings in (SHORT, more)
    )
    np.testing.assert_array_equal(six.u[:4], four.u)
    assert not np.any(six.u[4] == six.u[5])


def test_sample__leaves_the_global_random_state_alone(affine):
    before = np.random.get_state()[1].tolist()  # noqa: NPY002
    sample(normal, affine(MEAN, FACTOR), seed=7, names=NAMES, settings=SHORT)
    assert np.random.get_state()[1].tolist() == before  # noqa: NPY002


def test_sample__says_what_a_chain_that_is_too_short_lacks(affine):
    settings = SampleSettings(n_walker=32, n_burn=20, n_step_max=100, n_tau=500)
    chains = sample(normal, affine(MEAN, FACTOR), seed=7, names=NAMES, settings=settings)
    assert chains.n_step == 100
    assert len(chains.convergence_failures) == len(NAMES) + 1
    for name, text in zip((*NAMES, "log posterior"), chains.convergence_failures, strict=True):
        assert text.startswith(f"{name}: 100 steps are not 500 tau (")


def test_sample__ends_a_walk_at_its_time_limit_and_says_so_in_one_line(affine):
    settings = replace(SHORT, n_step_max=10_000, n_tau=500, time_limit=1e-9)
    chains = sample(normal, affine(MEAN, FACTOR), seed=7, names=NAMES, settings=settings)
    assert chains.n_step == 100  # a block, whatever the limit
    (text,) = chains.convergence_failures
    start = "time limit of 1e-09 s: stopped after 100 steps; x: 100 steps are not 500 tau ("
    assert text.startswith(start)
    enough = replace(SHORT, n_step_max=200, n_tau=1, tau_change=1.0, time_limit=600.0)
    chains = sample(normal, affine(MEAN, FACTOR), seed=7, names=NAMES, settings=enough)
    assert chains.convergence_failures == ()


def test_settings__under_another_time_limit_are_the_same_walk():
    assert str(SampleSettings(time_limit=5.0)) == str(SampleSettings())


def test_sample__says_that_tau_has_not_settled(affine):
    settings = SampleSettings(n_walker=32, n_burn=20, n_step_max=100, n_tau=1)
    chains = sample(normal, affine(MEAN, FACTOR), seed=7, names=NAMES, settings=settings)
    # There is only one check, so every tau has changed, from infinity.
    assert [text.split(" (")[0] for text in chains.convergence_failures] == [
        f"{name}: tau was checked only once" for name in (*NAMES, "log posterior")
    ]


def test_sample__says_from_what_to_what_tau_changed(affine):
    settings = SampleSettings(n_walker=32, n_burn=20, n_step_max=150, n_tau=25, tau_change=1e-9)
    chains = sample(normal, affine(MEAN, FACTOR), seed=7, names=NAMES, settings=settings)
    pattern = r"(x|y|z|log posterior): tau still changes \((\d\.\d+) to (\d\.\d+)\)"
    found = [re.fullmatch(pattern, text) for text in chains.convergence_failures]
    assert [match[1] for match in found] == [*NAMES, "log posterior"]
    # Printed digits: four of each.
    assert [float(match[3]) for match in found] == pytest.approx(chains.tau.tolist(), rel=1e-3)
    for enough in (replace(settings, tau_change=1.0), replace(settings, n_tau=10)):
        chains = sample(normal, affine(MEAN, FACTOR), seed=7, names=NAMES, settings=enough)
        assert chains.convergence_failures == ()


def test_sample__ends_a_walk_whose_draws_would_fill_the_memory(affine, monkeypatch):
    monkeypatch.setattr(emcee_sampling, "_KEPT_MAX", 4 * 32 * 4 * 130)  # numbers of 130 steps
    settings = replace(SHORT, n_step_max=10_000, n_tau=500)
    chains = sample(normal, affine(MEAN, FACTOR), seed=7, names=NAMES, settings=settings)
    assert chains.n_step == 130
    assert "130 steps are not 500 tau" in chains.convergence_failures[0]


def test_sample__a_walk_far_too_short_is_checked_seldom(affine):
    lengths = []
    settings = replace(SHORT, n_step_max=2_000, n_tau=800)
    sample(
        normal,
        affine(MEAN, FACTOR),
        seed=7,
        names=NAMES,
        settings=settings,
        progress=lambda text: lengths.append(int(text.split()[0])),
    )
    assert lengths[:5] == [100, 150, 225, 337, 505]


def test_sample__goes_on_until_the_rule_is_met(affine):
    lines = []
    chains = sample(
        normal,
        affine(MEAN, FACTOR),
        seed=7,
        names=NAMES,
        settings=SampleSettings(n_walker=32),
        progress=lines.append,
    )
    assert chains.convergence_failures == ()
    assert np.all(chains.n_step > 50 * chains.tau)
    assert len(lines) >= 2
    assert lines[-1].startswith(f"{chains.n_step} steps x 4 ensembles, tau ")


def test_sample__takes_four_walkers_per_parameter_where_that_is_more(affine):
    settings = SampleSettings(n_walker=4, n_burn=5, n_step_max=100)
    chains = sample(normal, affine(MEAN, FACTOR), seed=7, names=NAMES, settings=settings)
    assert chains.u.shape == (4, 100, 12, 3)


@pytest.mark.slow
def test_sample__walkers_stuck_apart_are_caught(affine):
    # Two needles 3 sds apart: a walker that starts at one never sees the other, and each ensemble
    # has its own shares of the two.
    def needles(u):
        apart = np.stack([(u[:, 0] - 1.5) / 1e-4, (u[:, 0] + 1.5) / 1e-4])
        return np.logaddexp(*(-0.5 * np.minimum(apart**2, 1e12)))

    chains = sample(
        needles,
        affine([0.0], [[1.0]]),
        seed=1,
        names=("x",),
        settings=SampleSettings(n_walker=8, n_burn=400, n_step_max=600),
    )
    assert {-1, 1} == set(np.sign(chains.u).ravel())  # both are inhabited
    convergence_failures = chains.convergence_failures + failed_diagnostics(
        summarise(chains.u, ("x",))
    )
    assert any(text.startswith("x: R-hat") for text in convergence_failures)


def test_sample__starts_where_the_density_is_positive(affine):
    def half_line(u):
        return np.where(u[:, 0] > 0, -u[:, 0], -np.inf)

    chains = sample(half_line, affine([0.1], [[1.0]]), seed=1, names=("x",), settings=SHORT)
    assert np.all(chains.u > 0)


def test_sample__refuses_a_density_that_is_nowhere_positive(affine):
    def nowhere(u):
        return np.full(len(u), -np.inf)

    with pytest.raises(ComputationError, match="expected draws of positive density, got none of"):
        sample(nowhere, affine([0.0], [[1.0]]), seed=1, names=("x",), settings=SHORT)


def test_sample_settings__refuse_too_few_ensembles_and_odd_walkers():
    with pytest.raises(InputError, match="n_ensemble: expected at least 4, got 3"):
        SampleSettings(n_ensemble=3)
    for bad in (2, 33):
        with pytest.raises(InputError, match=f"n_walker: expected even and at least 4, got {bad}"):
            SampleSettings(n_walker=bad)


@pytest.mark.slow
def test_sample__starts_more_walkers_than_a_round_of_adaptation_has_draws(affine):
    settings = replace(SHORT, n_walker=1_024)
    chains = sample(normal, affine(MEAN, FACTOR), seed=1, names=NAMES, settings=settings)
    assert chains.u.shape[2] == 1_024


@pytest.mark.parametrize(
    ("n_texture", "is_iid_gaussian", "expected"),
    [(9, True, 512), (9, False, 64), (500, True, 64), (5_000, True, 32), (5_000, False, 32)],
)
def test_walkers_for__takes_many_where_densities_are_cheap(n_texture, is_iid_gaussian, expected):
    assert walkers_for(n_texture, is_iid_gaussian) == expected
