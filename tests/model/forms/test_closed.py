import numpy as np
import pytest
from scipy.optimize import least_squares

from ridgebayes import Classic, HalfPlane, Hybrid, Modified

# Algebra: a dozen roundings of condition 1.
ROUNDING = 1e-14

A, B = (grid.ravel() for grid in np.meshgrid([0.012, 0.022, 0.032], [0.01, 0.02, 0.03]))
P = np.geomspace(2e-4, 0.02, 7)[:, None]
Q = np.arange(4, 30, 2)[:, None]


def test_continuous_count__classic_is_equation_3_as_printed():
    # Eq. (3) of doi:10.1016/j.ijssolstr.2019.06.026.
    expected = 2 * (1 + (-B / 2 + 1.382 * np.sqrt(P)) / (A + B))
    np.testing.assert_allclose(Classic().continuous_count(P, A, B), expected, rtol=ROUNDING)


def test_load__classic_is_equation_4_as_printed():
    expected = (((Q / 2 - 1) * (A + B) + B / 2) / 1.382) ** 2
    np.testing.assert_allclose(Classic().load(Q, A, B), expected, rtol=ROUNDING)


def test_load_and_count__modified_is_equation_6_as_printed():
    expected = 2 * (1 + 1.38 * np.sqrt(P) / (A + B))
    np.testing.assert_allclose(Modified().continuous_count(P, A, B), expected, rtol=ROUNDING)
    load = ((Q - 2) * (A + B) / 2 / 1.38) ** 2
    np.testing.assert_allclose(Modified().load(Q, A, B), load, rtol=ROUNDING)


def test_load_and_count__hybrid_is_equation_7_as_printed():
    slope = 1.348 / (A + B) + 0.01583 / A
    expected = 2 * (1 + slope * np.sqrt(P))
    np.testing.assert_allclose(Hybrid().continuous_count(P, A, B), expected, rtol=ROUNDING)
    load = ((Q - 2) / 2 / slope) ** 2
    np.testing.assert_allclose(Hybrid().load(Q, A, B), load, rtol=ROUNDING)


def fitted_on_counts(form, rows):
    """Least squares on Q, as the study fitted: the residual is Q'(p; theta) - Q."""
    a, b, q, p = rows.T

    def residual(theta):
        return form.continuous_count(p, a, b, theta) - q

    return least_squares(residual, form.published, xtol=1e-14, ftol=1e-14, gtol=1e-14).x


@pytest.fixture(scope="module")
def rows_41(paper):
    return paper.calibration.frame[["a_over_R", "b_over_R", "Q", "p_over_E"]].to_numpy(float)


@pytest.fixture(scope="module")
def rows_50(rows_41):
    """The 41 rows and each texture's first load above 0.02."""
    more = []
    for a, b in np.unique(rows_41[:, :2], axis=0):
        counts = np.arange(4, 42, 2)
        loads = HalfPlane().load(counts, a, b)
        first = np.argmax(loads > 0.02)
        more.append((a, b, counts[first], loads[first]))
    return np.concatenate([rows_41, more])


@pytest.mark.parametrize(
    ("form", "rows", "expected", "last_digit"),
    [
        (Hybrid(), "rows_41", (1.3486, 0.01801), (1e-4, 1e-5)),
        (Modified(), "rows_41", (1.3844,), (1e-4,)),
        (Hybrid(), "rows_50", (1.3508, 0.01738), (1e-4, 1e-5)),
        (Modified(), "rows_50", (1.3856,), (1e-4,)),
    ],
)
def test_continuous_count__least_squares_on_the_sweep_gives_the_known_coefficients(
    form, rows, expected, last_digit, request
):
    table = request.getfixturevalue(rows)
    assert len(table) == int(rows.removeprefix("rows_"))
    # Reference: printed digits of an independent least squares to the half-plane loads, last
    # digit +-1; the study's own are 1.348, 0.01583 and 1.38.
    assert np.all(np.abs(fitted_on_counts(form, table) - expected) <= 1.5 * np.array(last_digit))
