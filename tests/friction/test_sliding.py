"""The sliding study's recipe: its potential against the forces, and the rows that it wrote."""

import runpy
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

HERE = Path(__file__).parents[2] / "data" / "friction"
LINE = 0.02


@pytest.fixture(scope="module")
def recipe():
    return runpy.run_path(str(HERE / "make_sliding.py"))


@pytest.fixture(scope="module")
def path(recipe):
    """A coarse body off centre, moved to the right in three small steps."""
    body = recipe["Body"](0.08, 0.08, 2, 0.5 * LINE)
    problem = body.on(0.2)
    state = recipe["pressed"](problem, problem.unloaded(), LINE)
    found = [(problem, state)]
    for way in (2e-4, 4e-4):
        found.append((problem, recipe["moved"](problem, found[-1][1], LINE, way)))
    return body, found


def test_potential__falls_by_what_the_nodes_push(recipe, path):
    low, middle, high = (recipe["potential"](*one, LINE) for one in path[1])
    force = recipe["row"](*path[1][1])["lateral_over_W"]
    # Truncation of the difference: 2e-5 seen.
    assert -(high - low) / 4e-4 == pytest.approx(force, rel=1e-4)
    assert middle < low


def test_moved__is_where_a_body_pressed_there_is(recipe, path):
    body, found = path
    there = body.on(0.2 + 4e-4 / 0.16)
    anew = recipe["pressed"](there, there.unloaded(), LINE)
    one, other = recipe["row"](*found[-1]), recipe["row"](there, anew)
    assert one == pytest.approx(other, abs=1e-7)
    energies = recipe["potential"](*found[-1], LINE), recipe["potential"](there, anew, LINE)
    assert energies[0] == pytest.approx(energies[1], abs=1e-9)


def test_moved__with_friction_is_held_back(recipe, path):
    problem = path[0].on(0.2, 0.3)
    state = recipe["pressed"](problem, problem.unloaded(), LINE)
    before, after = (
        recipe["row"](problem, one)["lateral_over_W"]
        for one in (state, recipe["moved"](problem, state, LINE, 4e-4))
    )
    assert -0.31 < after < before - 0.005


def test_rows__slope_of_the_potential_is_the_half_planes_force():
    rows = pd.read_csv(HERE / "sliding.csv")
    keys = ["a_over_R", "b_over_R", "p_over_E", "corner_segments"]
    groups = [one.sort_values("offset") for _, one in rows[rows["mu"] == 0].groupby(keys)]
    for one in (one for one in groups if len(one) == 12):
        way = one["offset"] * (one["a_over_R"] + one["b_over_R"])
        force = -np.diff(one["potential_over_WR"]) / np.diff(way)
        half_plane = one["half_plane_over_W"].to_numpy()
        apart = force - 0.5 * (half_plane[1:] + half_plane[:-1])
        # Of the mesh and of finite strain, of the load: 1.2e-4 seen on wide grooves.
        assert np.sqrt(np.mean(apart**2)) < 1.5e-4


def test_rows__with_friction_resist_by_the_coefficient_once_all_slides():
    rows = pd.read_csv(HERE / "sliding.csv")
    slid = rows[(rows["mu"] > 0) & (rows["offset"] > 0.2)]
    # Ridges' corners and a mesh of four segments a corner: 1.5 to 2 % more is seen.
    assert (-slid["lateral_over_W"] / slid["mu"]).between(1.0, 1.03).all()
