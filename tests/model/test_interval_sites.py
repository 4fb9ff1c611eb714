"""Normals for intervals against the moments that quadrature gives."""

import numpy as np
import pytest
from scipy import stats

from ridgebayes.model.interval_sites import count_sites, interval_sites

CASES = [  # low, high, mean and variance of the cavity, own variance
    (-0.3, 0.4, 0.1, 0.2, 0.01),  # narrower than the cavity
    (-3.0, 4.0, 0.5, 0.2, 0.01),  # nearly all inside
    (0.5, 2.0, -1.0, 0.3, 0.04),  # outside
    (-np.inf, 0.2, 0.4, 0.5, 0.02),
    (-0.2, np.inf, -0.1, 0.05, 0.1),
    (0.3, 0.3001, 0.1, 0.2, 0.05),  # nearly exact
]


def moments(low, high, mean, variance, own):
    """Mean and variance of the offset, and of the error, given the interval."""
    f, e = (stats.norm(m, np.sqrt(v)) for m, v in ((mean, variance), (0.0, own)))
    found = []
    for one, other in ((f, e), (e, f)):
        # The trapezoidal rule of a smooth density: exact to rounding at such steps.
        x = one.mean() + np.linspace(-12, 12, 20_001) * one.std()
        weight = one.pdf(x) * (
            other.cdf(high - x) - other.cdf(low - x)
            if low < mean
            else other.sf(low - x) - other.sf(high - x)
        )
        first = np.average(x, weights=weight)
        found += [first, np.average((x - first) ** 2, weights=weight)]
    return found


@pytest.mark.parametrize("case", CASES)
def test_interval_sites__leave_the_offset_and_the_error_the_moments_of_the_row(case):
    _low, _high, mean, variance, own = case
    site = interval_sites(*(np.array(x) for x in case))
    f_mean, f_variance, e_mean, e_variance = moments(*case)
    precision = 1 / variance + site.precision
    exact = {"rel": 1e-8, "abs": 1e-10}  # rounding, of differences of probabilities
    assert 1 / precision == pytest.approx(f_variance, **exact)
    got = (mean / variance + site.precision * site.mean) / precision
    assert got == pytest.approx(f_mean, **exact)
    assert site.error_square == pytest.approx(e_mean**2, **exact)
    assert site.error_share * own == pytest.approx(e_variance, **exact)


@pytest.mark.parametrize(
    ("low", "high"), [(-1e9, 1e9), (40.0, 41.0), (-1e-12, 1e-12), (50.0, np.inf)]
)
def test_interval_sites__are_finite_far_out_and_of_no_width(low, high):
    ends = np.array(low), np.array(high)
    site = interval_sites(*ends, np.array(0.0), np.array(0.1), np.array(0.01))
    assert all(np.isfinite(x).all() for x in site)
    assert site.precision > 0
    assert 0 <= site.error_share <= 1


def test_interval_sites__of_no_width_are_exact_rows():
    site = interval_sites(*(np.array(x) for x in (0.3, 0.3 + 1e-9, 0.1, 0.2, 0.05)))
    # Rounding of a difference of 0.3, relative to the width in which it is the middle.
    assert site.mean == pytest.approx(0.3, abs=1e-9)
    assert site.precision == pytest.approx(1 / 0.05, rel=1e-8)


COUNTS = [  # low, high, means, variances and covariance of the cavity, own variance
    (-0.9, 0.2, (0.1, 0.05), (0.09, 0.06, 0.03), 0.01),  # near its own load
    (-0.1, 1.2, (0.1, 0.15), (0.09, 0.06, 0.03), 0.01),  # near the next ridge's
    (-0.4, 0.4, (0.0, 0.1), (0.04, 0.05, 0.02), 0.04),  # both
]


@pytest.mark.parametrize("case", COUNTS)
def test_count_sites__leave_offsets_and_error_the_means_of_the_row(case):
    low, high, mean, (v, w, c), own = case
    site = count_sites(*(np.array(x) for x in case))
    cavity = np.array([[v, c], [c, w]])
    # The trapezoidal rule in standard scores of both offsets: exact to rounding at such steps.
    scores = np.stack(np.meshgrid(*2 * [np.linspace(-9, 9, 401)], indexing="ij"))
    f, f_next = np.einsum("ij,j...->i...", np.linalg.cholesky(cavity), scores) + np.reshape(
        mean, (2, 1, 1)
    )
    error = stats.norm(0, np.sqrt(own))
    a, b = low - f_next, high - f
    prior = np.exp(-0.5 * (scores**2).sum(axis=0))
    # Signed where offsets turn the ends round, as the expectation of a difference is.
    weight = prior * (error.cdf(b) - error.cdf(a))
    expected = [np.average(x, weights=weight) for x in (f, f_next)]
    precision = np.linalg.inv(cavity) + np.diag(site.precision)
    pull = np.linalg.solve(cavity, mean) + site.precision * site.mean
    exact = {"rel": 1e-9, "abs": 1e-10}  # rounding
    assert np.linalg.solve(precision, pull) == pytest.approx(expected, **exact)
    # E[e] and E[e^2] in an interval, by the density at its ends.
    first = own * (error.pdf(a) - error.pdf(b))
    second = own * (error.cdf(b) - error.cdf(a)) + own * (a * error.pdf(a) - b * error.pdf(b))
    first, second = ((prior * x).sum() / weight.sum() for x in (first, second))
    assert site.error_square == pytest.approx(first**2, **exact)
    assert site.error_share * own == pytest.approx(second - first**2, **exact)


def test_count_sites__of_an_end_far_away_are_those_of_half_a_line():
    low, high, mean, covariance, own = (np.array(x) for x in COUNTS[0])
    site = count_sites(low - 60.0, high, mean, covariance, own)
    alone = interval_sites(np.array(-np.inf), high, mean[0], covariance[0], own)
    assert site.mean[0] == pytest.approx(alone.mean, rel=1e-9)  # rounding
    assert site.precision[0] == pytest.approx(alone.precision, rel=1e-9)
    assert site.precision[1] < 1e-8


def test_count_sites__are_finite_where_offsets_leave_no_interval():
    low, high, _, covariance, own = (np.array(x) for x in COUNTS[0])
    site = count_sites(low, high, np.array([3.0, -3.0]), covariance, own)
    assert all(np.isfinite(x).all() for x in site)
    assert np.all(site.precision > 0)
