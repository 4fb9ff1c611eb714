"""What all figures share: colours that are told apart, also by those who see two kinds only."""

import itertools

import numpy as np
import pytest

from ridgebayes.drawing.posterior import plot_corner
from ridgebayes.drawing.style import COLOURS, MARKERS, as_bytes, new_figure, symbol

# Machado, Oliveira and Fernandes (2009), severity 1, of linear RGB.
DEUTERANOPIA = np.array(
    [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ]
)
TO_XYZ = np.array(
    [
        [0.4124564, 0.3575761, 0.1804375],
        [0.2126729, 0.7151522, 0.0721750],
        [0.0193339, 0.1191920, 0.9503041],
    ]
)


def linear(colour):
    values = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def lab(rgb):
    xyz = TO_XYZ @ np.clip(rgb, 0, 1) / (TO_XYZ @ np.ones(3))
    f = np.where(xyz > (6 / 29) ** 3, np.cbrt(xyz), xyz / (3 * (6 / 29) ** 2) + 4 / 29)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


def distance(one, other, seen):
    return np.linalg.norm(lab(seen @ linear(one)) - lab(seen @ linear(other)))


def contrast(colour):
    """Return the contrast with white paper as WCAG defines it."""
    return 1.05 / (TO_XYZ[1] @ linear(colour) + 0.05)


@pytest.mark.parametrize("seen", [np.eye(3), DEUTERANOPIA], ids=["all", "deuteranopia"])
def test_colours__are_told_apart(seen):
    # 10 of CIE 1976 is plain to see side by side; about 2 can just be seen.
    for (one, first), (other, second) in itertools.combinations(COLOURS.items(), 2):
        assert distance(first, second, seen) > 10, (one, other)
        assert MARKERS[one] != MARKERS[other]  # told apart without any colour too


def test_colours__stand_out_from_the_paper():
    # WCAG 2.1, 1.4.11: graphics, 3 to 1.
    assert min(map(contrast, COLOURS.values())) > 3


def test_as_bytes__is_the_same_picture_whatever_was_asked_for_before():
    def drawn():
        figure = new_figure(2.0, 1.0)
        figure.subplots().plot([0, 1])
        return figure

    one, other = drawn(), drawn()
    as_bytes(one, "svg")
    assert as_bytes(one, "png") == as_bytes(other, "png")


LONG = ("a0.027777777777777776_b0.022222222222222223", "a0.044444444444444446_b0.02")


def test_labels_of_quotients__are_rounded_and_fit(faults):
    assert symbol(f"K[{LONG[0]}]") == "$K$ a0.027778_b0.022222"
    draws = np.random.default_rng(1).normal([56.0, 46.0], 1.0, (500, 2))
    figure = plot_corner("power-law", [f"K[{one}]" for one in LONG], draws, {}, n_parameter=2)
    assert figure.axes[2].get_xlabel() == "$K$\na0.0278_b0.0222"
    assert faults(figure) == ([], [])
