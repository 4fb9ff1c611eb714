"""Walks against importance sampling and known densities, and the rule that ends them."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

import ridgebayes as rb
from ridgebayes import ComputationError, Noise, SampleSettings
from ridgebayes.evidence.bridge import bridge_evidence
from ridgebayes.inference.checkpoint import Checkpoint
from ridgebayes.inference.diagnostics import effective_sample_size
from ridgebayes.inference.emcee_sampling import walk
from ridgebayes.inference.posterior import posterior_of, walked_posterior
from ridgebayes.inference.proposal import Mixture
from ridgebayes.inference.target import ModelTarget, PlainTarget
from ridgebayes.model.model import Model
from tests.drawn import importance_draws

NAMES = ("x", "y", "z")
FACTOR = np.array([[0.02, 0, 0], [-0.3, 0.1, 0], [1.0, -2.0, 5.0]])
MEAN = np.array([1.35, 0.02, -40.0])
SHORT = SampleSettings(n_walker=32, n_burn=20, n_step_max=100)


def proposal(centre, factor):
    return Mixture(np.ones(1), np.zeros(1, int), np.array(centre)[None], np.array(factor)[None])


def normal(u):
    z = np.linalg.solve(FACTOR, (u - MEAN).T)
    return -0.5 * (z * z).sum(axis=0)


def walked(settings=SHORT, *, seed=7, **options):
    target = PlainTarget("normal", NAMES, normal)
    return walk(target, proposal(MEAN, FACTOR), seed=seed, settings=settings, **options)


def worst_z(draws, mean, square):
    """Largest |estimate - exact| of E[x] and E[(x - mean)^2], in Monte Carlo standard errors."""
    flat, worst = draws - mean, 0.0
    for values, exact in ((flat, 0.0), (flat**2, square)):
        se = values.std(axis=(0, 1, 2)) / np.sqrt(effective_sample_size(values))
        worst = max(worst, float(np.abs((values.mean(axis=(0, 1, 2)) - exact) / se).max()))
    return worst


@pytest.mark.slow
def test_walk__reproduces_means_and_spreads_of_a_normal():
    # The proposal is off by a fifth in width and half an sd in place.
    off = proposal(MEAN + 0.5 * FACTOR[:, 0], 1.2 * FACTOR)
    settings = SampleSettings(n_walker=32, tau_change=0.1)
    found = walk(PlainTarget("normal", NAMES, normal), off, seed=3, settings=settings)
    assert found.chains.convergence_failures == ()
    assert worst_z(found.chains.u, MEAN, (FACTOR**2).sum(axis=1)) < 4  # the largest of six
    np.testing.assert_array_equal(found.coordinates, found.chains.u)
    assert not found.log_jacobian.any()
    value = normal(found.chains.u.reshape(-1, 3))
    np.testing.assert_allclose(found.chains.log_density.ravel(), value, rtol=1e-9, atol=1e-9)
    assert np.all((found.chains.acceptance > 0.1) & (found.chains.acceptance < 1))


@pytest.mark.slow
@pytest.mark.parametrize(
    "noise",
    ["iid", *(pytest.param(n, marks=pytest.mark.long) for n in ("texture", "texture:student"))],
)
def test_walk__and_bridge_agree_with_importance_draws(observed, noise):
    """Under Student errors with offsets each walker keeps an estimate of its density."""
    rng = np.random.default_rng(1)
    texture, Q = np.repeat(np.arange(3), 3), np.tile([4, 6, 8], 3)
    load = 2 * np.log((Q / 2 - 1) * 0.042 / 1.38) + 0.03 * rng.standard_normal(9)
    model = Model(observed(texture, Q, load), rb.Modified(), Noise.named(noise))
    target = ModelTarget(model)
    drawn = importance_draws(model, n_draw=1_024)
    found = walk(target, drawn.proposal, seed=2, settings=SampleSettings(n_tau=200))
    value = bridge_evidence(target, found, rng=np.random.default_rng(3))
    assert value.method == "bridge"
    assert value.ok
    assert found.chains.convergence_failures == ()
    se = np.hypot(value.se, drawn.evidence.se)
    assert se < 0.04
    assert abs(value.value - drawn.evidence.value) < 4 * se
    ours = walked_posterior(model, found, 2, value)
    other = posterior_of(model, drawn, 1)
    assert (ours.sampler, other.sampler) == ("emcee", "importance")
    assert ours.converged
    a, b = (np.log(one.draws) for one in (ours, other))
    # Monte Carlo error of means and variances: effective numbers are above 2,000 of each, those of
    # walks a fifth of all.
    for x, y in ((a, b), ((a - b.mean(axis=0)) ** 2, (b - b.mean(axis=0)) ** 2)):
        z = (x.mean(axis=0) - y.mean(axis=0)) / (y.std(axis=0) * np.sqrt(2 / 2_000))
        assert np.abs(z).max() < 4


@pytest.mark.slow
def test_walk__same_seed_same_bytes_other_seed_others_and_more_ensembles_the_same_first():
    one, two, other = (walked(seed=seed) for seed in (7, 7, 8))
    assert one.chains.u.tobytes() == two.chains.u.tobytes()
    assert not np.any(one.chains.u == other.chains.u)
    six = walked(replace(SHORT, n_ensemble=6))
    np.testing.assert_array_equal(six.chains.u[:4], one.chains.u)
    assert not np.any(six.chains.u[4] == six.chains.u[5])


@pytest.mark.slow
@pytest.mark.parametrize("noise", ["iid", pytest.param("texture:student", marks=pytest.mark.long)])
def test_walk__that_is_resumed_takes_the_same_steps(observed, tmp_path, noise):
    model = Model(
        observed([0, 0, 1], [4, 6, 4], [-7.0, -5.6, -6.9]), rb.Modified(), Noise.named(noise)
    )
    target, d = ModelTarget(model), len(model.outer_names)
    start = proposal(np.zeros(d), np.eye(d))
    options = {"seed": 4, "n_point": 8}
    long = replace(SHORT, n_walker=16, n_tau=500, n_step_max=130)
    short = replace(long, time_limit=1e-9)  # ends at the first check
    whole = walk(target, start, settings=long, **options)
    checkpoint = Checkpoint(tmp_path / "chain.npz", {"seed": "4"})
    part = walk(target, start, settings=short, checkpoint=checkpoint, **options)
    assert part.chains.n_step == 100
    again = walk(target, start, settings=long, checkpoint=checkpoint, **options)
    for name in ("coordinates", "log_jacobian", "scores"):
        np.testing.assert_array_equal(getattr(again, name), getattr(whole, name))
    np.testing.assert_array_equal(again.chains.u, whole.chains.u)
    np.testing.assert_array_equal(again.chains.acceptance, whole.chains.acceptance)


def test_walk__says_what_a_chain_that_is_too_short_lacks():
    chains = walked(replace(SHORT, n_tau=500)).chains
    assert chains.n_step == 100
    assert len(chains.convergence_failures) == len(NAMES) + 1
    for name, text in zip((*NAMES, "log posterior"), chains.convergence_failures, strict=True):
        assert text.startswith(f"{name}: 100 steps are not 500 tau (")
    # There is only one check, so every tau has changed, from infinity.
    chains = walked(replace(SHORT, n_tau=1)).chains
    assert [text.split(" (")[0] for text in chains.convergence_failures] == [
        f"{name}: tau was checked only once" for name in (*NAMES, "log posterior")
    ]


def test_walk__says_from_what_to_what_tau_changed():
    settings = SampleSettings(n_walker=32, n_burn=20, n_step_max=150, n_tau=25, tau_change=1e-9)
    chains = walked(settings).chains
    pattern = r"(x|y|z|log posterior): tau still changes \((\d\.\d+) to (\d\.\d+)\)"
    found = [re.fullmatch(pattern, text) for text in chains.convergence_failures]
    assert [match[1] for match in found] == [*NAMES, "log posterior"]
    # Printed digits: four of each.
    assert [float(match[3]) for match in found] == pytest.approx(chains.tau.tolist(), rel=1e-3)
    for enough in (replace(settings, tau_change=1.0), replace(settings, n_tau=10)):
        assert walked(enough).chains.convergence_failures == ()


def test_walk__ends_at_its_time_limit_and_says_so_in_one_line():
    settings = replace(SHORT, n_step_max=10_000, n_tau=500, time_limit=1e-9)
    chains = walked(settings).chains
    assert chains.n_step == 100  # a block, whatever the limit
    (text,) = chains.convergence_failures
    start = "time limit of 1e-09 s: stopped after 100 steps; x: 100 steps are not 500 tau ("
    assert text.startswith(start)
    assert str(SampleSettings(time_limit=5.0)) == str(SampleSettings())  # the same walk


@pytest.mark.slow
def test_walk__goes_on_until_the_rule_is_met_and_is_checked_seldom_where_far_too_short():
    lines = []
    chains = walked(SampleSettings(n_walker=32, tau_change=0.1), progress=lines.append).chains
    assert chains.convergence_failures == ()
    assert np.all(chains.n_step > 50 * chains.tau)
    assert lines[-1].startswith(f"{chains.n_step} steps x 4 ensembles, tau ")
    lengths = []
    settings = replace(SHORT, n_step_max=600, n_tau=800)
    walked(settings, progress=lambda text: lengths.append(int(text.split()[0])))
    assert lengths[:5] == [100, 150, 225, 337, 505]


def test_walk__starts_where_the_density_is_positive_and_refuses_one_that_is_nowhere():
    def half_line(u):
        return np.where(u[:, 0] > 0, stats.expon.logpdf(u[:, 0]), -np.inf)

    def target(log_density):
        return PlainTarget("line", ("x",), log_density)

    start = proposal([0.1], [[1.0]])
    assert np.all(walk(target(half_line), start, seed=1, settings=SHORT).chains.u > 0)
    with pytest.raises(ComputationError, match="line: expected starting points of positive"):
        walk(target(lambda u: np.full(len(u), -np.inf)), start, seed=1, settings=SHORT)
