"""The rigid side: where its segments lie, and that no part of it is missing or twice there."""

import numpy as np
import pytest

from ridgebayes.contact.cylinder.faces import (
    Faces,
    Resolution,
    first_height,
    ridge_faces,
)
from ridgebayes.contact.rigid_profile import Profile

FINE = Resolution(corner=0.001, arc=6, most=0.004, edge=0.002)
A, B = 0.05, 0.03


def faces(profile, numbers=range(3), height=0.0):
    return ridge_faces(profile, numbers, height, FINE)


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


def test_rays__integrate_each_segment():
    rigid = Faces(faces(Profile(A, B, corner=0.01, depth=0.02)))
    nodes = np.stack([np.linspace(0.0, 0.3, 41), np.full(41, 0.01)], axis=-1)
    rays = rigid.rays(nodes, 0.003)
    total = np.bincount(rays.segment, rays.weight, len(rigid))
    np.testing.assert_allclose(total, rigid.length, rtol=1e-12)  # rounding
    assert np.array_equal(rays.face, rigid.face[rays.segment])
    np.testing.assert_allclose(np.hypot(*rays.normal.T), 1.0, rtol=1e-14)
