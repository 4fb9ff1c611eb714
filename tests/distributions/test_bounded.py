import math

import numpy as np
import pytest
from scipy import integrate, stats

from ridgebayes import Gamma, InputError, LogNormal, Normal, Truncated, Uniform

CASES = [
    (Uniform(-1.0, 3.0), stats.uniform(-1.0, 4.0)),
    (Truncated(Normal(1.0, 2.0), 0.5, 3.0), stats.truncnorm(-0.25, 1.0, 1.0, 2.0)),
    (Truncated(Normal(0.0, 1.0), 8.0, math.inf), stats.truncnorm(8.0, np.inf)),
    (Truncated(Normal(0.0, 1.0), -math.inf, -8.0), stats.truncnorm(-np.inf, -8.0)),
    (Truncated(Normal(0.0, 1.0), -2.0, math.inf), stats.truncnorm(-2.0, np.inf)),
    (Truncated(Gamma(1.0, 0.5), 1.0, 5.0), stats.truncexpon(2.0, 1.0, 2.0)),
    (Truncated(Uniform(0.0, 4.0), 1.0, 9.0), stats.uniform(1.0, 3.0)),
]


@pytest.mark.parametrize(("own", "oracle"), CASES)
def test_log_pdf__is_scipys_between_the_bounds_and_nothing_beyond(own, oracle):
    low, high = own.support
    x = oracle.ppf([1e-6, 0.01, 0.3, 0.5, 0.9, 1 - 1e-6])
    # Algebra: rounding of scipy's own differences of distribution functions.
    np.testing.assert_allclose(own.log_pdf(x), oracle.logpdf(x), rtol=1e-9, atol=1e-9)
    beyond = np.array([end for end in (low - 1, high + 1) if math.isfinite(end)])
    assert np.all(own.log_pdf(beyond) == -np.inf)
    total, _ = integrate.quad(lambda x: np.exp(own.log_pdf(np.array(x))), x[0], x[-1])
    assert total == pytest.approx(1 - 2e-6, abs=1e-7)  # discretisation: quad's own tolerance


@pytest.mark.parametrize(("own", "oracle"), CASES)
def test_value_at__has_the_probability_of_its_normal_score(own, oracle):
    u = np.linspace(-5, 5, 21)
    low, high = u[u <= 0], u[u > 0]
    expected = [*oracle.ppf(stats.norm.cdf(low)), *oracle.isf(stats.norm.sf(high))]
    np.testing.assert_allclose(own.value_at(u), expected, rtol=1e-8)  # rounding of the oracle's
    np.testing.assert_allclose([own.value_at(one) for one in u], own.value_at(u), rtol=1e-14)


@pytest.mark.parametrize(("own", "oracle"), CASES)
def test_score__inverts_value_at_and_slope_at_is_its_derivative(own, oracle):
    u, h = np.linspace(-4, 4, 17), 1e-5
    x = own.value_at(u)
    # Algebra: a value beside a bound is known to eps of the bound, its probability here to 1e-11.
    np.testing.assert_allclose(own.score(x), u, atol=1e-6)
    slope = (own.value_at(u + h) - own.value_at(u - h)) / (2 * h)
    # Discretisation h^2; rounding eps/h of the value.
    np.testing.assert_allclose(own.slope_at(u, x), slope, rtol=1e-6, atol=1e-9)
    # Density and transform belong together.
    log_density = stats.norm.logpdf(u) - np.log(own.slope_at(u, x))
    np.testing.assert_allclose(own.log_pdf(x), log_density, atol=1e-9)


@pytest.mark.parametrize(
    "bad",
    [
        lambda: Uniform(1.0, 1.0),
        lambda: Uniform(0.0, math.inf),
        lambda: Uniform(math.nan, 1.0),
        lambda: Truncated(Normal(0.0, 1.0), 2.0, 1.0),
        lambda: Truncated(Normal(0.0, 1.0), math.nan, 1.0),
        lambda: Truncated(LogNormal(1.0, 1.0), -2.0, 0.0),
        lambda: Truncated(Uniform(0.0, 1.0), 2.0, 3.0),
        lambda: Truncated(Normal(0.0, 1.0), 1.0, 1.0 + 1e-16),
        lambda: Truncated(CASES[1][0], 0.0, 1.0),
    ],
)
def test_bounds__that_leave_nothing_are_refused(bad):
    with pytest.raises(InputError, match="distribution: expected"):
        bad()


@pytest.mark.parametrize(("own", "oracle"), CASES)
def test_stretched__is_refused_where_no_one_field_is_a_scale(own, oracle):
    with pytest.raises(InputError, match="expected a distribution with a scale"):
        own.stretched(2.0)
