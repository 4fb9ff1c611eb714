import math

import emcee
import numpy as np
import pytest
from scipy import stats

from ridgebayes.inference.diagnostics import autocorrelation_time
from ridgebayes.inference.moves import _DF, _SCALE, Independence, Weighted, adapted, weighted

N_STEP, N_WALKER = 1_500, 64


def worst_z(move, log_density, exact, start, seed=1, n_step=N_STEP):
    """Largest |estimate - exact| of E[x] and E[x^2], in Monte Carlo standard errors."""
    n_dim = start.shape[1]
    sampler = emcee.EnsembleSampler(len(start), n_dim, log_density, moves=move, vectorize=True)
    state = emcee.State(start)
    state.random_state = np.random.RandomState(seed).get_state()
    sampler.run_mcmc(state, n_step + 200)
    x = sampler.get_chain(discard=200)
    worst = 0.0
    for power, moments in zip((1, 2), exact, strict=True):
        values = x**power
        ess = values.shape[0] * values.shape[1] / autocorrelation_time(values)
        se = values.std(axis=(0, 1)) / np.sqrt(ess)
        worst = max(worst, np.abs((values.mean(axis=(0, 1)) - moments) / se).max())
    return worst


def normal_check(make, **effort):
    """A standard normal of five dimensions, started from exact draws of it."""
    start = np.random.default_rng(0).standard_normal((N_WALKER, 5))
    exact = (np.zeros(5), np.ones(5))
    return worst_z(make(5), lambda z: -0.5 * (z * z).sum(axis=1), exact, start, **effort)


def skewed_check(make):
    """Two gamma variables by their logarithms: x = log g, E[x] and E[x^2] by quadrature."""
    shape = np.array([6.0, 12.0])
    oracle = [stats.loggamma(k) for k in shape]
    moments = np.array([[d.moment(1), d.moment(2)] for d in oracle]).T
    centre, sd = moments[0], np.sqrt(moments[1] - moments[0] ** 2)
    start = (np.log(np.random.default_rng(0).gamma(shape, size=(N_WALKER, 2))) - centre) / sd

    def log_density(z):
        x = centre + sd * z
        return (shape * x - np.exp(x)).sum(axis=1)

    return worst_z(make(2), log_density, (np.zeros(2), np.ones(2)), start)


def independence(k, m=0):
    return emcee.moves.MHMove(Independence.standard(k, m))


OURS = {
    "independence": independence,
    "independence, some coordinates normal": lambda k: independence(k - 1, 1),
    "differential evolution": lambda k: emcee.moves.DEMove(),
    "mix": lambda k: [(independence(k), 0.8), (emcee.moves.DEMove(), 0.2)],
}


@pytest.mark.slow
@pytest.mark.parametrize("check", [normal_check, skewed_check])
@pytest.mark.parametrize("name", OURS)
def test_move__alone_and_in_the_mix_keeps_means_and_spreads(name, check):
    assert check(OURS[name]) < 4  # Monte Carlo: the largest of ten or four, in standard errors


@pytest.mark.slow
def test_move__a_wrong_one_fails_the_same_check():
    # emcee 3.1.6's DESnookerMove draws sds that are a third too small.
    assert normal_check(lambda k: emcee.moves.DESnookerMove(), n_step=500) > 10


def proposal():
    """Three components in a plane; a coordinate that is normal, and one of two halves."""
    factors = np.array([np.eye(2), [[0.5, 0.0], [0.3, 0.2]], [[2.0, 0.0], [-1.0, 0.7]]])
    centres = np.array([[0.0, 0.0], [3.0, -1.0], [-2.0, 2.0]])
    rest = np.array([[0.3, -0.2], [1.2, 0.8], [1.2, 0.5]])
    return Independence(np.array([0.5, 0.2, 0.3]), centres, factors, rest)


class TwoHalves:
    """A normal whose halves have different widths, by SciPy's halves of normals."""

    def __init__(self, mode, below, above):
        self.share = below / (below + above)
        self.low = stats.halfnorm(0, _SCALE * below)
        self.high = stats.halfnorm(0, _SCALE * above)
        self.mode = mode

    def logpdf(self, x):
        off = x - self.mode
        both = self.share * self.low.pdf(-off) + (1 - self.share) * self.high.pdf(off)
        return np.log(both)

    def cdf(self, x):
        off = x - self.mode
        return self.share * self.low.sf(-off) + (1 - self.share) * self.high.cdf(off)


