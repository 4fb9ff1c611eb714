from dataclasses import replace

import numpy as np
import pytest
from scipy import integrate, special, stats

import ridgebayes as rb
from ridgebayes.predict.load_distribution import mix_loads
from tests.drawn import loads_of


def draws_of(seed=0, n_draw=40, shape=(3,)):
    """Centres, spreads and unequal weights of draws whose spread is comparable to the error's."""
    rng = np.random.default_rng(seed)
    weight = rng.random(n_draw)
    log_mean = -5 + 0.1 * rng.standard_normal((n_draw, *shape))
    return log_mean, rng.uniform(0.02, 0.1, n_draw), weight / weight.sum()


def mixture(seed=0, n_draw=40, shape=(3,)):
    return loads_of(*draws_of(seed, n_draw, shape))


def oracle_cdf(draws, x, i):
    """Sum of log-normal distribution functions, component by component."""
    log_mean, sd, weight = draws
    z = (np.log(x)[..., None] - log_mean[:, i]) / sd
    return special.ndtr(z) @ weight


def test_cdf__takes_a_spread_of_each_draw_and_place_too():
    log_mean, sd, weight = draws_of()
    wide = sd[:, None] * np.array([1.0, 2.0, 0.5])
    load = loads_of(log_mean, wide, weight)
    x = 0.0065
    expected = [oracle_cdf((log_mean, wide[:, i], weight), x, i) for i in range(3)]
    np.testing.assert_allclose(load.cdf(x), expected, rtol=1e-12)  # algebra


def test_quantile__of_far_apart_humps_is_found_too():
    load = loads_of(np.array([-9.0, -2.0]), np.array([0.01, 0.02]), np.array([0.3, 0.7]))
    for prob in (0.1, 0.29, 0.31, 0.9):
        assert float(load.cdf(load.quantile(prob))) == pytest.approx(prob, abs=1e-7)


def test_quantile__counts_draws_that_never_reach_the_count():
    load = loads_of(np.array([-5.0, np.inf]), np.array([0.1, 0.1]), np.array([0.8, 0.2]))
    for prob in (0.1, 0.4, 0.79):
        expected = stats.lognorm(s=0.1, scale=np.exp(-5)).ppf(prob / 0.8)
        assert float(load.quantile(prob)) == pytest.approx(expected, rel=1e-9)  # the search's
    assert float(load.quantile(0.81)) == np.inf


def test_quantile__without_error_model_is_a_weighted_order_statistic():
    load = loads_of(np.log([[4.0], [1.0], [2.0]]), np.zeros(3), np.array([0.2, 0.5, 0.3]))
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


def test_mix_loads__is_the_weighted_sum_of_distribution_functions():
    one, two = mixture(1), mixture(2, n_draw=25)
    mixed = mix_loads([one, two], [3.0, 1.0])
    x = np.array([0.006, 0.0065, 0.007])
    expected = 0.75 * one.cdf(x) + 0.25 * two.cdf(x)
    np.testing.assert_allclose(mixed.cdf(x), expected, rtol=1e-12)  # algebra
    assert mixed.weight.sum() == pytest.approx(1, rel=1e-12)


def test_mix_loads__flags_what_a_part_that_counts_flags_and_drops_what_does_not_count():
    one = mixture(1)
    flagged = replace(one, flags=np.array([1, 0, 0], np.uint8))
    assert mix_loads([one, flagged], [0.9, 0.1]).extrapolation.tolist() == [True, False, False]
    assert not mix_loads([one, flagged], [0.995, 0.005]).extrapolation.any()
    assert len(mix_loads([one, flagged], [1.0, 1e-12]).weight) == len(one.weight)


FOUR = np.array([1.0, 2.0, 0.5, 1.5])  # factors of the spread, column by column


def lazy(seed, place, highest=np.inf):
    """Draws of `draws_of` that are made when asked for, and the numbers of columns asked for."""
    log_mean, sd, weight = draws_of(seed, shape=(4,))
    asked = []

    def columns(ids):
        asked.append(len(ids))
        return log_mean[:, ids], sd[:, None] * FOUR[ids]

    flags, ends = np.zeros(place.shape, np.uint8), np.full(place.shape, highest)
    return rb.LoadDistribution(weight, columns, place, flags, ends), asked


def test_distribution__of_draws_made_when_asked_is_that_of_stored_ones():
    place = np.array([[2, 0], [0, 3]])
    load, _ = lazy(1, place)
    log_mean, sd, weight = draws_of(1, shape=(4,))
    stored = loads_of(log_mean, sd[:, None] * FOUR, weight)
    p = np.array([0.006, 0.0065, 0.0069, 0.0072])
    np.testing.assert_allclose(load.cdf(p[place]), stored.cdf(p)[place], rtol=1e-12)  # algebra
    by_hand = oracle_cdf((log_mean, 2 * sd, weight), p[1], 1)
    assert stored.cdf(p)[1] == pytest.approx(by_hand, rel=1e-12)
    for ask in (rb.LoadDistribution.mean, rb.LoadDistribution.median):
        np.testing.assert_allclose(ask(load), ask(stored)[place], rtol=1e-12)
    np.testing.assert_array_equal(load.log_mean, stored.log_mean[:, place])
    np.testing.assert_array_equal(load.sd, stored.sd[:, place])
    same = loads_of(load.log_mean, load.sd, load.weight)
    np.testing.assert_allclose(load.rvs(7, 5), same.rvs(7, 5), rtol=1e-14)


