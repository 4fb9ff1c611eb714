"""CalculiX's printed levels, from a run whose loads are known."""

import dataclasses
import re
import runpy
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from ridgebayes.errors import InputError
from ridgebayes.fea.history import RunBody
from tests.fea.runs import read_calculix

WRITER = SimpleNamespace(**runpy.run_path(str(Path(__file__).with_name("abaqus_writer.py"))))
RUN = WRITER.pressed()


def read(tmp_path, text=None, *, deck=None, run=RUN, body=None, **options):
    text = (
        WRITER.calculix_text(run["force"], run["nodes"], run["position"]) if text is None else text
    )
    (tmp_path / "run.dat").write_bytes(text.encode() if isinstance(text, str) else text)
    (tmp_path / "run.inp").write_text(WRITER.deck_text(run) if deck is None else deck)
    half = not (run["nodes"][:, 0] < 0).any()
    body = body or RunBody(run["a"], run["b"], E=run["E"], symmetry="half" if half else "full")
    names = {"surface": "RIM", "reaction": "TOP", **options}
    return read_calculix(tmp_path / "run.dat", body, deck=tmp_path / "run.inp", **names)


def levels(text):
    """The text of each level."""
    return re.split(r"(?=\n total force)", text)[1:]


PRINTED = WRITER.calculix_text(RUN["force"], RUN["nodes"], RUN["position"])


@pytest.mark.slow
@pytest.mark.parametrize("full", [False, True])
@pytest.mark.parametrize(("R", "E"), [(1.0, 1.0), (8.0, 0.06)])
def test_read_calculix__finds_the_loads(tmp_path, full, R, E):
    run = WRITER.pressed(full=full, R=R, E=E)
    done = read(tmp_path, run=run)
    found = done.table.frame
    assert found["Q"].tolist() == [4, 6, 8]
    np.testing.assert_allclose(found["p_over_E"], run["load"], rtol=6e-3)  # second order
    assert (np.abs(found["p_over_E"] / run["load"] - 1) < 3 * found["rel_se"]).all()
    assert found["source"].str.contains("run.dat sha256=[0-9a-f]{16} deck=run.inp").all()
    assert any("34 increments" in line for line in done.messages)


def test_read_calculix__forces_of_single_nodes_are_summed(tmp_path):
    n = len(RUN["nodes"]) + 1
    text = re.sub(
        r" total force \(fx,fy,fz\)(.*)\n\n +(\S+) +(\S+) +(\S+)\n",
        lambda m: (
            f" forces (fx,fy,fz){m[1]}\n\n {n} 0. {0.25 * float(m[3])!r} 0.\n"
            f" {n + 1} 0. {0.75 * float(m[3])!r} 0.\n"
        ),
        PRINTED,
    )
    assert " total force" not in text
    deck = WRITER.deck_text(RUN).replace(f"NSET=TOP\n{n},", f"NSET=TOP\n{n},{n + 1}")
    found = read(tmp_path, text, deck=deck).table.frame["p_over_E"]
    np.testing.assert_allclose(found, read(tmp_path).table.frame["p_over_E"], rtol=1e-12)
    done = read(tmp_path, text.replace(f" {n + 1} 0.", f" {n + 2} 0.", 1), deck=deck)
    assert any("increment ignored, fy missing for 1 of 2 nodes" in line for line in done.messages)


def test_read_calculix__a_total_below_forces_of_nodes_is_the_force(tmp_path):
    text = re.sub(
        r" total force \(fx,fy,fz\)(.*)\n",
        lambda m: f" forces (fx,fy,fz){m[1]}\n\n 900 0. 5. 0.\n\n{m[0]}",
        PRINTED,
    )
    done = read(tmp_path, text)
    np.testing.assert_array_equal(
        done.table.frame["p_over_E"], read(tmp_path).table.frame["p_over_E"]
    )
    assert not any("printed again" in line for line in done.messages)


def test_read_calculix__a_level_cut_off_is_left_out(tmp_path):
    cut = PRINTED[: PRINTED.rindex("\n", 0, len(PRINTED) - 200) + 1]
    done = read(tmp_path, cut)
    assert any(re.search(r"increment ignored, .* of 241 nodes$", line) for line in done.messages)
    assert done.table.frame["Q"].tolist() == [4, 6, 8]


def test_read_calculix__a_level_without_a_force_is_left_out(tmp_path):
    text = PRINTED + " displacements (vx,vy,vz) for set RIM and time  0.9900000E+02\n\n"
    assert any(
        "increment ignored, fx, fy, fz of TOP missing" in line
        for line in read(tmp_path, text).messages
    )