def test_independence__standard_is_a_students_t_beside_standard_normals():
    z = np.random.default_rng(3).standard_normal((50, 5))
    oracle = stats.multivariate_t(np.zeros(3), _SCALE**2 * np.eye(3), df=_DF)
    expected = oracle.logpdf(z[:, :3]) + stats.norm(0, _SCALE).logpdf(z[:, 3:]).sum(axis=1)
    found = Independence.standard(3, 2).log_pdf(z)
    np.testing.assert_allclose(found, expected, rtol=1e-11)  # algebra


def test_independence__density_is_that_of_the_mixture():
    move, z = proposal(), np.random.default_rng(3).standard_normal((50, 4))
    parts = [
        weight * stats.multivariate_t(centre, _SCALE**2 * factor @ factor.T, df=_DF).pdf(z[:, :2])
        for weight, centre, factor in zip(move.weights, move.centres, move.factors, strict=True)
    ]
    last = [TwoHalves(*one).logpdf(x) for one, x in zip(move.rest.T, z[:, 2:].T, strict=True)]
    expected = np.log(sum(parts)) + sum(last)
    np.testing.assert_allclose(move.log_pdf(z), expected, rtol=1e-11)  # algebra


def test_independence__candidates_are_draws_of_that_density():
    move = proposal()
    z, _ = move(np.zeros((20_000, 4)), np.random.RandomState(2))
    directions = np.array([[1.0, 0.0], [0.0, 1.0], [0.6, 0.8]])
    for direction in directions:
        # A t along a line is a t: the mixture's distribution function along it.
        def cdf(x, direction=direction):
            shapes = np.linalg.norm(direction @ move.factors, axis=-1)
            z = (x[:, None] - move.centres @ direction) / (_SCALE * shapes)
            return stats.t(_DF).cdf(z) @ move.weights

        # Monte Carlo: Kolmogorov-Smirnov, p above 1e-4 (3.9 standard errors) at a fixed seed.
        assert stats.kstest(z[:, :2] @ direction, cdf).pvalue > 1e-4
    for i in (0, 1):
        assert stats.kstest(z[:, 2 + i], TwoHalves(*move.rest[:, i]).cdf).pvalue > 1e-4
    # The mean of another density over this one: 1, whatever dependence the marginals do not show.
    other = stats.multivariate_normal([0.5, 0.2, 0.3, -0.2], np.diag([1.5, 1.0, 1.0, 0.5]))
    ratio = np.exp(other.logpdf(z) - move.log_pdf(z))
    se = ratio.std() / np.sqrt(len(z))
    assert se < 0.02
    assert abs(ratio.mean() - 1) < 4 * se  # Monte Carlo


def test_independence__log_ratio_of_there_and_back_is_antisymmetric():
    move, old = proposal(), np.random.default_rng(4).standard_normal((50, 4))
    new, log_ratio = move(old, np.random.RandomState(2))

    class Back(Independence):
        def rvs(self, random, n):
            return old

    again, back = Back(move.weights, move.centres, move.factors, move.rest)(new, None)
    np.testing.assert_array_equal(again, old)
    np.testing.assert_allclose(back, -log_ratio, rtol=0, atol=1e-13)  # rounding: a difference
    assert np.ptp(log_ratio) > 1


def test_independence__remembers_nothing_of_where_walkers_stand():
    propose = proposal()
    here, _ = propose(np.zeros((5, 4)), np.random.RandomState(1))
    there, _ = propose(np.full((5, 4), 9.0), np.random.RandomState(1))
    assert here.tolist() == there.tolist()


def humps(rng, n):
    """A narrow hump and a wide one, 6 apart; beside them two normals."""
    near = rng.random(n) < 0.35
    first = np.where(near[:, None], [3.0, 1.0], [-3.0, 0.0])
    first = first + np.where(near[:, None], 0.2, 1.0) * rng.standard_normal((n, 2))
    last = [0.4, -1.0] + np.array([0.9, 1.3]) * rng.standard_normal((n, 2))
    return np.concatenate([first, last], axis=1)


