import numpy as np
import pytest
from scipy.special import ndtr

from ridgebayes.predict.interpolant import Interpolant


class Counted:
    """A function that counts its arguments."""

    def __init__(self, function):
        self.function, self.n = function, 0

    def __call__(self, y):
        self.n += len(y)
        return self.function(y)


@pytest.mark.parametrize(
    "function",
    [ndtr, lambda y: 0.3 * ndtr(40 * (y + 4)) + 0.7 * ndtr(y - 3), lambda y: 1 / (1 + y * y)],
    ids=["normal", "two scales", "poles"],
)
def test_values__are_the_functions_own_from_few_of_them(function):
    counted, y = Counted(function), np.random.default_rng(1).uniform(-9, 9, 50_000)
    # Discretisation: the last three coefficients of a cell are under 1e-14.
    np.testing.assert_allclose(Interpolant(counted, 1e-14)(y), function(y), rtol=0, atol=2e-13)
    assert counted.n < 3_000


def test_range__grows_at_either_end_without_what_is_known_again():
    counted = Counted(np.cos)
    table, before = Interpolant(counted, 1e-14), 0
    for low, high in ((0, 1), (0, 3), (-2, 3), (0.5, 2), (-4, 6), (3, 3)):
        y = np.linspace(low, high, 5_000)
        np.testing.assert_allclose(table(y), np.cos(y), rtol=0, atol=2e-13)  # discretisation
        grown, before = counted.n - before, counted.n
        assert (grown > 0) == ((low, high) not in ((0.5, 2), (3, 3)))


def test_steps__are_evaluated_as_they_are():
    counted, y = Counted(lambda y: np.floor(1_000 * y)), np.linspace(0, 1, 5_001)
    np.testing.assert_array_equal(Interpolant(counted, 1e-14)(y), np.floor(1_000 * y))
    assert counted.n < 3 * len(y)  # its own, and sixteen for each cell of more than sixteen


def test_arguments__may_be_none_or_one():
    assert Interpolant(np.sin, 1e-14)(np.empty(0)).tolist() == []
    assert Interpolant(np.sin, 1e-14)(np.array([0.7])).tolist() == [np.sin(0.7)]
