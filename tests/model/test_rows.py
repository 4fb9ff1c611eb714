"""Exact rows, brackets and counts, each against scipy's distributions."""

import numpy as np
import pytest
from scipy import integrate, stats

from ridgebayes import Classic, HalfPlane, InputError, Modified
from ridgebayes.model.rows import Rows
from ridgebayes.model.tails import NormalTail, StudentTail

TAILS = [(NormalTail(), stats.norm()), (StudentTail(), stats.t(4.0))]
DF = np.array(4.0)


def log_shape(Q, pitch=0.042):
    """The modified form's (Q/2 - 1)(a + b), typed out."""
    return np.log((np.asarray(Q) / 2 - 1) * pitch)


def of_rows(rows, log_rates, sigma, tail, offset=0.0, df=DF):
    """The log density of rows; `offset` of each, then of the next steps of counts."""
    error = rows.errors(log_rates, offset)
    return rows.log_density(error, rows.scale(np.array(sigma)), tail, df[..., None])


def log_likelihood(data, tail, *, log_rate=0.3, sigma=0.05, offset=0.0):
    log_rates = np.full(len(data.textures), log_rate)
    return of_rows(Rows.of(data, Modified()), log_rates, sigma, tail, offset)


@pytest.mark.parametrize(("tail", "oracle"), TAILS)
def test_log_likelihood__of_an_exact_row_is_the_density_of_its_log_load(tail, oracle, observed):
    rng = np.random.default_rng(1)
    Q, texture, rel_se = [4, 4, 6, 10], [0, 1, 2, 1], np.array([0.0, 0.03, 0.2, 0.0])
    noise = 0.1 * rng.standard_normal(4)
    pitch = np.array([0.042, 0.042, 0.042])[texture]
    log_rates, offset = np.array([0.2, 0.3, 0.25]), np.array([0.01, -0.02, 0.0, 0.05])
    data = observed(texture, Q, -8 + noise, rel_se=rel_se)
    rows = Rows.of(data, Modified())
    found = of_rows(rows, log_rates, 0.05, tail, offset)
    load = 2 * log_shape(Q, pitch) - 2 * log_rates[texture] + offset
    scale = np.hypot(0.05, rel_se)
    expected = oracle.logpdf((data.log_load - load) / scale) - np.log(scale)
    np.testing.assert_allclose(found, expected, rtol=1e-11)  # rounding: residuals of 0.1 beside 10


@pytest.mark.parametrize(("tail", "oracle"), TAILS)
@pytest.mark.parametrize("at", [-6.0, -0.5, 0.0, 1.5, 6.0])
def test_log_likelihood__of_a_bracket_over_its_width_tends_to_the_density(
    tail, oracle, at, observed
):
    middle = 2 * log_shape(6) - 0.6 + 0.05 * at
    exact = log_likelihood(observed([0], 6, middle), tail)
    errors = []
    for width in (1e-2, 1e-3):
        row = observed([0], 6, middle + width / 2, log_lower=middle - width / 2)
        errors.append(float(log_likelihood(row, tail)[0] - np.log(width) - exact[0]))
    # Discretisation: width^2 f''/24f, of the width in scales squared: f''/f is at most 36.
    assert abs(errors[0]) < 0.2**2 * 36 / 24
    assert errors[1] == pytest.approx(errors[0] / 100, rel=0.05, abs=1e-9)
    z = at + np.array([-0.1, 0.1])
    row = observed([0], 6, middle + 0.005, log_lower=middle - 0.005)
    expected = integrate.quad(oracle.pdf, *z, epsrel=1e-12)[0]
    # Quadrature, and rounding of the residual.
    assert float(log_likelihood(row, tail)[0]) == pytest.approx(np.log(expected), abs=1e-10)