def test_fitted__follows_a_target_of_two_humps():
    points = humps(np.random.default_rng(5), 4_000)
    move = Independence.fitted(points, 2, np.random.default_rng(6))
    assert move.weights.sum() == pytest.approx(1, rel=1e-12)  # algebra
    near = move.weights[move.centres[:, 0] > 0].sum()
    # Monte Carlo: four standard errors of a share of 4,000; 0.003 that wide components give away.
    assert near == pytest.approx(0.35, abs=0.033)
    np.testing.assert_allclose(move.rest[0], points[:, 2:].mean(axis=0), rtol=1e-12)
    # The variance has a floor, a tenth's square, added to it.
    spread = np.sqrt(points[:, 2:].var(axis=0) + 0.1**2)
    np.testing.assert_allclose(move.rest[1], spread, rtol=1e-12)  # algebra
    # What the fit is for: far more candidates are accepted than from one component.
    target = stats.multivariate_normal

    def log_density(z):
        last = stats.norm([0.4, -1.0], [0.9, 1.3]).logpdf(z[:, 2:]).sum(axis=1)
        parts = [
            np.log(0.35) + target([3.0, 1.0], 0.04).logpdf(z[:, :2]),
            np.log(0.65) + target([-3.0, 0.0], 1.0).logpdf(z[:, :2]),
        ]
        return np.logaddexp(*parts) + last

    fresh = humps(np.random.default_rng(7), 4_000)

    def acceptance(move):
        candidates, log_ratio = move(fresh, np.random.RandomState(8))
        return np.exp(np.minimum(log_density(candidates) - log_density(fresh) + log_ratio, 0))

    one = Independence.fitted(points, 2, np.random.default_rng(6), n_component=1)
    assert acceptance(move).mean() > 0.6
    assert acceptance(one).mean() < 0.35


def test_fitted__of_one_component_has_mean_and_covariance_of_the_draws():
    rng = np.random.default_rng(9)
    points = rng.standard_normal((500, 3)) @ np.array([[1, 0.5, 0], [0, 2, 0], [0.3, 0, 1.0]])
    move = Independence.fitted(points, 3, rng, n_component=1)
    np.testing.assert_allclose(move.centres[0], points.mean(axis=0), rtol=1e-9)
    # The common covariance, a ridge of 1e-4 on it, weighs 4 of 520 draws more; the draws' own lacks
    # a degree of freedom.
    found, own = move.factors[0] @ move.factors[0].T, np.cov(points.T)
    expected = (499 * own + 0.2 * 20 * (own + 1e-4 * np.eye(3))) / 520
    np.testing.assert_allclose(found, expected, rtol=1e-9)  # algebra
    assert move.rest.shape == (3, 0)


def test_fitted__last_coordinates_have_halves_of_the_draws_widths_where_they_are_skewed():
    rng, n = np.random.default_rng(9), 20_000
    off = rng.standard_normal(n)
    skewed = np.where(rng.random(n) < 0.2, 0.7 - 0.25 * abs(off), 0.7 + abs(off))
    move = Independence.fitted(np.stack([rng.standard_normal(n), off, skewed]).T, 1, rng)
    mean, variance = off.mean(), off.var()
    assert move.rest[:, 0] == pytest.approx([mean, *2 * [math.sqrt(variance + 0.01)]], rel=1e-12)
    # A step of two per cent of the draws in the mode, and its share in the widths.
    assert move.rest[:, 1] == pytest.approx([0.7, math.hypot(0.25, 0.1), 1.005], abs=0.05)


@pytest.mark.slow
def test_move__of_a_fitted_mixture_keeps_means_and_spreads_of_two_humps():
    start = humps(np.random.default_rng(10), N_WALKER)
    move = Independence.fitted(humps(np.random.default_rng(5), 2_000), 2, np.random.default_rng(6))
    mean = np.array([0.35 * 3 - 0.65 * 3, 0.35, 0.4, -1.0])
    spread = np.array([0.35 * 0.04 + 0.65, 0.35 * 0.04 + 0.65, 0.81, 1.69])
    square = spread + np.array([9.0, 0.35, 0.16, 1.0])

    def log_density(z):
        last = -0.5 * (((z[:, 2:] - [0.4, -1.0]) / [0.9, 1.3]) ** 2).sum(axis=1)
        parts = [
            np.log(0.35 / 0.04) - 0.5 * (((z[:, :2] - [3.0, 1.0]) / 0.2) ** 2).sum(axis=1),
            np.log(0.65) - 0.5 * ((z[:, :2] - [-3.0, 0.0]) ** 2).sum(axis=1),
        ]
        return np.logaddexp(*parts) + last

    # Monte Carlo: the largest of eight, in standard errors.
    assert worst_z(emcee.moves.MHMove(move), log_density, (mean, square), start) < 4


