"""A rim moved in closed form: its loads are known."""

import numpy as np
import pandas as pd
import pytest

from ridgebayes import InputError
from ridgebayes.fea.deck import Run
from ridgebayes.fea.history import ContactHistory, table_of
from tests.fea.abaqus_writer import pressed


def levels(run, **changes):
    rigid = np.array([(s * far, run["top"]) for far in run["corners"] for s in (1, -1)])
    parts = {"load": run["force"], "undeformed": run["nodes"], "rigid": rigid, **changes}
    return ContactHistory(parts.pop("load"), parts.pop("position", run["position"]), **parts)


def table(run, body=None, **changes):
    half = not (run["nodes"][:, 0] < 0).any()
    body = body or Run(run["a"], run["b"], E=run["E"], symmetry="half" if half else "full")
    return table_of(levels(run, **changes), body, solver="s", source="o")


def frame(run, body=None, **changes):
    return table(run, body, **changes).table.frame


def test_table_of__the_side_that_touches_first_counts():
    run = pressed(full=True)
    # Lower on the left alone, by less than an increment: that side is a little earlier.
    run["position"][:, run["nodes"][:, 0] < 0, 1] -= 2e-4
    found = frame(run)
    assert (found["p_over_E"] < np.array(run["load"]) * (1 - 5e-3)).all()


def test_table_of__reversed_forces_and_thickness_are_the_same_load():
    run = pressed()
    expected = frame(run)["p_over_E"]
    body = Run(run["a"], run["b"], thickness=2.5)
    np.testing.assert_allclose(frame(run, body, load=-2.5 * run["force"])["p_over_E"], expected)


def test_table_of__a_rim_that_hangs_over_round_corners_is_no_overlap():
    run = pressed()
    r = 0.2 * run["a"]
    body = Run(run["a"], run["b"], corner_over_R=r)
    rigid = levels(run).rigid + np.array([r, 0.0])

    def loads(lower):
        """Loads of a rim that lies lower between two places of the first ridge."""
        position = run["position"].copy()
        x, y = position[..., 0] - run["b"] / 2, position[..., 1]
        y[(x > lower[0]) & (x < lower[1]) & (y < run["top"] + 1e-12)] -= 1e-4
        return table(run, body, rigid=rigid, position=position).table.frame["rel_se"]

    still, hanging = loads((0, 0)), loads((0, 0.99 * r))
    pd.testing.assert_series_equal(hanging, still)
    assert (loads((1.5 * r, 3.5 * r)) > still).all()


def test_table_of__a_full_run_called_half_is_refused():
    run = pressed(full=True)
    with pytest.raises(InputError, match="both sides of the axis; use --symmetry full"):
        table(run, Run(run["a"], run["b"]))


@pytest.mark.parametrize(
    ("name", "change", "message"),
    [
        ("undeformed", lambda nodes: nodes[:4], "4 surface nodes; expected at least 5"),
        ("undeformed", lambda nodes: nodes * [1.0, 0.9], "expected the undeformed surface"),
        ("undeformed", lambda nodes: nodes * [1.0, -1.0], "expected the body above the ridges"),
        ("undeformed", lambda nodes: 1e200 * nodes, r"coordinates within 1e\+100"),
        ("load", lambda load: 1e308 * load, r"run: force .*; expected p/E at most"),
        ("rigid", lambda at: at + np.array([0.01, 0.0]), "no rigid nodes at .* --corner"),
    ],
)
def test_table_of__what_no_run_has_is_refused(name, change, message):
    run = pressed()
    with pytest.raises(InputError, match=message):
        table(run, **{name: change(getattr(levels(run), name))})


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"a_over_R": 0.0}, "texture"),
        ({"nu": 0.6}, "nu"),
        ({"nu": float("nan")}, "nu"),
        ({"R": -1.0}, "R"),
        ({"E": float("inf")}, "E"),
        ({"thickness": 0.0}, "thickness"),
        ({"symmetry": "third"}, "symmetry"),
    ],
)
def test_body__values_out_of_range_are_named(changes, named):
    with pytest.raises(InputError, match=rf"^{named}: expected --texture"):
        Run(**{"a_over_R": 0.05, "b_over_R": 0.03, **changes})


def test_table_of__nodes_beyond_the_axis_of_a_half_mesh_are_said_to_be_left_out():
    run = pressed()
    assert not any("beyond the axis" in line for line in table(run).messages)
    mirror = np.array([-1.0, 1.0])
    more = {
        "nodes": np.vstack([run["nodes"], mirror * run["nodes"][1:4]]),
        "position": np.hstack([run["position"], mirror * run["position"][:, 1:4]]),
    }
    done = table({**run, **more}, Run(run["a"], run["b"]))
    assert "3 surface nodes ignored: beyond the axis of a half mesh" in done.messages
    np.testing.assert_allclose(
        done.table.column("p_over_E"), table(run).table.column("p_over_E"), rtol=1e-12
    )


def test_table_of__a_rim_that_rests_within_its_printed_digits_is_in_contact():
    run, digits = pressed(), 1e-5
    position = run["position"].copy()
    # Rounded upwards, in coordinate and displacement, and a floor in the grooves.
    position[..., 1] = np.maximum(position[..., 1], run["top"] + 1.5 * digits)
    found = frame(run, position=position, digits=digits)
    assert found["Q"].tolist() == [4, 6, 8]
    np.testing.assert_allclose(found["p_over_E"], run["load"], rtol=8e-3)  # second order


def test_table_of__the_corner_radius_is_that_of_the_deck_s_nodes():
    run = pressed()
    r = 0.2 * run["a"]
    turn = np.linspace(0, np.pi / 2, 7)
    arc = r * np.column_stack([1 - np.cos(turn), np.sin(turn) - 1])
    # Outer ends of the flats too, as a deck has them.
    ends = np.array([[run["a"] - r, 0.0], [run["a"], -r]])
    ridge = np.vstack([arc, ends])
    rigid = np.vstack([np.array([far, run["top"]]) + ridge for far in run["corners"]])
    given = Run(run["a"], run["b"], corner_over_R=r)
    found, expected = table(run, rigid=rigid), table(run, given, rigid=rigid)
    pd.testing.assert_frame_equal(found.table.frame, expected.table.frame)
    assert any(f"corners of radius {r:.6g} R, by the deck's nodes" in m for m in found.messages)
    # Bodies reach round corners a little further out, and so later.
    loads = found.table.frame["p_over_E"]
    assert (loads > frame(run)["p_over_E"].iloc[: len(loads)]).all()
