import numpy as np
import pytest
from scipy import integrate, special, stats

from ridgebayes.errors import InputError
from ridgebayes.predict.load_distribution import LoadDistribution, mix_loads

PROBABILITIES = (1e-4, 0.05, 0.5, 0.9, 0.9999)


def draws_of(seed=0, n_draw=40, shape=(3,)):
    """Centres, spreads and unequal weights of draws whose spread is comparable to the error's."""
    rng = np.random.default_rng(seed)
    weight = rng.random(n_draw)
    log_mean = -5 + 0.1 * rng.standard_normal((n_draw, *shape))
    return log_mean, rng.uniform(0.02, 0.1, n_draw), weight / weight.sum()


def mixture(seed=0, n_draw=40, shape=(3,)):
    return LoadDistribution(*draws_of(seed, n_draw, shape), np.zeros(shape, bool))


def oracle_cdf(draws, x, i):
    """Sum of log-normal distribution functions, component by component."""
    log_mean, sd, weight = draws
    z = (np.log(x)[..., None] - log_mean[:, i]) / sd
    return special.ndtr(z) @ weight


def test_cdf__is_the_sum_of_log_normals():
    load = mixture()
    x = 0.0065
    expected = [oracle_cdf(draws_of(), x, i) for i in range(3)]
    np.testing.assert_allclose(load.cdf(x), expected, rtol=1e-12)  # algebra
    assert load.cdf(0.0).tolist() == [0, 0, 0]
    assert load.cdf(1e6).tolist() == pytest.approx([1, 1, 1], rel=1e-14)


def test_cdf__takes_a_spread_of_each_draw_and_place_too():
    log_mean, sd, weight = draws_of()
    wide = sd[:, None] * np.array([1.0, 2.0, 0.5])
    load = LoadDistribution(log_mean, wide, weight, np.zeros(3, bool))
    x = 0.0065
    expected = [oracle_cdf((log_mean, wide[:, i], weight), x, i) for i in range(3)]
    np.testing.assert_allclose(load.cdf(x), expected, rtol=1e-12)  # algebra


@pytest.mark.parametrize("prob", PROBABILITIES)
def test_quantile__inverts_the_cdf(prob):
    load = mixture()
    # Discretisation: the search stops at 1e-10 in log load, times a density of about 5.
    np.testing.assert_allclose(load.cdf(load.quantile(prob)), prob, atol=1e-8)


def test_quantile__of_one_log_normal_is_the_closed_form():
    load = LoadDistribution(np.array([[-5.0]]), np.array([0.3]), np.ones(1), np.array([False]))
    for prob in PROBABILITIES:
        expected = stats.lognorm(s=0.3, scale=np.exp(-5)).ppf(prob)
        np.testing.assert_allclose(load.quantile(prob), expected, rtol=1e-8)  # search: 1e-10


def test_quantile__of_far_apart_humps_is_found_too():
    load = LoadDistribution(
        np.array([-9.0, -2.0]), np.array([0.01, 0.02]), np.array([0.3, 0.7]), np.array(False)
    )
    for prob in (0.1, 0.29, 0.31, 0.9):
        assert float(load.cdf(load.quantile(prob))) == pytest.approx(prob, abs=1e-7)


def test_quantile__without_error_model_is_a_weighted_order_statistic():
    load = LoadDistribution(
        np.log([[4.0], [1.0], [2.0]]), np.zeros(3), np.array([0.2, 0.5, 0.3]), np.array([False])
    )
    found = [float(load.quantile(prob)[0]) for prob in (0.1, 0.5, 0.51, 0.8, 0.81, 0.99)]
    assert found == pytest.approx([1, 1, 2, 2, 4, 4], rel=1e-14)  # algebra: exp of log
    assert float(load.cdf(2.5)[0]) == pytest.approx(0.8, rel=1e-14)


def test_mean__is_the_integral_of_the_survival():
    load, draws = mixture(shape=(2,)), draws_of(shape=(2,))
    for i in (0, 1):
        total, _ = integrate.quad(
            lambda x, i=i: 1 - oracle_cdf(draws, x, i), 1e-9, 0.05, points=[0.005, 0.007, 0.01]
        )
        assert load.mean()[i] == pytest.approx(total, rel=1e-6)  # discretisation: quad's


@pytest.mark.slow
def test_rvs__has_the_mean_and_the_distribution():
    load, n = mixture(), 20_000
    draws = load.rvs(3, size=n)
    assert draws.shape == (n, 3)
    # Monte Carlo: 4.5 standard errors, 1e-4 for Kolmogorov-Smirnov.
    assert np.all(np.abs(draws.mean(0) - load.mean()) < 4.5 * draws.std(0) / np.sqrt(n))
    for i in range(3):
        test = stats.kstest(draws[:, i], lambda x, i=i: oracle_cdf(draws_of(), x, i))
        assert test.pvalue > 1e-4
    assert draws.tolist() == load.rvs(3, size=n).tolist()


def test_median_and_interval__are_quantiles():
    load = mixture()
    assert load.median().tolist() == load.quantile(0.5).tolist()
    lower, upper = load.interval(0.8)
    np.testing.assert_allclose(lower, load.quantile(0.1), rtol=1e-9)  # 0.5 - 0.4 rounds
    np.testing.assert_allclose(upper, load.quantile(0.9), rtol=1e-9)


@pytest.mark.parametrize("bad", [0, 1, -0.5, np.nan])
def test_quantile__refuses_what_is_no_probability_inside(bad):
    with pytest.raises(InputError, match=rf"prob: expected 0 < prob < 1, .*, got {bad}"):
        mixture().quantile(bad)


def test_mix_loads__is_the_weighted_sum_of_distribution_functions():
    one, two = mixture(1), mixture(2, n_draw=25)
    mixed = mix_loads([one, two], [3.0, 1.0])
    x = np.array([0.006, 0.0065, 0.007])
    expected = 0.75 * one.cdf(x) + 0.25 * two.cdf(x)
    np.testing.assert_allclose(mixed.cdf(x), expected, rtol=1e-12)  # algebra
    assert mixed.weight.sum() == pytest.approx(1, rel=1e-12)


def test_mix_loads__flags_what_a_part_that_counts_flags_and_drops_what_does_not_count():
    one = mixture(1)
    flagged = LoadDistribution(one.log_mean, one.sd, one.weight, np.array([True, False, False]))
    assert mix_loads([one, flagged], [0.9, 0.1]).extrapolation.tolist() == [True, False, False]
    assert not mix_loads([one, flagged], [0.995, 0.005]).extrapolation.any()
    assert len(mix_loads([one, flagged], [1.0, 1e-12]).weight) == len(one.weight)
