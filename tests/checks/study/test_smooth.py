"""The smooth cylinder against Hertz."""

import pytest

from ridgebayes.checks.study.smooth import smooth_cylinder
from ridgebayes.contact.hertz import load_of_half_width


def test_smooth_half_plane_is_hertz_and_elements_are_stiffer():
    half_plane, small, _ = smooth_cylinder()
    # Algebra: one closed form solved two ways.
    assert half_plane.worst_load_error < 1e-13
    assert half_plane.r_squared == pytest.approx(1, abs=1e-13)
    assert small.p_over_E[-1] == pytest.approx(1.026 * load_of_half_width(0.2), rel=1e-12)
    assert small.count[-1] == pytest.approx(2 + (0.4 - 0.03) / 0.052, rel=1e-12)
    assert small.worst_load_error == pytest.approx(1 - 1 / 1.026, rel=1e-12)
