import numpy as np
import pytest
from scipy import special, stats

from ridgebayes import Gamma, HalfNormal, LogNormal, Normal
from ridgebayes.model.joint_prior import JointPrior

PRIORS = [
    (LogNormal(1.382, 0.3), stats.lognorm(s=0.3, scale=1.382)),
    (Normal(-0.2, 0.05), stats.norm(-0.2, 0.05)),
    (HalfNormal(0.05), stats.halfnorm(scale=0.05)),
    (Gamma(2.0, 0.1), stats.gamma(2.0, scale=10.0)),
]


@pytest.mark.parametrize(("prior", "oracle"), PRIORS)
def test_log_pdf__is_scipys_on_the_support(prior, oracle):
    x = oracle.ppf([1e-6, 0.01, 0.3, 0.5, 0.9, 1 - 1e-6])
    # Algebra: rounding of z, squared.
    np.testing.assert_allclose(prior.log_pdf(x), oracle.logpdf(x), rtol=1e-12)


@pytest.mark.parametrize("prior", [LogNormal(1.0, 0.1), HalfNormal(0.05), Gamma(2.0, 0.1)])
def test_log_pdf__is_minus_infinity_off_the_support(prior):
    assert np.all(prior.log_pdf(np.array([-1.0, -0.3, 0.0])) == -np.inf)
    assert prior.support == (0.0, np.inf)


def test_half_normal__upper_tail_has_the_normals_probability_where_that_underflows():
    u = np.array([30.0, 34.9, 35.1, 37.0, 40.0, 200.0])
    z = HalfNormal(0.05).value_at(u) / 0.05
    # Rounding: of the inverse, squared.
    np.testing.assert_allclose(np.log(2) + stats.norm.logsf(z), stats.norm.logsf(u), rtol=1e-12)


@pytest.mark.parametrize("shape", [2.0, 3.5])
def test_gamma__lower_tail_has_the_normals_probability_where_that_underflows(shape):
    u = np.array([-36.0, -36.9, -37.1, -38.0, -41.0])
    z = 0.1 * Gamma(shape, 0.1).value_at(u)
    # P = z^shape / Gamma(shape + 1) to rounding, z being far below it.
    log_cdf = shape * np.log(z) - special.gammaln(shape + 1)
    np.testing.assert_allclose(log_cdf, stats.norm.logcdf(u), rtol=1e-12)


@pytest.mark.parametrize(("prior", "oracle"), PRIORS)
def test_value_at__has_the_probability_of_its_normal_score(prior, oracle):
    u = np.linspace(-5, 5, 21)
    # Each tail by its own probability; algebra: the oracle knows 1 + 1e-7 to eps, so 1e-9.
    low, high = u[u <= 0], u[u > 0]
    expected = [*oracle.ppf(stats.norm.cdf(low)), *oracle.isf(stats.norm.sf(high))]
    np.testing.assert_allclose(prior.value_at(u), expected, rtol=1e-8, atol=1e-15)


@pytest.mark.parametrize(("prior", "oracle"), PRIORS)
def test_scores__invert_value_at_far_into_both_tails(prior, oracle):
    joint = JointPrior([prior, prior])
    u = np.array([[-30.0, 30.0], [-8.0, 8.0], [-0.3, 0.3], [0.0, 1e-3], [0.02, -0.02]])
    theta = joint.at_scores(u)
    assert np.all(np.isfinite(theta))
    # Algebra: a value near the half-normal's median is known to eps, its score to some 1e-13.
    np.testing.assert_allclose(joint.scores(theta), u, rtol=1e-10, atol=1e-10)


@pytest.mark.parametrize(("prior", "oracle"), PRIORS)
def test_slope_at__is_the_central_difference_of_value_at(prior, oracle):
    u, h = np.array([-6.0, -1.0, -1e-3, 0.3, 2.0, 6.0]), 1e-5
    difference = (prior.value_at(u + h) - prior.value_at(u - h)) / (2 * h)
    # Discretisation h^2; rounding eps/h of the value.
    np.testing.assert_allclose(
        prior.slope_at(u, prior.value_at(u)), difference, rtol=1e-7, atol=1e-12
    )
    slopes = JointPrior([prior]).at_scores_slope(u[:, None], prior.value_at(u)[:, None])
    np.testing.assert_allclose(slopes[:, 0], prior.slope_at(u, prior.value_at(u)), rtol=1e-14)


@pytest.mark.parametrize(
    ("prior", "wider"),
    [
        (LogNormal(1.382, 0.1), LogNormal(1.382, 0.5)),
        (Normal(0.1, 0.05), Normal(0.1, 0.25)),
        (HalfNormal(0.05), HalfNormal(0.25)),
    ],
)
def test_stretched__multiplies_the_scale_alone(prior, wider):
    assert prior.stretched(5) == wider
    assert prior.stretched(5).scale == 5 * prior.scale
