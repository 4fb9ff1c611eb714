"""Pressed faces to brackets: a run whose loads are known, in the layout of CalculiX 2.20."""

import re
import runpy
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from ridgebayes.errors import InputError
from ridgebayes.fea.history import RunBody
from tests.fea.runs import read_calculix as read_calculix_contact

WRITER = SimpleNamespace(**runpy.run_path(str(Path(__file__).with_name("abaqus_writer.py"))))
RUN = WRITER.pressed()
# Lines of a run of CalculiX 2.20: a face is printed once a point, whether pressed or not, and side
# 2 of a plane element as the fourth of a solid.
HEAD = " contact stress (slave element+face,press,tang1,tang2) for all contact elements and time"
REAL = f"""
{HEAD} 0.1000000E+00

        16          4  1.468460E-01  0.000000E+00  0.000000E+00
        16          4  0.000000E+00  0.000000E+00  0.000000E+00
        40          4  0.000000E+00  0.000000E+00  0.000000E+00
       104          6  2.844905E-02  0.000000E+00  0.000000E+00


 statistics for slave set SLV, master set MST and time  0.1000000E+00

   total surface force (fx,fy,fz) and moment about the origin (mx,my,mz)

    0.000000E+00  9.912476E-04 -7.325960E-21 -6.145637E-17  1.264094E-22  2.183305E-05

 total force (fx,fy,fz) for set NTOP and time  0.1000000E+00

       -8.358489E-05 -2.167576E-03 -2.008395E-21
"""


def dat_text(run, *, moved=False, pressed=True):
    """Levels with the rim's faces over ridges pressed where the rim lies on them."""
    out = []
    for k, force in enumerate(run["force"], start=1):
        time = f"{k / 100:.7E}"
        out += [f" total force (fx,fy,fz) for set TOP and time  {time}", "", f" 0. {-force:.6E} 0."]
        at = run["position"][k - 1]
        if moved:
            out += ["", f" displacements (vx,vy,vz) for set RIM and time  {time}", ""]
            rows = enumerate(at - run["nodes"], start=1)
            out += [f" {n} {x:.6E} {y:.6E} 0." for n, (x, y) in rows]
        if not pressed:
            continue
        out += ["", f"{HEAD} {time}"]
        out.append("")
        low = np.isclose(at[:, 1], run["top"], atol=1e-9)
        for n in range(1, len(at)):
            # Element n has its first side on the rim, printed as the third of a solid.
            pressure = 0.1 if low[n - 1] and low[n] else 0.0
            out += [f"{n:10d}          3  {pressure:.6E}  0.000000E+00  0.000000E+00"]
    return "\n".join([*out, ""])


def read(tmp_path, text=None, *, run=RUN, sta=None, deck=None, **body):
    text = dat_text(run) if text is None else text
    (tmp_path / "run.dat").write_bytes(text.encode() if isinstance(text, str) else text)
    (tmp_path / "run.inp").write_text(WRITER.deck_text(run) if deck is None else deck)
    half = not (run["nodes"][:, 0] < 0).any()
    if sta is not None:
        (tmp_path / "run.sta").write_text(sta)
    return read_calculix_contact(
        tmp_path / "run.dat",
        RunBody(run["a"], run["b"], **{"symmetry": "half" if half else "full", **body}),
        deck=tmp_path / "run.inp",
        surface="RIM",
        reaction="TOP",
        sta=tmp_path / "run.sta" if sta is not None else None,
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("n_node", "full"),
    [(241, False), (241, True), (1201, False), pytest.param(1201, True, marks=pytest.mark.long)],
)
def test_read_calculix_contact__brackets_hold_the_loads_or_come_a_face_later(
    tmp_path, full, n_node
):
    run = WRITER.pressed(full=full, n_node=n_node)
    found = read(tmp_path, run=run).table.frame
    loads = np.array(run["load"])
    assert found["Q"].tolist() == [4, 6, 8]
    assert (found["p_over_E"] >= loads).all()
    # A face is pressed once its whole length lies on the ridge: a face's length further out.
    face = 0.9 / (n_node - 1)
    late = face * np.array(run["corners"][1:4]) * (0.3 + 24 * 0.034)  # its depth times dp/dd
    assert (found["p_over_E_lower"] < loads + late).all()


