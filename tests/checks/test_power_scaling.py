import numpy as np
import pytest
from scipy import integrate, stats

import ridgebayes as rb
from ridgebayes.checks.power_scaling import (
    CONFLICT,
    STRONG_PRIOR,
    cumulative_distance,
    power_scaling,
    sensitivities,
)
from tests.drawn import drawn_posterior, model_of

N = 40_000


def normal_scores(n=N):
    """Return a sample without Monte Carlo error: the middles of n equally probable parts."""
    return stats.norm.ppf((np.arange(n) + 0.5) / n)


def by_quadrature(p, q, low, high):
    """Return the cumulative Jensen-Shannon distance of two distributions on an interval."""

    def part(x):
        one, other = p.cdf(x), q.cdf(x)
        middle = 0.5 * (one + other)
        return one * np.log2(one / middle) + other * np.log2(other / middle)

    options = {"limit": 500, "epsabs": 0, "epsrel": 1e-5}
    divergence = integrate.quad(part, low, high, **options)[0]
    both = integrate.quad(lambda x: p.cdf(x) + q.cdf(x), low, high, **options)[0]
    return np.sqrt(divergence / both)


def posterior(power_prior, power_rows, *, prior_mean, prior_sd, mean, se):
    """Return the posterior of a normal mean with prior and likelihood raised to powers."""
    precision = power_prior / prior_sd**2 + power_rows / se**2
    centre = (power_prior * prior_mean / prior_sd**2 + power_rows * mean / se**2) / precision
    return stats.norm(centre, precision**-0.5)


@pytest.mark.parametrize(
    "case",
    [
        {"prior_mean": 0.0, "prior_sd": 2.0, "mean": 0.3, "se": 0.1},
        {"prior_mean": 0.0, "prior_sd": 1.0, "mean": 4.0, "se": 1.0},
        {"prior_mean": -1.0, "prior_sd": 0.1, "mean": 0.0, "se": 2.0},
    ],
)
def test_sensitivity__is_that_of_a_normal_mean(case):
    base = posterior(1, 1, **case)
    draws = base.mean() + base.std() * normal_scores()
    components = {
        "prior": stats.norm(case["prior_mean"], case["prior_sd"]).logpdf(draws),
        "rows": stats.norm(case["mean"], case["se"]).logpdf(draws),
    }
    low, high = draws.min(), draws.max()
    for name, log_component in components.items():
        expected = 0.0
        for alpha in (1.01, 1 / 1.01):
            powers = (alpha, 1) if name == "prior" else (1, alpha)
            moved = posterior(*powers, **case)
            mirrored = [stats.norm(-one.mean(), one.std()) for one in (base, moved)]
            distance = max(
                by_quadrature(base, moved, low, high), by_quadrature(*mirrored, -high, -low)
            )
            expected += 0.5 * distance / abs(np.log2(alpha))
        found = sensitivities(draws[:, None], log_component)[0]
        # Discretisation into 40,000 parts, and the smoothed tail of the weights: 1 %.
        assert found == pytest.approx(expected, rel=0.01)


def test_distance__is_between_0_and_1_and_has_no_unit():
    rng = np.random.default_rng(1)
    x = rng.standard_normal(500)
    weight = rng.dirichlet(np.ones(500))
    found = cumulative_distance(x, weight)
    assert 0 < found < 1
    # Algebra: a change of unit and of origin.
    assert cumulative_distance(1e6 * x + 3, weight) == pytest.approx(found, rel=1e-9)
    assert cumulative_distance(x, np.full(500, 1 / 500)) == pytest.approx(0, abs=1e-7)  # rounding
    assert cumulative_distance(np.ones(500), weight) == 0
    only_last = np.eye(500)[np.argmax(x)]
    assert 0.5 < cumulative_distance(x, only_last) <= 1


def test_no_component_no_sensitivity():
    draws = normal_scores(1_000)[:, None]
    # The root of a rounding, over log2 of 1.01.
    assert sensitivities(draws, np.zeros(1_000))[0] == pytest.approx(0, abs=1e-5)


def fitted(table, prior):
    return drawn_posterior(model_of(table, rb.Modified(), priors={"c": prior}))


def test_table__tells_strong_priors_and_conflicts(paper, fits):
    plain = power_scaling(fits["hybrid"])
    assert plain["parameter"].tolist() == ["c1", "c2", "sigma"]
    assert plain["diagnosis"].tolist() == ["", "", ""]
    assert (plain["likelihood"] > 0.05).all()
    at_odds = fitted(paper, rb.LogNormal(1.5, 0.004))
    table = power_scaling(at_odds).set_index("parameter")
    assert table["diagnosis"]["c"] == CONFLICT
    sure = fitted(paper, rb.LogNormal(1.374, 2e-4))
    table = power_scaling(sure).set_index("parameter")
    assert table["prior"]["c"] > 0.05 > table["likelihood"]["c"]
    assert table["diagnosis"]["c"] == STRONG_PRIOR