def test_extrapolation__is_of_a_median_above_what_was_calibrated():
    load, _ = lazy(1, np.array([0, 1, 2]))
    median = load.median()
    middle = float(np.sort(median)[1])
    one, _ = lazy(1, np.array([0, 1, 2]), highest=middle * (1 + 1e-6))
    assert one.extrapolation_of.tolist() == ["load" if m > middle else "" for m in median]
    two, _ = lazy(1, np.array([0, 1, 2]), highest=1.0)
    # The lower of two limits, and the mixture's own median.
    assert mix_loads([one, two], [0.5, 0.5]).extrapolation.tolist() == one.extrapolation.tolist()
    assert not mix_loads([one, two], [0.001, 0.999]).extrapolation.any()


def test_widened__adds_variances_place_by_place():
    place, rel_se = np.array([3, 3, 1]), np.array([0.0, 0.2, 0.1])
    load, _ = lazy(1, place)
    wide = load.widened(rel_se)
    np.testing.assert_allclose(wide.sd**2 - load.sd**2, [rel_se**2] * 40, atol=1e-15)  # algebra
    np.testing.assert_array_equal(wide.log_mean, load.log_mean)
    np.testing.assert_allclose(wide.median()[0], load.median()[0], rtol=1e-9)


def test_names_of_scipy__give_scipys_log_normal_where_there_is_a_single_draw():
    mean, sd = np.array([[-5.0, -4.0]]), np.array([0.3])
    load = loads_of(mean, sd, np.ones(1))
    for i in (0, 1):
        theirs = stats.lognorm(s=0.3, scale=np.exp(mean[0, i]))
        p = np.exp(mean[0, i] + 0.3 * np.array([-30.0, -2.0, 0.0, 1.5, 30.0]))
        for name in ("cdf", "sf", "pdf"):  # rounding, in both tails
            found = getattr(load, name)(p[:, None])[:, i]
            np.testing.assert_allclose(found, getattr(theirs, name)(p), rtol=1e-12)
        assert load.pdf(0.0)[i] == load.pdf(-1.0)[i] == load.cdf(-1.0)[i] == 0
        assert load.sf(0.0)[i] == 1
        np.testing.assert_allclose(
            load.ppf([[0.01], [0.5], [0.99]])[:, i], theirs.ppf([0.01, 0.5, 0.99]), rtol=1e-9
        )
        assert load.mean()[i] == pytest.approx(theirs.mean(), rel=1e-13)
        assert load.std()[i] == pytest.approx(theirs.std(), rel=1e-12)
        ends = [float(end[i]) for end in load.interval(0.8)]
        assert ends == pytest.approx(theirs.interval(0.8), rel=1e-9)  # the search's
        draws = load.rvs(size=4_000, random_state=2)[:, i]
        assert stats.kstest(draws, theirs.cdf).pvalue > 1e-4  # Monte Carlo


def test_std__of_a_mixture_is_the_root_of_the_second_moment():
    load, (log_mean, sd, weight) = mixture(), draws_of()
    first = weight @ np.exp(log_mean + 0.5 * sd[:, None] ** 2)
    second = weight @ np.exp(2 * log_mean + 2 * sd[:, None] ** 2)
    np.testing.assert_allclose(load.std(), np.sqrt(second - first**2), rtol=1e-11)  # cancels


def test_std__is_infinite_under_student_errors_and_0_at_a_point():
    load = loads_of(np.array([-5.0]), np.array([0.1]), np.ones(1))
    assert replace(load, has_mean=False).std() == np.inf
    assert loads_of(np.array([-5.0]), np.zeros(1), np.ones(1)).std() == 0


def test_quantile__of_a_probability_for_each_place_is_that_of_each():
    load, prob = mixture(), np.array([0.1, 0.5, 0.9])
    found = load.quantile(prob)
    expected = [load.quantile(p)[i] for i, p in enumerate(prob.tolist())]
    np.testing.assert_allclose(found, expected, rtol=1e-9)  # solver
    with pytest.raises(rb.InputError, match=r"got prob \(2,\), distribution \(3,\)"):
        load.quantile([0.1, 0.2])
    with pytest.raises(rb.InputError, match=r"got p_over_E \(2,\), distribution \(3,\)"):
        load.cdf([0.1, 0.2])


def test_numbers_of_a_single_place__are_scalars():
    one = mixture(shape=())
    found = [one.mean(), one.std(), one.median(), *one.interval(), one.cdf(0.006), one.ppf(0.2)]
    assert all(isinstance(number, float) for number in found)
