"""The rigid side: where its segments lie, and that no part of it is missing or twice there."""

import math

import numpy as np
import pytest

from ridgebayes.contact.cylinder.faces import (
    Faces,
    Resolution,
    first_height,
    proximal_corner,
    ridge_faces,
)
from ridgebayes.contact.rigid_profile import Profile

FINE = Resolution(corner=0.001, arc=6, most=0.004, edge=0.002)
A, B = 0.05, 0.03


def faces(profile, numbers=range(3), height=0.0):
    return ridge_faces(profile, numbers, height, FINE)


def ends(face):
    return face.at(face.breaks)[0][[0, -1]]


@pytest.mark.parametrize("corner", [0.0, 0.005, 0.02])
def test_top__and_its_round_corners_span_the_ridge(corner):
    profile = Profile(A, B, corner=corner)
    for number in (1, 2):
        level = [
            face
            for face in faces(profile)
            if face.ridge == number and (face.radius or face.angle == 0.0)
        ]
        x = np.sort(np.concatenate([ends(face)[:, 0] for face in level]))
        land = profile.ridge(number)
        # Rounding. Each end inside is shared by two faces.
        np.testing.assert_allclose(x[[0, -1]], [land.start, land.stop], atol=1e-15)
        np.testing.assert_allclose(x[1:-1:2], x[2:-1:2], atol=1e-15)


def test_round_corner__joins_top_and_wall_with_their_normals():
    for face in faces(Profile(A, B, corner=0.01)):
        if face.radius:
            _, normals = face.at(face.breaks[[0, -1]])
            upright = np.abs(normals[:, 1]).argmax()
            np.testing.assert_allclose(normals[upright], [0, 1], atol=1e-15)  # rounding
            assert abs(normals[1 - upright, 0]) == pytest.approx(1.0, abs=1e-15)


@pytest.mark.parametrize("corner", [0.0, 0.005])
def test_wall__faces_the_groove_and_hangs_down(corner):
    profile = Profile(A, B, corner=corner)
    walls = [face for face in faces(profile) if abs(face.angle) == math.pi / 2]
    assert len(walls) == 6  # two of each ridge
    for wall in walls:
        points, normals = wall.at(wall.breaks)
        land = profile.ridge(wall.ridge)
        side = land.start if wall.angle < 0 else land.stop
        np.testing.assert_allclose(points[:, 0], side, atol=1e-15)  # rounding
        assert points[:, 1].max() == pytest.approx(-(corner or FINE.edge), abs=1e-15)
        outward = side - 0.5 * (land.start + land.stop)
        assert (normals[:, 0] * outward > 0).all()


def test_floors__fill_the_grooves():
    profile = Profile(A, B, depth=0.02)
    floors = [face for face in faces(profile) if face.ridge is None]
    spans = np.array([ends(face)[:, 0] for face in floors])
    expected = [[0.0, 0.5 * B]] + [
        [profile.ridge(k).stop, profile.ridge(k + 1).start] for k in range(3)
    ]
    np.testing.assert_allclose(spans, expected, atol=1e-15)  # rounding
    assert all(ends(face)[0, 1] == -0.02 for face in floors)


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


@pytest.mark.parametrize(
    ("number", "x"), [(1, 0.5 * B + A + B), (-1, -0.5 * B), (-2, -1.5 * B - A)]
)
def test_proximal_corner__is_the_inner_one(number, x):
    assert proximal_corner(Profile(A, B), number, -1.0).centre == pytest.approx((x, -1.0))
    rounded = proximal_corner(Profile(A, B, corner=0.01), number, -1.0)
    assert rounded.centre == pytest.approx((x + math.copysign(0.01, x), -1.01))
    assert rounded.radius == 0.01


def test_rays__integrate_each_segment():
    rigid = Faces(faces(Profile(A, B, corner=0.01, depth=0.02)))
    nodes = np.stack([np.linspace(0.0, 0.3, 41), np.full(41, 0.01)], axis=-1)
    rays = rigid.rays(nodes, 0.003)
    total = np.bincount(rays.segment, rays.weight, len(rigid))
    np.testing.assert_allclose(total, rigid.length, rtol=1e-12)  # rounding
    assert np.array_equal(rays.face, rigid.face[rays.segment])
    np.testing.assert_allclose(np.hypot(*rays.normal.T), 1.0, rtol=1e-14)


def test_frames__are_tangent_and_normal_where_points_project_to():
    rigid = Faces(faces(Profile(A, B, corner=0.01), height=-1.0))
    for number, face in enumerate(rigid.faces):
        points, normals = face.at(np.linspace(*face.breaks[[0, -1]], 5))
        raised = points + 0.002 * normals + [0.0, 0.1]
        tangent, normal, scale = rigid.frames(raised, np.full(5, number), 0.1)
        np.testing.assert_allclose(normal, normals, atol=1e-12)  # rounding
        np.testing.assert_allclose(np.sum(tangent * normals, axis=1), 0.0, atol=1e-12)
        expected = face.radius / (face.radius + 0.002) if face.radius else 1.0
        np.testing.assert_allclose(scale, expected, rtol=1e-12)
