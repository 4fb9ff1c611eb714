"""Parts of steps: along slopes whose zeros are known."""

import math

import pytest

from ridgebayes.contact.cylinder.line_search import best_part


@pytest.mark.parametrize("zero", [1e-3, 0.02, 0.3, 0.8, 2.0, 7.0, 40.0])
@pytest.mark.parametrize("bend", [0.0, 0.5, -0.5])
def test_best_part__leaves_at_most_half_of_the_slope(zero, bend):
    def slope(part):
        x = part / zero
        return (x - 1.0) * (1.0 + bend * math.tanh(x))

    assert abs(slope(best_part(slope))) <= 0.5 * abs(slope(0.0))


@pytest.mark.parametrize(
    "slope", [lambda part: -1.0 - part, lambda part: math.copysign(1.0, part - 0.3)]
)
def test_best_part__is_none_where_the_slope_jumps_or_never_ends(slope):
    asked = []
    assert best_part(lambda part: asked.append(part) or slope(part)) == 0.0
    assert len(asked) < 10
