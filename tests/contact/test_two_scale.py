"""Two scales: the smooth cylinder's table, and loads on ridges against finite elements."""

import math

import numpy as np
import pandas as pd
import pytest

from ridgebayes import InputError
from ridgebayes._types import NEO_HOOKEAN
from ridgebayes.contact import halfplane, hertz, two_scale
from ridgebayes.contact.contact_solution import load_factor
from ridgebayes.contact.reaching import reaching_loads
from ridgebayes.contact.rigid_profile import Profile
from ridgebayes.contact.two_scale import (
    REACH,
    TABLE,
    half_plane_load,
    load_of,
    relative_error,
    width_ratio,
)
from ridgebayes.table.datafiles import CALCULIX_FE, CYLINDER_SWEEP, data_path


def test_width_ratio__is_the_table_of_the_smooth_cylinder():
    table = pd.read_csv(TABLE)
    assert table["p_over_E"].max() >= REACH
    table = table[table["p_over_E"] <= REACH]
    found = width_ratio(table["p_over_E"], table["nu"])
    # Discretisation: meshes twice as fine differ by under 2e-4.
    np.testing.assert_allclose(found, table["width_over_hertz"], rtol=3e-4)


def test_width_ratio__is_that_of_another_code():
    rows = pd.read_csv(data_path("fea/smooth_cylinder.csv"))
    rows = rows[(rows["model"] == "neo-hooke") & (rows["half_width_over_R"] > 0.1)]
    assert len(rows) == 1
    for row in rows.to_dict("records"):
        ratio = row["width_over_hertz"]
        load = hertz.load_of_half_width(row["half_width_over_R"] / ratio)
        assert width_ratio(load) == pytest.approx(ratio, abs=1.2e-3)  # reference: three decimals


def test_width_ratio__of_a_compressible_body_falls_as_its_surface_draws_in():
    # The surface strain -(1 - 2 nu)(1 + nu) q/E draws the surface in, by s = (1 - 2 nu)(1 + nu) p
    # at the contact's end. What that makes of the body's shape narrows it by 8/pi^2 s
    # (docs/derivations/two-scale.md); the material's own second order is left out.
    nu, p = 0.3, 2e-3
    drawn = (1 - 2 * nu) * (1 + nu) * p / float(hertz.half_width(p, nu=nu))
    assert 1 - float(width_ratio(p, nu)) == pytest.approx(8 / math.pi**2 * drawn, rel=0.2)


def narrowed(nu, ogden):
    """A body whose contact is 0.2 p narrower, with an equilibrium to p/E = 0.4."""
    return np.array([0.0, 0.0, -0.2, 0.0]), 0.4


def test_another_material__multiplies_r_and_its_own_reach_ends_it(monkeypatch):
    monkeypatch.setattr(two_scale, "stiffening_of", narrowed)
    p, ogden = np.array([0.01, 0.1, 0.39]), ((1.0, 9.0),)
    expected = width_ratio(p, 0.45) * (1 - 0.2 * p)
    np.testing.assert_allclose(width_ratio(p, 0.45, ogden), expected, rtol=1e-14)  # rounding
    back = load_of(half_plane_load(p, 0.45, ogden), 0.45, ogden)
    np.testing.assert_allclose(back, p, rtol=1e-10)  # rounding times condition
    assert two_scale.reach(0.45, ogden) == 0.4 < two_scale.reach()
    assert np.isnan(width_ratio(0.41, 0.45, ogden))
    error, soft = (
        relative_error(p, Profile(0.05, 0.05), 0.45, one) for one in (ogden, NEO_HOOKEAN)
    )
    assert (error > soft).all()


@pytest.mark.parametrize("nu", [[0.45, 0.5], 0.2])
def test_another_material__takes_one_poissons_ratio(nu):
    with pytest.raises(InputError, match="ogden: expected one poissons_ratio"):
        width_ratio(0.1, nu, ((1.0, 9.0),))


def test_relative_error__grows_with_corners_and_off_centre():
    p = np.array([0.005, 0.02])
    sharp, round_, beside = (
        relative_error(p, Profile(0.04, 0.02, **shape), 0.3)
        for shape in ({}, {"corner": 0.0145}, {"offset": 0.2})
    )
    assert (round_ > 1.2 * sharp).all()
    # Reference: 1.7 % was the largest of twelve rows off finite elements, docs/two-scale.md.
    assert (1.96 * beside > 0.017).all()
    over_ridge = relative_error(p, Profile(0.04, 0.02, offset=0.5), 0.3)
    np.testing.assert_allclose(over_ridge, sharp, rtol=1e-12)  # rounding


def test_load_of__of_what_is_beyond_is_not_known():
    assert np.isnan(load_of([float(half_plane_load(REACH)) * 1.001, math.nan])).all()
    assert np.isnan(width_ratio(REACH * 1.001))
    assert np.isnan(width_ratio(0.1, 0.29))


@pytest.mark.parametrize("name", [CYLINDER_SWEEP, CALCULIX_FE])
def test_load_of__is_the_load_of_finite_elements_on_sharp_corners(name):
    rows = pd.read_csv(data_path(name)).to_dict("records")
    off = []
    for row in rows:
        a, b, nu, k = row["a_over_R"], row["b_over_R"], row["nu"], row["Q"] // 2 - 1
        half_plane = halfplane.transition_loads(a, b, k).p_over_E(a + b, nu=nu)[-1]
        found = float(load_of(half_plane, nu))
        error = np.hypot(row["rel_se"], float(relative_error(found, Profile(a, b), nu)))
        off.append((found / row["p_over_E"] - 1) / error)
    assert len(off) >= 12
    assert np.mean(np.abs(off) < 1.96) >= 0.95


# The package's own, and CalculiX's.
ROUND = pd.concat(
    pd.read_csv(data_path(f"fea/{name}.csv")) for name in ("rounded_corners", "calculix_rounded")
)
KEYS = ["a_over_R", "b_over_R", "nu", "offset_over_R"]


@pytest.mark.slow
@pytest.mark.parametrize(("key", "rows"), list(ROUND.groupby(KEYS)))
def test_load_of__is_the_load_of_finite_elements_on_round_corners(key, rows):
    a, b, nu, offset = key
    profile = Profile(a, b, corner=rows["corner_radius_over_R"].iloc[0], offset=offset / (a + b))
    top = 1.05 * load_factor(nu) * rows["p_over_E"].max()
    events = reaching_loads(profile, W_max=top, rel_tol=1e-6)
    half_plane = dict(zip(events.Q.tolist(), events.W / load_factor(nu), strict=True))
    found = load_of([half_plane.get(Q, math.nan) for Q in rows["Q"]], nu)
    known = np.isfinite(found)  # the half-plane's corners stop it at some load
    assert known.any()
    error = np.hypot(rows["rel_se"], relative_error(found, profile, nu))
    assert (np.abs(found / rows["p_over_E"] - 1)[known] < 1.96 * error[known]).all()
