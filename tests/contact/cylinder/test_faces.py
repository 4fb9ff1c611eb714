"""The rigid side: the height at which it touches the disk."""

import numpy as np
import pytest

from ridgebayes.contact.cylinder.faces import (
    Resolution,
    first_height,
    ridge_faces,
)
from ridgebayes.contact.rigid_profile import Profile

FINE = Resolution(corner=0.001, arc=6, most=0.004, edge=0.002)
A, B = 0.05, 0.03


@pytest.mark.parametrize("corner", [0.0, 0.002, 0.025])
@pytest.mark.parametrize("offset", [0.0, 0.2, -0.3, 0.5])
def test_first_height__lets_the_disk_touch_and_not_more(offset, corner):
    profile = Profile(A, B, corner=corner, offset=offset)
    height = first_height(profile)
    points = [face.at(np.linspace(*face.breaks[[0, -1]], 20_001))[0] for face in
              ridge_faces(profile, range(-2, 3), height, FINE)]  # fmt: skip
    out = np.hypot(*np.concatenate(points).T).min() - 1.0
    # A point of an arc lies within 1e-5 radii of the touching one: 1e-10 of its radius.
    assert out == pytest.approx(0.0, abs=1e-11)