def test_read_calculix__a_time_printed_again_counts_once_as_last(tmp_path):
    first = levels(PRINTED)[3]
    wrong = re.sub(r"-?\d\.\d+E-0\d", "9.000000E-03", first)
    text = PRINTED.replace(first, wrong + first)
    done = read(tmp_path, text)
    assert "1 increments printed again: the later one counts" in done.messages
    found, expected = done.table.frame["p_over_E"], read(tmp_path).table.frame["p_over_E"]
    np.testing.assert_array_equal(found, expected)


def test_read_calculix__levels_in_another_order_are_the_same_run(tmp_path):
    text = "".join(reversed(levels(PRINTED)))
    found, expected = (read(tmp_path, one).table.frame["p_over_E"] for one in (text, PRINTED))
    np.testing.assert_array_equal(found, expected)


def test_read_calculix__other_blocks_are_not_used_and_said(tmp_path):
    text = (
        PRINTED + "\n displacements (vx,vy,vz) for set REST and time  0.1000000E+01\n\n 1 2 3 4\n"
    )
    assert "not used: displacements of REST" in read(tmp_path, text).messages


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ({"E": 1.1}, "the material has E = 1, and 1.1 was given"),
        ({"nu": 0.49}, "the material has nu = 0.5, and 0.49 was given"),
        ({"R": 0.98}, "off a circle of R = 0.98"),
        ({"symmetry": "full"}, "--symmetry half"),
        ({"a_over_R": 0.06}, "no rigid nodes at the corners"),
    ],
)
def test_read_calculix__what_contradicts_the_deck_is_refused(tmp_path, body, message):
    with pytest.raises(InputError, match=re.escape(message)):
        read(tmp_path, body=dataclasses.replace(RunBody(RUN["a"], RUN["b"]), **body))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"surface": "ARC"}, "no node set 'ARC'; the node sets are"),
        ({"reaction": "DRIVEN"}, "no node set 'DRIVEN'"),
        ({"surface": "TOP"}, "no increment with displacements of TOP"),
    ],
)
def test_read_calculix__wrong_sets_are_refused(tmp_path, options, message):
    with pytest.raises(InputError, match=message):
        read(tmp_path, **options)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "for set TOP and time  0.2000000E+01",
            "for set TOP and time  nan",
            "'nan': expected a fin",
        ),
        ("E-03  0.000000E+00\n         3", "E-03\n         3", "expected node, vx, vy, vz"),
        ("\n         3 ", "\n         2 ", "node '2'; expected a whole number, each node once"),
        ("\n         3 ", "\n       3,5 ", "'3,5': expected a finite number"),
        ("\n         3 ", "\n     1e999 ", "'1e999': expected a finite number"),
    ],
)
def test_read_calculix__a_line_that_cannot_be_understood_is_named(tmp_path, old, new, message):
    assert old in PRINTED
    with pytest.raises(InputError, match=rf"run\.dat, line \d+: .*{re.escape(message)}"):
        read(tmp_path, PRINTED.replace(old, new, 1))


@pytest.mark.parametrize("text", ["", "0.1;0.2\n", PRINTED.replace("RIM", "ARC")])
def test_read_calculix__a_file_without_levels_is_refused(tmp_path, text):
    with pytest.raises(InputError, match="no increment with displacements of RIM"):
        read(tmp_path, text)


def test_read_calculix__a_last_line_without_its_end_is_left_out(tmp_path):
    done = read(tmp_path, PRINTED.rstrip()[:-5])
    assert any(
        "increment ignored, displacements missing for 1 of 241 nodes" in line
        for line in done.messages
    )


def test_read_calculix__levels_that_never_converged_are_left_out(tmp_path):
    whole = read(tmp_path)
    times = sorted({float(t) for t in re.findall(r"and time +(\S+)", PRINTED)})
    rows = [
        f"{i:5d} {1:10d} {1:5d} {5:5d} {t:.6E} 0.100000E+01 0.100000E+01"
        for i, t in enumerate(times[:-3], start=1)
    ]
    rows.append(f"{len(times) - 2:5d} {1:10d} {1:4d}U {9:5d} {times[-3]:.6E} 0.1E+01 0.1E+01")
    (tmp_path / "run.sta").write_text("\n".join(["SUMMARY OF JOB INFORMATION", *rows, ""]))
    done = read(tmp_path, sta=tmp_path / "run.sta")
    assert any("increment ignored, it did not converge" in line for line in done.messages)
    assert any("stopped after 1 attempts without convergence" in line for line in done.messages)
    n = len(done.table)
    assert done.table.frame["p_over_E"].tolist() == whole.table.frame["p_over_E"].tolist()[:n]
