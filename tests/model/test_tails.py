from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy import stats

from ridgebayes.model.tails import NormalTail, StudentTail

NORMAL, STUDENT = NormalTail(), StudentTail()
DFS = [0.1, 1.0, 3.0, 30.0, 1e6]
KINDS = [(NORMAL, None), *((STUDENT, df) for df in DFS)]

# Reference digits, see tests/data/engine/README.md.
_TABLE = pd.read_csv(Path(__file__).parents[1] / "data" / "engine" / "tails.csv")
_ROWS = _TABLE.astype(object).where(_TABLE.notna(), None).groupby("kind")
BETWEEN, NARROW, AT_2_5 = (
    _ROWS.get_group(kind).drop(columns="kind").to_numpy().tolist()
    for kind in ("between", "narrow", "at_2_5")
)
AT_2_5 = [(df, value) for df, _, _, value in AT_2_5]


def tail_of(df):
    return NORMAL if df is None else STUDENT


def rounding(log_p):
    """What the module promises of P: 1e-12, and the rounding of the logarithm."""
    return 1e-12 + 1e-15 * np.abs(log_p)


kinds = st.sampled_from(KINDS)
places = st.floats(-60, 60)
log10_widths = st.floats(-13, 1.5)


@pytest.mark.parametrize(("df", "low", "high", "log_p"), BETWEEN)
def test_log_probability__is_the_reference_from_either_side(df, low, high, log_p):
    for a, b in ((low, high), (-high, -low)):
        value = tail_of(df).log_probability(a, b, df)
        # Rounding and quadrature, as promised; relative where P is all but 1.
        assert abs(value - log_p) < min(rounding(log_p), max(1e-6 * abs(log_p), 1e-15))


@pytest.mark.parametrize(("df", "low", "width", "log_p"), NARROW)
def test_log_probability__keeps_a_width_that_subtraction_loses(df, low, width, log_p):
    tail = tail_of(df)
    for a, b in ((low, low + width), (-low - width, -low)):
        # Rounding: the logarithm's own, and 1 eps of the place by the slope of the log density.
        assert abs(tail.log_probability(a, b, df, width) - log_p) < rounding(log_p)
    if width < 1e-3:
        # The subtraction does lose it: by up to half an eps of the place over the width.
        assert abs(tail.log_probability(low, low + width, df) - log_p) > 1e-6


@pytest.mark.parametrize(("df", "value"), AT_2_5)
def test_log_density__of_student_is_the_reference(df, value):
    # Rounding of two log gammas of up to 26.
    assert STUDENT.log_density(2.5, df) == pytest.approx(value, abs=1e-14)


def test_log_density__is_scipys():
    z = np.linspace(-30, 30, 41)
    df = np.array([[0.1], [0.7], [4.0], [29.99], [30.0], [300.0]])
    # Rounding: scipy's own cancelling gamma functions are the larger part.
    np.testing.assert_allclose(STUDENT.log_density(z, df), stats.t.logpdf(z, df), atol=1e-12)
    np.testing.assert_allclose(NORMAL.log_density(z, None), stats.norm.logpdf(z), rtol=1e-14)


@given(kinds, places, log10_widths, log10_widths)
def test_log_probability__adds_up(kind, low, log10_first, log10_second):
    tail, df = kind
    first, second = 10**log10_first, 10**log10_second
    middle = low + first
    high = middle + second
    assume(low < middle < high)
    # Widths as the floats have them, so that the parts do make up the whole.
    whole = tail.log_probability(low, high, df)
    parts = np.logaddexp(
        tail.log_probability(low, middle, df), tail.log_probability(middle, high, df)
    )
    # Rounding of three values, and of the widths: eps of 60 over a width, each by its own share.
    share = 3 * np.finfo(float).eps * max(abs(low), abs(high)) / (high - low)
    assert abs(whole - parts) < 3 * rounding(whole) + share


