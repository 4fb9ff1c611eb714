import itertools
import math
from fractions import Fraction

import numpy as np
import pytest
from scipy import stats

from studies.uniformity import ranks_to_pit, simultaneous_band, uniformity

N_SAMPLE = 20_000


def ecdfs(values, z):
    """Return the ECDF of each row of `values` at each of `z`."""
    place = np.searchsorted(z, values)  # the first point that is not below the value
    row = np.arange(len(values))[:, None] * (len(z) + 1)
    count = np.bincount((row + place).ravel(), minlength=len(values) * (len(z) + 1))
    return count.reshape(len(values), -1).cumsum(axis=1)[:, :-1] / values.shape[1]


def share_inside(values, band):
    ecdf = ecdfs(values, band.z)
    return np.mean(np.all((ecdf >= band.lower) & (ecdf <= band.upper), axis=1))


def standard_error(prob, n=N_SAMPLE):
    return np.sqrt(prob * (1 - prob) / n)


def by_paper(band):
    """Säilynoja et al. (2022): the counts as a Markov chain with binomial steps, what leaves."""
    n = band.n
    lower, upper = (np.rint(n * side).astype(int) for side in (band.lower, band.upper))
    count = np.arange(n + 1)
    weight, before, left = np.eye(1, n + 1)[0], 0.0, 0.0
    for z, low, high in zip(band.z, lower, upper, strict=True):
        step = stats.binom.pmf(
            count - count[:, None], n - count[:, None], (z - before) / (1 - before)
        )
        weight, before = weight @ step, z
        out = (count < low) | (count > high)
        left += weight[out].sum()
        weight = np.where(out, 0.0, weight)
    return left


def by_enumeration(n, k):
    """Return level and probability of every way that n values fall into k equal parts."""
    found = {}
    for parts in itertools.product(range(n + 1), repeat=k):
        if sum(parts) == n:
            counts = np.cumsum(parts)[:-1]
            level = min(
                2 * min(tail(n, Fraction(i + 1, k), c), tail(n, Fraction(k - i - 1, k), n - c))
                for i, c in enumerate(counts.tolist())
            )
            ways = math.factorial(n) // math.prod(math.factorial(c) for c in parts)
            found[parts] = min(level, Fraction(1)), Fraction(ways, k**n)
    return found


def tail(n, z, count):
    return sum(math.comb(n, c) * z**c * (1 - z) ** (n - c) for c in range(count + 1))


@pytest.mark.parametrize("n", [20, 100, 500])
def test_band__holds_the_whole_ecdf_of_simulated_uniform_samples(n):
    values = np.random.default_rng(n).random((N_SAMPLE, n))
    for prob in (0.5, 0.8, 0.95, 0.99):
        band = simultaneous_band(n, prob)
        share = share_inside(values, band)
        # Monte Carlo: 3 standard errors.
        assert share == pytest.approx(band.coverage, abs=3 * standard_error(prob))
        if prob > 0.9:  # below, the band of 20 values cannot meet every probability
            assert share == pytest.approx(prob, abs=3 * standard_error(prob))


@pytest.mark.parametrize("n_draw", [5, 63, 149])
def test_band__of_ranks_holds_the_whole_ecdf_of_uniform_integers(n_draw):
    ranks = np.random.default_rng(n_draw).integers(0, n_draw + 1, (N_SAMPLE, 100))
    for prob in (0.5, 0.8, 0.95, 0.99):
        band = simultaneous_band(100, prob, n_draw=n_draw)
        share = share_inside(ranks_to_pit(ranks, n_draw), band)
        # Monte Carlo: 3 standard errors.
        assert share == pytest.approx(band.coverage, abs=3 * standard_error(prob))
        if prob > 0.9:
            assert share == pytest.approx(prob, abs=3 * standard_error(prob))


def test_band__is_left_by_ranks_at_points_between_their_values():
    ranks = np.random.default_rng(15).integers(0, 16, (N_SAMPLE, 500))
    assert share_inside(ranks_to_pit(ranks, 15), simultaneous_band(500, n_point=100)) < 0.5


