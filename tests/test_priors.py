import numpy as np
import pytest
from scipy import integrate, stats

from ridgebayes.errors import InputError
from ridgebayes.forms import Classic, HalfPlane, Hybrid, Modified, PowerLaw
from ridgebayes.priors import HalfNormal, JointPrior, LogNormal, Normal, default_priors

PRIORS = [
    (LogNormal(1.382, 0.3), stats.lognorm(s=0.3, scale=1.382)),
    (Normal(-0.2, 0.05), stats.norm(-0.2, 0.05)),
    (HalfNormal(0.05), stats.halfnorm(scale=0.05)),
]


@pytest.mark.parametrize(("prior", "oracle"), PRIORS)
def test_log_pdf__is_scipys_on_the_support(prior, oracle):
    x = oracle.ppf([1e-6, 0.01, 0.3, 0.5, 0.9, 1 - 1e-6])
    # Algebra: rounding of z, squared.
    np.testing.assert_allclose(prior.log_pdf(x), oracle.logpdf(x), rtol=1e-12)


@pytest.mark.parametrize(("prior", "oracle"), PRIORS)
def test_log_pdf__integrates_to_one(prior, oracle):
    low, high = oracle.ppf([1e-15, 1 - 1e-15])
    total, _ = integrate.quad(lambda x: np.exp(prior.log_pdf(np.array(x))), low, high)
    assert total == pytest.approx(1, abs=1e-8)  # discretisation: quad's own tolerance


@pytest.mark.parametrize("prior", [LogNormal(1.0, 0.1), HalfNormal(0.05)])
def test_log_pdf__is_minus_infinity_off_the_support(prior):
    assert np.all(prior.log_pdf(np.array([-1.0, 0.0])) == -np.inf)
    assert prior.positive


@pytest.mark.parametrize(("prior", "oracle"), PRIORS)
def test_log_density_slope__is_the_central_difference(prior, oracle):
    x = oracle.ppf([0.05, 0.3, 0.95])
    h = 1e-5 * oracle.std()
    difference = (prior.log_pdf(x + h) - prior.log_pdf(x - h)) / (2 * h)
    joint = JointPrior([prior]).log_pdf_gradient(x[:, None])[:, 0]
    # Discretisation (1e-5 sd)^2 and rounding eps/1e-5, in units of 1/sd.
    np.testing.assert_allclose(joint, difference, rtol=1e-8, atol=1e-9 / oracle.std())


@pytest.mark.parametrize(("prior", "oracle"), PRIORS)
def test_rvs__follows_the_density(prior, oracle):
    draws = prior.rvs(np.random.default_rng(3), 20_000)
    # Monte Carlo: Kolmogorov-Smirnov, p above 1e-4 (3.9 standard errors) at a fixed seed.
    assert stats.kstest(draws, oracle.cdf).pvalue > 1e-4


@pytest.mark.parametrize(("prior", "oracle"), PRIORS)
def test_centre__lies_in_the_bulk(prior, oracle):
    assert 0.05 < oracle.cdf(prior.centre) < 0.95


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


def test_describe__tells_kind_and_numbers():
    assert Normal(0.0, 0.05).describe() == {"kind": "normal", "mean": 0.0, "sd": 0.05}
    described = {"kind": "log-normal", "median": 1.4, "log_sd": 0.1}
    assert LogNormal(1.4, 0.1).describe() == described


def test_joint_prior__is_the_sum_in_the_order_of_the_parameters():
    priors = [Normal(1.0, 2.0), HalfNormal(0.5), Normal(-1.0, 0.3), LogNormal(2.0, 0.4)]
    joint = JointPrior(priors)
    theta = np.abs(np.random.default_rng(1).standard_normal((3, 5, 4)))
    each = [prior.log_pdf(theta[..., i]) for i, prior in enumerate(priors)]
    np.testing.assert_allclose(joint.log_pdf(theta), sum(each), rtol=1e-13)  # algebra: a sum
    assert joint.positive.tolist() == [False, True, False, True]
    draws = joint.rvs(np.random.default_rng(0), 4_000)
    # Monte Carlo: 4.5 standard errors of a mean of 4,000.
    means = [1.0, 0.5 * np.sqrt(2 / np.pi), -1.0, 2.0 * np.exp(0.08)]
    assert np.all(np.abs(draws.mean(0) - means) < 4.5 * draws.std(0) / np.sqrt(4_000))


def test_default_priors__are_those_of_the_design():
    assert default_priors(Classic()) == {"c": LogNormal(1.382, 0.1), "sigma": HalfNormal(0.05)}
    assert default_priors(Modified()) == default_priors(Classic())
    assert default_priors(HalfPlane())["c"] == LogNormal(1.0, 0.1)
    hybrid = default_priors(Hybrid())
    assert list(hybrid) == ["c1", "c2", "sigma"]
    assert hybrid["c1"] == LogNormal(1.382, 0.1)
    assert hybrid["c2"] == Normal(0.0, 0.05)
    power = default_priors(PowerLaw().bind(((0.01, 0.03), (0.02, 0.03)), ("x", "y")))
    assert list(power) == ["K[x]", "K[y]", "sigma"]
    # Algebra: 2 x 1.382 / L, one division.
    assert power["K[x]"].median == pytest.approx(69.1, rel=1e-14)
    assert power["K[y]"].median == pytest.approx(55.28, rel=1e-14)
    assert power["K[y]"].log_sd == 0.3


@pytest.mark.parametrize("bad", [0.0, -1.0, np.nan, np.inf])
def test_prior__refuses_scales_that_are_not_positive_and_finite(bad):
    for name, make in (
        ("log-normal prior: log_sd", lambda: LogNormal(1.0, bad)),
        ("log-normal prior: median", lambda: LogNormal(bad, 1.0)),
        ("normal prior: sd", lambda: Normal(0.0, bad)),
        ("half-normal prior: sd", lambda: HalfNormal(bad)),
    ):
        with pytest.raises(InputError, match=rf"{name} = {bad} given; rule: finite and > 0"):
            make()


def test_prior__refuses_a_mean_that_is_not_finite():
    with pytest.raises(InputError, match="normal prior: mean = nan given; rule: finite"):
        Normal(np.nan, 1.0)
