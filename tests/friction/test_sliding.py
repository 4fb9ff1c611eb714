"""The sliding study's recipe: its potential against the forces, and the rows that it wrote."""

import runpy
from pathlib import Path

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
