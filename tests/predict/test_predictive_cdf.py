import numpy as np
import pytest
from scipy import special

from ridgebayes.predict.predictive_cdf import Average

P = np.linspace(0.0, 0.18, 300)[1:] ** 2
Y = np.log(P)
COUNTS = -9.0 + 0.4 * np.arange(1, 20)


class Means:
    """Draws of Student errors about given log loads, which count how many means are asked for."""

    weight = None

    def __init__(self, df):
        self.df, self.n = df, 0

    def log_load(self, texture, Q, nu, kind):
        return self.mean[:, None], self.scale[:, None]

    def cdf(self, z):
        self.n += z.shape[1]
        return special.stdtr(self.df[:, None], z)

    def average(self, values):
        return values.mean(axis=0)[None]

    def __call__(self, y, mean, scale):
        return self.average(self.cdf((y - mean[:, None]) / scale[:, None]))[0]


class Table:
    """An `Average` that is asked for one count after another."""

    def __init__(self, means):
        self.means, self.average = means, Average(means, "simulation")

    def at(self, p, mean, scale):
        self.means.mean, self.means.scale = mean, scale
        return self.average.at((0.02, 0.02), np.array([4]), p, 0.5)[:, 0]


def draws(spread, scale):
    rng = np.random.default_rng(3)
    each = scale * np.exp(0.2 * rng.standard_normal(320))
    return 0.5 + rng.gamma(2.0, 2.0, 320), spread * rng.standard_normal(320), each


@pytest.mark.parametrize("spread", [0.0, 0.02, 0.2])
@pytest.mark.parametrize("scale", [1e-4, 0.01, 0.3])
def test_values__of_many_counts_are_those_of_each_from_few(spread, scale):
    df, off, each = draws(spread, scale)
    means = Means(df)
    table = Table(means)
    found = [table.at(P, middle + off, each) for middle in COUNTS]
    asked = means.n
    expected = [means(Y, middle + off, each) for middle in COUNTS]
    # Discretisation: the last coefficients of each piece are under 1e-8.
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-7)
    # Of draws too far apart for a table two were tried: for one count, and for several.
    is_rough = spread > 100 * scale
    assert asked < (1.7 if is_rough else 0.5) * len(COUNTS) * len(Y)


@pytest.mark.parametrize("spread", [0.01, 1.0])
def test_values__of_counts_with_offsets_of_their_own_are_their_own(spread):
    df, off, each = draws(spread, 0.01)
    means, rng = Means(df), np.random.default_rng(4)
    table = Table(means)
    for n_done, middle in enumerate(COUNTS[:5], start=1):
        mean = middle + off + 0.01 * rng.standard_normal(len(off))
        np.testing.assert_allclose(table.at(P, mean, each), means(Y, mean, each), rtol=0, atol=1e-7)
        assert means.n < 3.3 * n_done * len(Y)  # of which this test asks for 1.2
        few = Table(means).at(P[::30], mean, each)  # no sixteen of them lie close
        np.testing.assert_allclose(few, means(Y[::30], mean, each), rtol=1e-12)  # rounding


def test_values__are_0_without_a_load_and_where_no_load_reaches():
    df, off, each = draws(0.0, 0.01)
    table = Table(Means(df))
    assert table.at(np.append(0.0, P), off - 5.0, each)[0] == 0
    off[:80] = np.inf  # draws whose rate reaches no further ridge
    assert table.at(np.append(P, np.exp(50.0)), off, each).max() == pytest.approx(0.75, rel=1e-3)
