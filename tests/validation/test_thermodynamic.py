import numpy as np
import pytest

from tests.validation.thermodynamic import thermodynamic_evidence


@pytest.mark.parametrize("name", ["modified", "hybrid"])
def test_thermodynamic__is_the_quadratures_evidence(fits, name):
    # References: log evidences of the 41 rows by quadrature, printed to 1e-4 and 1e-3.
    reference = {"modified": 78.8628, "hybrid": 83.387}[name]
    coarse, fine = (
        thermodynamic_evidence(fits[name].model, n_temperature=n, seed=1).value for n in (16, 64)
    )
    # Discretisation: the midpoint rule's error falls by 16 from 16 temperatures to 64.
    assert fine == pytest.approx(reference, abs=0.1)
    assert abs(fine - reference) < 0.5 * abs(coarse - reference) + 0.05


def test_thermodynamic__has_the_error_of_its_draws(fits):
    values = [
        thermodynamic_evidence(fits["modified"].model, n_temperature=16, n_draw=500, seed=seed)
        for seed in range(6)
    ]
    spread = max(one.value for one in values) - min(one.value for one in values)
    # Monte Carlo: the range of six is 2.5 sds, and seven would be one in 10,000.
    assert 0.3 * values[0].se < spread < 7 * values[0].se


def test_thermodynamic__claims_the_error_that_seeds_spread_by(fits):
    found = [
        thermodynamic_evidence(fits["modified"].model, n_temperature=64, n_draw=100, seed=seed)
        for seed in range(8)
    ]
    spread = np.std([one.value for one in found], ddof=1)
    claimed = np.mean([one.se for one in found])
    # Monte Carlo: the spread of eight is known to 27 %; the limits are four of that, and a fifth.
    assert 0.2 * claimed < spread < 2.1 * claimed


class Normal:
    """Log-likelihood level - a (u - m)^2/2, prior standard normal: all has a closed form."""

    n_coordinate = 1

    def __init__(self, a, m, level):
        self.a, self.m, self.level = a, m, level

    def to_theta(self, u):
        return u

    def log_likelihood(self, theta):
        return self.level - 0.5 * self.a * (theta[..., 0] - self.m) ** 2


@pytest.mark.parametrize("n_draw", [400, 1600])
def test_thermodynamic__of_few_draws_errs_as_many_independent_ones_would(n_draw):
    # Hardly a likelihood, and of mean zero: the rule has nothing to err by.
    a, m, n = 0.02, 1.0, 4
    level = 0.5 * a * (1 + m**2)
    found = thermodynamic_evidence(Normal(a, m, level), n_temperature=n, n_draw=n_draw, seed=3)
    assert found.ok
    t = (np.arange(n) + 0.5) / n
    v = 1 / (1 + t**5 * a)  # variance of u at each temperature; its mean is m v from m
    variance = a**2 * (0.5 * v**2 + v * (m * v) ** 2)  # of the log-likelihood
    se = np.sqrt(((5 * t**4 / n) ** 2 * variance).sum() / n_draw)
    # Monte Carlo: of squares, and of a proposal with wider tails, whose draws see more of them.
    assert 0.7 * se < found.se < 1.3 * se
    exact = level - 0.5 * np.log1p(a) - 0.5 * a * m**2 / (1 + a)
    assert abs(found.value - exact) < 4 * found.se


@pytest.mark.parametrize("n", [8, 16])
def test_thermodynamic__of_few_temperatures_errs_as_the_midpoint_rule_does(n):
    """A likelihood that is constant has no noise: left is the rule for the integral of 5 t^4."""
    found = thermodynamic_evidence(Normal(0.0, 0.0, 30.0), n_temperature=n, n_draw=200, seed=3)
    assert found.ok
    h = 1 / n
    # Of f the rule misses h^2 (f'(1) - f'(0))/24; second differences reach from h to 1 - h.
    assert found.se == pytest.approx(30 * h**2 * 20 * ((1 - h) ** 3 - h**3) / 24, rel=0.02)
    # Discretisation: the next order is h^2 of this one.
    assert 30 - found.value == pytest.approx(30 * h**2 * 20 / 24, rel=h**2)


def test_thermodynamic__says_nothing_of_its_error_from_two_temperatures():
    two, three = (
        thermodynamic_evidence(Normal(0.02, 1.0, 0.02), n_temperature=n, n_draw=200) for n in (2, 3)
    )
    assert two.status == "2 temperatures are too few: the rule may err by inf"
    assert two.se == np.inf
    assert three.ok
    assert three.se < 0.01


def test_thermodynamic__says_so_where_draws_are_too_few():
    found = thermodynamic_evidence(Normal(0.02, 1.0, 0.02), n_temperature=4, n_draw=24)
    assert found.status.startswith("a temperature has ")
    assert found.status.endswith(" effective draws, below 25")
