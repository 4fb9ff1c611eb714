"""Least squares on Q: the normal equations by another road, and what it refuses."""

import numpy as np
import pytest

import ridgebayes as rb
from ridgebayes.checks.least_squares import fit_by_least_squares


def test_least_squares_finds_the_reference_coefficients(paper):
    # Reference: least squares on Q, 41 calibration rows, last digit +-1.
    hybrid = fit_by_least_squares(rb.Hybrid(), paper).coefficients
    assert hybrid["c1"] == pytest.approx(1.3486, abs=1e-4)
    assert hybrid["c2"] == pytest.approx(0.01801, abs=1e-5)
    assert fit_by_least_squares(rb.Modified(), paper).coefficients["c"] == pytest.approx(
        1.3844, abs=1e-4
    )


def test_least_squares_is_the_normal_equations(paper):
    # Algebra: Q' = 2 + 2 s (c1/L + c2/A) is linear in c1 and c2.
    frame = paper.calibration.frame
    s, a = np.sqrt(frame["p_over_E"]), frame["a_over_R"]
    columns = np.stack([2 * s / (a + frame["b_over_R"]), 2 * s / a], axis=1)
    q = frame["Q"].to_numpy() - 2.0
    theta, (residual,), *_ = np.linalg.lstsq(columns, q, rcond=None)
    covariance = np.linalg.inv(columns.T @ columns) * residual / (len(q) - 2)
    squares = fit_by_least_squares(rb.Hybrid(), paper)
    assert squares["coefficients"].to_numpy() == pytest.approx(theta, rel=1e-7)
    errors = squares["standard_errors"].to_numpy()
    assert errors == pytest.approx(np.sqrt(np.diag(covariance)), rel=1e-5)


def test_least_squares_needs_as_many_rows_as_coefficients(paper):
    first = rb.ContactTable.from_frame(paper.frame.head(1))
    with pytest.raises(rb.InputError, match="got 1 rows"):
        fit_by_least_squares(rb.Hybrid(), first)
    squares = fit_by_least_squares(rb.Modified(), first)
    assert squares.coefficients["c"] > 0
    assert np.isnan(squares.standard_errors["c"])


def test_least_squares_of_a_texture_in_other_units_says_that_there_are_none(paper):
    frame = paper.calibration.frame
    wrong = (frame["a_over_R"] == 0.022) & (frame["b_over_R"] == 0.02)
    loads = frame["p_over_E"] * np.where(wrong, 1000.0, 1.0)
    table = rb.ContactTable.from_frame(frame.assign(p_over_E=loads))
    with pytest.raises(rb.ComputationError, match="the rate of a texture was not positive"):
        fit_by_least_squares(rb.Hybrid(), table)


@pytest.mark.parametrize("n_row", [2, 3])
def test_least_squares_of_coefficients_that_one_texture_cannot_tell_apart(paper, n_row):
    one = rb.ContactTable.from_frame(paper.frame.head(n_row))
    with pytest.raises(rb.ComputationError, match="do not tell the coefficients apart"):
        fit_by_least_squares(rb.Hybrid(), one)


def test_least_squares_does_not_take_the_power_law(paper):
    with pytest.raises(rb.InputError, match="published coefficients"):
        fit_by_least_squares(rb.PowerLaw(), paper)