@pytest.mark.parametrize(("n", "k"), [(4, 4), (6, 3), (3, 5)])
def test_p_value_and_coverage__are_those_of_all_outcomes_counted(n, k):
    outcomes = by_enumeration(n, k)
    assert sum(probability for _, probability in outcomes.values()) == 1
    exact = {
        parts: sum(probability for other, probability in outcomes.values() if other <= level)
        for parts, (level, _) in outcomes.items()
    }
    for parts, expected in exact.items():
        pit = np.repeat((np.arange(k) + 0.5) / k, parts)
        # Algebra: a few hundred roundings.
        assert uniformity(pit, n_point=k).p_value == pytest.approx(float(expected), rel=1e-12)
    for prob in (0.5, 0.8, 0.9, 0.95, 0.99):
        narrowest = min(1 - p for p in [*exact.values(), 0] if 1 - p >= prob)
        band = simultaneous_band(n, prob, n_point=k)
        assert band.coverage == pytest.approx(float(narrowest), rel=1e-12)  # algebra


@pytest.mark.parametrize(
    "points", [{}, {"n_point": 37}, {"n_draw": 63}, {"n_draw": 400}, {"n_draw": 400, "n_point": 7}]
)
@pytest.mark.parametrize("prob", [0.5, 0.99, 1 - 1e-9])
def test_coverage__is_that_of_the_published_recursion(points, prob):
    band = simultaneous_band(150, prob, **points)
    # Algebra: the same probability by another recursion; 1 - coverage is rounded at 1e-16.
    assert 1 - band.coverage == pytest.approx(by_paper(band), rel=1e-9, abs=5e-16)


def test_p_value__keeps_its_digits_where_it_is_very_small():
    # No value at or below 1/2 in 60, at the one point: twice 0.5 ** 60.
    found = uniformity(np.full(60, 0.75), n_point=2)
    assert found.p_value == pytest.approx(2 * 0.5**60, rel=1e-10, abs=0)  # algebra


@pytest.mark.parametrize("n_draw", [None, 63])
def test_p_value__is_uniform_for_uniform_values(n_draw):
    rng = np.random.default_rng(3)
    n_sample = 2_000
    values = rng.random((n_sample, 100))
    if n_draw is not None:
        values = ranks_to_pit(np.floor((n_draw + 1) * values), n_draw)
    p = np.array([uniformity(pit, n_draw=n_draw).p_value for pit in values])
    for level in (0.01, 0.05, 0.1, 0.3, 0.5, 0.7, 0.9):
        # P-values of counts have gaps: the largest possible one up to the level.
        possible = 1 - simultaneous_band(100, 1 - level, n_draw=n_draw).coverage
        # Monte Carlo: 3 standard errors.
        error = 3 * standard_error(level, n_sample)
        assert np.mean(p <= level) == pytest.approx(possible, abs=error)
        assert possible <= level
        if level < 0.3:
            assert np.mean(p <= level) == pytest.approx(level, abs=error)


@pytest.mark.parametrize("seed", range(6))
def test_p_value__is_where_the_band_is_left(seed):
    pit = np.random.default_rng(seed).beta(1.0 + 0.1 * seed, 1, 80)
    p = uniformity(pit).p_value
    just_above, just_below = (uniformity(pit, 1 - p * (1 + sign * 1e-6)) for sign in (1, -1))
    assert (just_above.inside, just_below.inside) == (False, True)
    assert just_above.largest_excess > 0 == just_below.largest_excess


def test_p_value__sees_a_bent_distribution():
    rng = np.random.default_rng(5)
    found = [uniformity(rng.beta(1.2, 1, 500)) for _ in range(200)]
    rejected = np.mean([not one.inside for one in found])
    uniform = np.mean([not uniformity(rng.random(500)).inside for _ in range(200)])
    # Monte Carlo: 3 standard errors are 0.09 and 0.02. Of 1,000 other samples 0.78 were rejected.
    assert rejected > 0.78 - 0.09
    assert uniform <= 0.01 + 0.02


def test_uniformity__counts_values_at_a_point_and_measures_the_excess():
    pit = np.array([0.25] * 30 + [0.3] * 5 + [1.0] * 5)
    found = uniformity(pit, 0.9, n_point=4)
    band = simultaneous_band(40, 0.9, n_point=4)
    assert found.ecdf.tolist() == [0.75, 0.875, 0.875]
    assert found.upper.tolist() == band.upper.tolist()
    assert found.lower.tolist() == band.lower.tolist()
    assert found.largest_excess == 0.75 - band.upper[0]
    assert (found.n, found.prob, found.inside) == (40, 0.9, False)
    below = uniformity([0.8] * 40, 0.9, n_point=4)
    assert below.largest_excess == band.lower[2]
    assert not below.inside
