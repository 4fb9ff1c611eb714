from types import SimpleNamespace

import numpy as np
import pytest

import ridgebayes as rb
from ridgebayes.predict.extrapolation import NAMES, CalibratedRange, names_of

# Widths that are exact in binary: a/pitch from 1/4 to 3/4.
TEXTURES = ((0.25, 0.75), (0.75, 0.25), (0.5, 0.5))


@pytest.fixture
def calibrated(observed):
    def of(form=None):
        data = observed([0, 1, 2, 2], [4, 4, 6, 8], np.log([0.1, 0.2, 0.3, 0.4]), textures=TEXTURES)
        fit = SimpleNamespace(model=SimpleNamespace(data=data), form=form or rb.Hybrid())
        return CalibratedRange.of(fit)

    return of


def named(calibrated, a, b):
    return names_of(calibrated.texture_flags(np.array(a), np.array(b))).tolist()


def test_texture_flags__of_a_ratio_beyond_the_calibrated_ones(calibrated):
    a = [0.25, 0.24, 0.75, 0.76, 0.3]
    b = [0.75, 0.76, 0.25, 0.24, 0.3]
    assert named(calibrated(), a, b) == ["", "a/pitch", "", "a/pitch", ""]


@pytest.mark.parametrize(("scale", "lost"), [(1.5, ""), (1.51, "a/R,b/R")])
def test_texture_flags__of_widths_beyond_one_and_a_half_times_the_calibrated_ones(
    calibrated, scale, lost
):
    # The highest is 0.75 and the lowest 0.25, of both.
    ends = [0.75 * scale, 0.25 / scale]
    assert named(calibrated(), ends, ends) == [lost, lost]
    assert named(calibrated(), [0.5, 0.75 * scale], [0.5, 0.75]) == ["", lost[:3]]
    assert named(calibrated(), [0.75], [0.75 * scale]) == [lost[4:]]


def test_texture_flags__of_a_calibrated_texture_never(calibrated):
    third = np.array([0.1 * 3 / 0.3 * t for t in (0.25, 0.5, 0.75)])  # rounding
    assert named(calibrated(), third, 1 - third) == ["", "", ""]


def test_texture_flags__of_a_texture_without_a_coefficient(calibrated):
    found = calibrated(rb.PowerLaw().bind(TEXTURES[:2]))
    assert named(found, [[0.25], [0.5]], [[0.75], [0.5]]) == [[""], ["texture"]]


def test_load_flags__compare_reduced_loads(calibrated):
    flags = calibrated().load_flags(
        np.array([0.4, 0.41, 0.39, 0.2]), np.array([0.5, 0.5, 0.0, 0.0])
    )
    assert names_of(flags).tolist() == ["", "load", "load", ""]  # 0.39 / 0.75 is 0.52


def test_count_flags__above_the_highest(calibrated):
    assert names_of(calibrated().count_flags([4, 8, 10])).tolist() == ["", "", "Q"]


def test_highest_load__is_at_the_ratio_asked_for_and_none_where_a_row_was_fitted(calibrated):
    a, b = np.array([0.5, 0.5, 0.5, 0.25]), np.array([0.5, 0.5, 0.5, 0.75])
    found = calibrated().highest_load(a, b, np.array([8.0, 10, 4, 8]), np.array([0.5, 0.5, 0, 0.5]))
    np.testing.assert_allclose(found, [np.inf, 0.4, 0.3, 0.4], rtol=1e-11)  # slack of 1e-12


def test_names_of__any_flags_in_any_shape():
    assert names_of(np.array([[0], [2 ** len(NAMES) - 1]])).tolist() == [[""], [",".join(NAMES)]]
    assert names_of(np.uint8(3)).shape == ()
    assert names_of(np.uint8(3)).item() == "Q,load"
