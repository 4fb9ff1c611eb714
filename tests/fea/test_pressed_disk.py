"""What decks hold: ridges where the scene has them, a mesh fine at their corners, rising levels."""

import math

import numpy as np
import pytest

from ridgebayes.contact import hertz
from ridgebayes.errors import InputError
from ridgebayes.fea.pressed_disk import pressed_disk
from ridgebayes.scene.scene import Scene, Texture

A, B = 0.06, 0.03


def scene(p_over_E=0.006, nu=0.49, **texture):
    return Scene(textures=(Texture(a_over_R=A, b_over_R=B, **texture),), nu=nu, p_over_E=p_over_E)


def test_blocks__are_the_ridges_and_just_touch_the_disk():
    disk = pressed_disk(scene())
    starts = [block[3, 0] for block in disk.blocks]
    np.testing.assert_allclose(starts, B / 2 + (A + B) * np.arange(len(starts)), rtol=1e-14)
    widths = [block[2, 0] - block[3, 0] for block in disk.blocks]
    np.testing.assert_allclose(widths, A, rtol=1e-13)  # rounding
    top = disk.blocks[0][3, 1]
    assert top == pytest.approx(-math.sqrt(1 - (B / 2) ** 2), abs=1e-15)


def test_blocks__of_round_corners_are_slices_of_an_arc_that_touches():
    r = 0.2 * A
    disk = pressed_disk(scene(corner_radius_over_R=r))
    first = [block for block in disk.blocks if block[2, 0] <= B / 2 + A * (1 + 1e-12)]
    top = np.concatenate([block[3:1:-1] for block in first])
    left = top[top[:, 0] < B / 2 + r]
    centre = np.array([B / 2 + r, top[:, 1].max() - r])
    np.testing.assert_allclose(np.hypot(*(left - centre).T), r, rtol=1e-12)
    # The disk and the arc touch: their centres are 1 + r apart.
    assert np.hypot(*centre) == pytest.approx(1 + r, rel=1e-12)
    widths = [block[2, 0] - block[3, 0] for block in first]
    assert sum(widths) == pytest.approx(A, rel=1e-12)


def test_blocks__of_a_floor_lie_under_the_grooves():
    disk = pressed_disk(scene(groove_depth_over_R=0.01))
    *ridges, floor = disk.blocks
    assert floor[2, 1] == pytest.approx(ridges[0][2, 1] - 0.01, abs=1e-15)
    assert floor[0, 0] < 0
    assert floor[1, 0] == max(block[1, 0] for block in ridges)


def test_levels__rise_past_the_highest_load():
    disk = pressed_disk(scene())
    assert np.all(np.diff(disk.displacements) > 0)
    # Smooth, and stiffer than on ridges: 1.2 times this displacement goes beyond the load.
    w = float(hertz.half_width(0.006, nu=0.49))
    p = 2 * 0.006 * (1 - 0.49**2) / math.pi
    assert disk.displacements[-1] > 1.2 * p * (2 * math.log(4 / w) - 1)


def test_mesh__is_finer_where_more_edges_are_asked_for():
    coarse, fine = (len(pressed_disk(scene(), edges=edges).cells) for edges in (6, 24))
    assert fine > 1.5 * coarse
    disk = pressed_disk(scene(), edges=12)
    rim = disk.mesh.points[disk.rim]
    length = np.hypot(*np.diff(rim, axis=0).T)
    at = np.abs(rim[:-1, 0] - B / 2) < 0.002
    assert length[at].max() < 0.5 * A / 36 * 1.2  # half an edge a third of A / 12 long


@pytest.mark.parametrize(
    ("given", "edges", "message"),
    [
        (Scene.of([(0.02, 0.02), (0.03, 0.02)]), 12, "2 textures; a deck is of one texture"),
        (scene(offset=0.25), 12, r"offset = 0\.25; a deck's body is centred"),
        (scene(), 1, r"edges = 1; expected 2 to 200 on a ridge"),
        (scene(), math.nan, "edges = nan; expected 2 to 200"),
        (scene(0.6), 12, r"the contact is 1\.\d+ R wide; expected under 0\.9 R"),
        (Scene.of([(0.4, 0.2)], p_over_E=0.1, nu=0.4), 12, "ridge 3 lies outside the disk"),
    ],
)
def test_pressed_disk__refuses(given, edges, message):
    with pytest.raises(InputError, match=message):
        pressed_disk(given, edges=edges)