def test_read_calculix_contact__a_level_is_an_increment_of_the_run(tmp_path):
    done = read(tmp_path)
    found = done.table.frame
    levels = RUN["force"]  # twice half a body's, over 2 R E
    for row in found.itertuples():
        k = int(np.argmin(np.abs(levels - row.p_over_E)))
        # Seven digits of a force are printed.
        assert row.p_over_E == pytest.approx(levels[k], rel=1e-6)
        assert row.p_over_E_lower == pytest.approx(levels[k - 1], rel=1e-6)
    assert "kept: 3 transitions, Q = 4 to 8, all as brackets" in done.messages


def test_read_calculix_contact__without_displacements_faces_are_where_they_were(tmp_path):
    done = read(tmp_path, dat_text(RUN))
    assert any(
        re.fullmatch(r"pressed faces: \d+ at most, where they were", m) for m in done.messages
    )
    assert done.table.frame["Q"].tolist() == [4, 6, 8]


def test_read_calculix_contact__displacements_tell_more(tmp_path):
    found, other = (read(tmp_path, dat_text(RUN, moved=True, pressed=p)) for p in (True, False))
    assert found.messages == other.messages
    assert (found.table.frame["rel_se"] > 0).all()


def level_text(k, *faces, moved=0.0):
    """A level with faces of the rim pressed, all nodes moved sideways."""
    text = f" total force (fx,fy,fz) for set TOP and time {k}.0\n\n 0. {0.01 * k} 0.\n"
    if moved:
        rows = "".join(f" {n} {moved} 0. 0.\n" for n in range(1, 242))
        text += f" displacements (vx,vy,vz) for set RIM and time {k}.0\n\n{rows}"
    return text + f"{HEAD} {k}.0\n\n" + "".join(f" {n} 3 0.1 0. 0.\n" for n in faces)


@pytest.mark.slow
def test_read_calculix_contact__a_level_without_contact_print_is_left_out(tmp_path):
    text = dat_text(RUN) + "\n total force (fx,fy,fz) for set TOP and time  0.9E+01\n\n 0. 1. 0.\n"
    assert any(
        "increment ignored, element, face, press, tang1, tang2 missing" in line
        for line in read(tmp_path, text).messages
    )
    with pytest.raises(
        InputError,
        match="no increment with displacements of RIM or contact stress, and forces of TOP",
    ):
        read(tmp_path, dat_text(RUN, pressed=False))


def test_read_calculix_contact__a_face_over_two_ridges_leaves_the_increment_open(tmp_path):
    run = WRITER.pressed(n_node=21, a=0.03, b=0.02)  # faces of 0.045 over grooves of 0.02
    # Undeformed: face 1 from 0 to 0.045 is on the first ridge (0.01 to 0.04); face 2, to 0.09, on
    # the second alone (0.06 to 0.09); face 3, to 0.135, on the second's end and the third.
    faces = ((1,), (1, 3), (1, 2, 3), (1, 2, 3, 4))
    text = "".join(level_text(k, *some) for k, some in enumerate(faces, start=1))
    found = read(tmp_path, text, run=run).table.frame
    loads = 0.01 * np.arange(1, 5)
    first = found[found["Q"] == 4].iloc[0]
    assert (first["p_over_E_lower"], first["p_over_E"]) == pytest.approx((loads[0], loads[2]))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("          3  1.0", "          2  1.0", "expected a side of a plane element"),
        ("          3  1.0", "          7  1.0", "no side 5 of an element"),
        (
            "         5          3  1.0",
            "    900000          3  1.0",
            "no side 1 of an element 900000",
        ),
        ("         5          3  1.0", "       5.5          3  1.0", "expected a side of a plane"),
        ("          3  1.000000E-01", "          3  1,000000E-01", "expected a finite number"),
        ("          3  1.000000E-01", "  1.000000E-01", "expected element, face, press"),
        (" 0.\n", "\n", "expected fx, fy, fz"),
        ("E-02\n", "E-02x\n", "expected a finite number|no level"),
    ],
)
def test_read_calculix_contact__what_cannot_be_understood_is_named(tmp_path, old, new, message):
    text = dat_text(RUN)
    assert old in text
    with pytest.raises(InputError, match=rf"run\.(dat|inp).*({message})"):
        read(tmp_path, text.replace(old, new, 1))


def test_read_calculix_contact__of_nodes_is_told(tmp_path):
    text = dat_text(RUN).replace("slave element+face", "slave node")
    with pytest.raises(InputError, match=r"no increment with.* of faces, TYPE=SURFACE TO SURFACE"):
        read(tmp_path, text)


def pressed(level):
    rows = level.blocks["contact stress"].values
    return {(int(e), int(f)) for e, f, p, *_ in rows if p > 0}