def normal(mean, sd, log_integral):
    """Log density of independent normals whose integral is not one."""
    mean, sd = np.asarray(mean), np.asarray(sd)
    peak = log_integral - np.log(sd * math.sqrt(2 * math.pi)).sum()
    return lambda z: peak - 0.5 * (((z - mean) / sd) ** 2).sum(axis=1)


def test_weighted__mean_weight_is_the_densitys_integral():
    target = normal([0.3, -0.2, 0.4], [0.8, 1.1, 0.9], 5.0)
    proposal = Independence.standard(2, 1)
    draws = weighted(target, proposal, np.random.default_rng(1), 5_100)  # no whole batches
    assert draws.z.shape == (5_100, 3)
    np.testing.assert_allclose(draws.log_density, target(draws.z), rtol=1e-13)  # rounding
    expected = target(draws.z) - proposal.log_pdf(draws.z)
    np.testing.assert_allclose(draws.log_weight, expected, rtol=1e-12, atol=1e-12)  # rounding
    assert draws.relative.mean() == pytest.approx(1, rel=1e-12)  # algebra
    se = draws.relative.std() / math.sqrt(5_100)
    assert se < 0.02
    assert abs(draws.log_mean - 5.0) < 4 * se  # Monte Carlo


def ladder(weights):
    with np.errstate(divide="ignore"):
        log_weight = np.log(weights) + 300.0
    return Weighted(np.arange(len(weights))[:, None], log_weight, log_weight)


def test_resampled__indices_follow_the_weights():
    weights = np.array([0.0, 0.5, 3.0, 1.25, 0.0, 0.25])
    for seed in range(20):
        index = ladder(weights).resampled(np.random.default_rng(seed), 1_001)
        expected = 1_001 * weights / weights.sum()
        # Evenly spaced: each is drawn its share of times, up to one.
        assert np.all(np.abs(np.bincount(index, minlength=6) - expected) < 1 + 1e-9)  # rounding
        assert set(index.tolist()) == {1, 2, 3, 5}
        assert np.any(np.diff(index) < 0)  # shuffled


def test_resampled__cuts_weights_above_the_largest():
    weights = np.array([90.0, 4.0, 3.0, 3.0])
    index = ladder(weights).resampled(np.random.default_rng(1), 1_000, largest=1.0)
    cut = np.array([1.0, 0.16, 0.12, 0.12])  # over their mean of 25
    expected = 1_000 * cut / cut.sum()
    assert np.all(np.abs(np.bincount(index) - expected) < 1 + 1e-9)  # rounding


def test_adapted__follows_a_shifted_narrow_target():
    mean, sd = np.array([3.0, -2.0, 0.5]), np.array([0.05, 0.2, 0.7])
    target = normal(mean, sd, -7.0)
    first = weighted(target, Independence.standard(2, 1), np.random.default_rng(2), 2_000)
    proposal, draws = adapted(target, 2, 1, np.random.default_rng(2))
    assert len(draws.z) == 2_000

    def effective(draws):
        return 1 / np.mean(draws.relative**2)

    assert effective(first) < 0.01
    assert effective(draws) > 0.5
    weight = draws.relative / 2_000
    se = np.sqrt(np.sum((weight[:, None] * (draws.z - mean)) ** 2, axis=0))
    assert np.all(np.abs(weight @ draws.z - mean) < 4 * se)  # Monte Carlo
    assert np.all(se < 0.05 * sd)
    assert abs(draws.log_mean + 7.0) < 4 * draws.relative.std() / math.sqrt(2_000)  # Monte Carlo
    # The last draws are the last proposal's.
    expected = target(draws.z) - proposal.log_pdf(draws.z)
    np.testing.assert_allclose(draws.log_weight, expected, rtol=1e-12, atol=1e-12)  # rounding
    # Means of components: within a few widths of what they were fitted to.
    assert np.all(np.abs(proposal.weights @ proposal.centres - mean[:2]) < 0.2 * sd[:2])


def test_adapted__same_stream_same_draws():
    target = normal([0.3, 0.1], [0.8, 1.1], 0.0)
    one, two = (
        adapted(target, 1, 1, np.random.default_rng(3), n_round=2, n=300)[1] for _ in range(2)
    )
    assert one.z.tobytes() == two.z.tobytes()
    assert one.log_weight.tobytes() == two.log_weight.tobytes()