@pytest.mark.parametrize(("tail", "oracle"), TAILS)
def test_log_likelihood__with_offsets_of_rows_of_each_kind_is_that_of_their_loads(
    tail, oracle, observed
):
    load, offset, later = -6.2, np.array([0.07, -0.05, 0.03]), 0.04
    data = observed(
        [0, 1, 1],
        [4, 6, 6],
        load,
        rel_se=[0.02, 0.0, 0.0],
        log_lower=[np.nan, load - 0.3, np.nan],
        is_count=[False, False, True],
    )
    found = log_likelihood(data, tail, sigma=0.3, offset=np.append(offset, later))
    at = 2 * log_shape([4, 6, 6]) - 0.6 + offset
    scale = np.hypot(0.3, 0.02)
    exact = oracle.logpdf((load - at[0]) / scale) - np.log(scale)
    ends = (load - np.array([0, 0.3]) - at[1]) / 0.3
    bracket = np.log(np.diff(oracle.cdf(ends[::-1])))[0]
    beyond = 2 * log_shape(8) - 0.6 + later
    count = np.log(oracle.cdf((load - at[2]) / 0.3) - oracle.cdf((load - beyond) / 0.3))
    np.testing.assert_allclose(found, [exact, bracket, count], rtol=1e-11)  # rounding


@pytest.mark.parametrize(("tail", "oracle"), TAILS)
def test_log_likelihood__of_a_count_that_offsets_turn_round_is_no_probability(
    tail, oracle, observed
):
    # The load of 8 lies below that of 6: 6 and not 8 cannot be seen at any load.
    data = observed([0], 6, 2 * log_shape(6) - 0.6, is_count=True)
    found = log_likelihood(data, tail, sigma=0.3, offset=np.array([1.0, -1.0]))
    assert np.isneginf(found).all()


@pytest.mark.parametrize(("tail", "oracle"), TAILS)
@pytest.mark.parametrize("form", [Modified(), Classic(), HalfPlane()])
def test_log_likelihood__of_a_count_lies_between_two_loads(tail, oracle, form, observed):
    # Seen at a load: Q was reached there (error below one residual), Q + 2 was not.
    Q, a, b = np.array([4, 6, 8, 20]), 0.012, 0.03
    log_load = 2 * np.log(form.shape(9 * 2, a, b)) - 0.6 + np.log([0.2, 0.3, 0.25, 1.2])
    data = observed([0] * 4, Q, log_load, is_count=True, rel_se=[0.0, 0.1, 0.0, 0.0])
    found = of_rows(Rows.of(data, form), np.array([0.3]), 0.3, tail)
    scale = np.hypot(0.3, data.rel_se)
    at, beyond = (2 * np.log(form.shape(q, a, b)) - 0.6 for q in (Q, Q + 2))
    near, far = (log_load - at) / scale, (log_load - beyond) / scale
    expected = np.where(
        far > 0, oracle.sf(far) - oracle.sf(near), oracle.cdf(near) - oracle.cdf(far)
    )
    np.testing.assert_allclose(found, np.log(expected), rtol=1e-9)  # rounding of the difference


@pytest.mark.parametrize(("tail", "oracle"), TAILS)
@pytest.mark.parametrize("sigma", [0.01, 0.3, 2.0])
def test_log_likelihood__of_all_counts_at_a_load_sums_to_one(tail, oracle, sigma, observed):
    Q = np.arange(2, 20_002, 2)
    data = observed(np.zeros_like(Q), Q, 2 * log_shape(8) - 0.5, is_count=True)
    total = np.exp(log_likelihood(data, tail, sigma=sigma)).sum()
    # Rounding, and what counts beyond the last would add: the tail's end there.
    last = (2 * log_shape(8) - 2 * log_shape(20_002) + 0.1) / sigma
    assert total == pytest.approx(1 - oracle.cdf(last), abs=1e-11)


def test_of__refuses_a_row_that_the_form_reaches_without_load(observed):
    rule = "modified: expected Q >= 4, got a row whose load is zero by this form"
    with pytest.raises(InputError, match=rule):
        Rows.of(observed([0, 0], [4, 2], -8.0, is_count=[True, False]), Modified())