@pytest.mark.parametrize(("tail", "df"), KINDS)
def test_log_probability__is_smooth_where_the_way_of_computing_it_changes(tail, df):
    width = np.geomspace(1e-3, 60, 4001)
    values = [tail.log_probability(low, low + width, df, width) for low in (0.0, 1.0, 6.0)]
    values.append(tail.log_probability(-width / 2, width / 2, df))
    values.append(tail.log_probability(np.geomspace(1e-3, 8, 4001), np.inf, df))
    # Discretisation: 0.3 % to the sixth; quadrature: 10 times the 1e-13 of a jump; rounding: 64
    # times 1e-15 of values to 30.
    assert np.all(np.abs(np.diff(values, 6)) < 2e-12)


@pytest.mark.parametrize(("tail", "df"), KINDS)
def test_log_probability__takes_infinite_and_empty_intervals(tail, df):
    low = np.array([-np.inf, -np.inf, 0.0, 2.0, np.inf, -np.inf])
    high = np.array([np.inf, 0.0, np.inf, 2.0, np.inf, -np.inf])
    value = tail.log_probability(low, high, df)
    expected = [0.0, np.log(0.5), np.log(0.5), -np.inf, -np.inf, -np.inf]
    np.testing.assert_allclose(value, expected, atol=1e-15)  # algebra


@pytest.mark.parametrize(("tail", "df"), KINDS)
def test_log_probability__is_finite_or_beyond_floats_at_the_ends_of_the_floats(tail, df):
    ends = np.concatenate(
        [-np.geomspace(1e300, 1e-300, 61), [0.0], np.geomspace(1e-300, 1e300, 61)]
    )
    low, high = (array[np.triu_indices(len(ends), 1)[i]] for i, array in enumerate((ends, ends)))
    value = tail.log_probability(low, high, df)
    assert not np.any(np.isnan(value))
    assert np.all(value <= 1e-15)  # rounding
    reachable = np.minimum(np.abs(low), np.abs(high)) < 1e150
    reachable |= (low < 0) & (high > 0)
    assert np.all(np.isfinite(value[reachable if df is None else slice(None)]))


def test_cdf__of_student_is_the_closed_form_where_there_is_one():
    z = np.geomspace(1e-6, 1e6, 241)
    root = np.sqrt(2 + z * z)
    # Rounding.
    far = z > 1e-3  # nearer, SciPy has 1e-11 at df of exactly 1
    np.testing.assert_allclose(STUDENT.cdf(-z[far], 1.0), np.arctan2(1, z[far]) / np.pi, rtol=1e-13)
    np.testing.assert_allclose(STUDENT.cdf(-z, 2.0), 1 / (root * (root + z)), rtol=1e-13)


@pytest.mark.parametrize(("tail", "df"), KINDS)
def test_cdf__is_the_probability_below(tail, df):
    z = np.array([-np.inf, -30.0, -3.0, -1e-3, 0.0, 1e-9, 1.0, 4.0, np.inf])
    below = np.exp(tail.log_probability(-np.inf, z, df))
    np.testing.assert_allclose(tail.cdf(z, df), below, rtol=1e-12)  # rounding
    assert tail.cdf(np.inf, df) == 1


@pytest.mark.parametrize(("tail", "df"), [kind for kind in KINDS if kind[1] != 0.1])
def test_rvs__follows_the_distribution(tail, df):
    draws = tail.rvs(np.random.default_rng(5), df, 20_000)
    # Monte Carlo: Kolmogorov-Smirnov, p above 1e-4 (3.9 standard errors) at a fixed seed.
    assert stats.kstest(draws, lambda z: tail.cdf(z, df)).pvalue > 1e-4


@pytest.mark.parametrize(("tail", "df"), KINDS)
def test_weight__is_the_slope_of_the_log_density_over_the_place(tail, df):
    z, h = np.array([-30.0, -2.5, -0.3, 1e-2, 1.7, 40.0]), 1e-4
    slope = (tail.log_density(z + h, df) - tail.log_density(z - h, df)) / (2 * h)
    # Discretisation: h^2; rounding: 1e-15 of values to 1,000, over h.
    np.testing.assert_allclose(tail.weight(z, df) * z, -slope, rtol=1e-6, atol=1e-8)
    assert np.isfinite(tail.weight(0.0, df))
