"""Normals for intervals against the moments that quadrature gives."""

import numpy as np
import pytest
from scipy import stats

from ridgebayes.model.interval_sites import interval_sites

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
