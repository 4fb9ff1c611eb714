"""The law of very many ridges against exact loads of as many as can be solved."""

import math

import numpy as np
import pytest

from ridgebayes.contact.halfplane import transition_loads
from ridgebayes.contact.homogenised import beyond, edge_constants


@pytest.mark.slow
@pytest.mark.parametrize(
    "share", [0.02, 0.12, 0.286, 0.5, 0.76, pytest.param(0.95, marks=pytest.mark.long)]
)
@pytest.mark.parametrize("n", [4, 16, 64])
def test_beyond__errs_by_less_than_it_says_and_not_by_far_less(share, n):
    exact = transition_loads(share, 1 - share, 256, rel_tol=1e-9)
    assert set(exact.status) == {"ok"}
    k = np.arange(n + 1, 257)
    F, error = beyond(exact.F[:n], 2 * (1 - share) / share, k)
    true = np.abs(F / exact.F[n:] - 1)
    assert np.all(true <= error + 1e-9)  # the exact loads' own tolerance
    assert error.max() < 60 * true.max()


def test_edge_constants__are_those_of_the_literature_of_wide_contacts():
    # Without grooves every load is Hertz's: no constant at all.
    F = math.pi / 8 * np.arange(1, 6) ** 2
    np.testing.assert_allclose(edge_constants(F), 0, atol=1e-14)  # rounding
    # A plane with a layer of springs: each doubling of k moves the edge by Lambda ln 2/pi^2.
    exact = transition_loads(0.5, 0.5, 256, rel_tol=1e-9)
    beta = edge_constants(exact.F)
    step = math.log(1 / math.sin(math.pi / 4)) / math.pi**2 * math.log(2)
    assert beta[127] - beta[255] == pytest.approx(step, rel=1e-3)  # next order: 1/k


def test_transition_loads__of_thousands_of_ridges_join_those_that_were_solved():
    far = transition_loads(0.012, 0.03, 5_000, rel_tol=1e-4)
    assert set(far.status) == {"ok"}
    assert np.count_nonzero(far.n_coefficients) < 100
    assert np.all(np.diff(far.F) > 0)
    near = transition_loads(0.012, 0.03, 256, rel_tol=1e-9)
    np.testing.assert_allclose(far.F[:256], near.F, rtol=1e-4)  # the tolerance asked for
    # Hertz in the end: k pitches wide, but for the edge.
    assert far.F[-1] == pytest.approx(math.pi / 8 * 5_000**2, rel=1e-3)


def test_transition_loads__do_not_join_where_the_law_is_not_good_enough():
    exact = transition_loads(0.012, 0.03, 64, rel_tol=1e-8)
    assert set(exact.status) == {"ok"}
    assert np.all(exact.n_coefficients > 0)
