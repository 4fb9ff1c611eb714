"""Reports of Abaqus/Viewer: loads of a known run, columns of X-Y data, and what is refused.

Files are in Abaqus's layout, written from that run's numbers; no file of Abaqus is used.
"""

import re
import runpy
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from ridgebayes.errors import InputError
from ridgebayes.fea.history import RunBody
from tests.fea.runs import read_abaqus_rpt

WRITER = SimpleNamespace(**runpy.run_path(str(Path(__file__).with_name("abaqus_writer.py"))))
RUN = WRITER.pressed(n_level=34, n_node=161)
ARRAYS = (RUN["force"], RUN["nodes"], RUN["position"])
PRINTED = WRITER.rpt_text(*ARRAYS)
N = len(RUN["nodes"])
BODY = RunBody(RUN["a"], RUN["b"], top=RUN["top"])


def read(tmp_path, text=PRINTED, body=BODY, *, deck=None, run=RUN, **options):
    (tmp_path / "run.rpt").write_bytes(text.encode() if isinstance(text, str) else text)
    if deck:
        (tmp_path / "run.inp").write_text(WRITER.deck_text(run))
        options["deck"] = tmp_path / "run.inp"
    return read_abaqus_rpt(tmp_path / "run.rpt", body, **options)


def loads(*args, **options):
    return read(*args, **options).table.frame["p_over_E"].to_numpy()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("full", "coordinates", "R", "E"),
    [
        (False, "deformed", 1.0, 1.0),
        (True, "undeformed", 8.0, 6e4),
        *(
            pytest.param(*case, marks=pytest.mark.long)
            for case in (
                (False, "deformed", 8.0, 6e4),
                (False, "undeformed", 1.0, 1.0),
                (False, "undeformed", 8.0, 6e4),
                (True, "deformed", 1.0, 1.0),
                (True, "deformed", 8.0, 6e4),
                (True, "undeformed", 1.0, 1.0),
            )
        ),
    ],
)
def test_read_abaqus_rpt__finds_the_loads_from_either_coordinates(
    tmp_path, full, coordinates, R, E
):
    run = WRITER.pressed(full=full, R=R, E=E)
    text = WRITER.rpt_text(run["force"], run["nodes"], run["position"], coordinates=coordinates)
    body = RunBody(run["a"], run["b"], E=E, top=run["top"], symmetry="full" if full else "half")
    done = read(tmp_path, text, body)
    found = done.table.frame
    assert found["Q"].tolist() == [4, 6, 8]
    np.testing.assert_allclose(found["p_over_E"], run["load"], rtol=6e-3)  # second order
    assert (np.abs(found["p_over_E"] / run["load"] - 1) < 3 * found["rel_se"]).all()
    assert f"COORD: coordinates of {coordinates} nodes" in done.messages
    assert "34 increments" in done.messages[0]


@pytest.mark.slow
def test_read_abaqus_rpt__coordinates_of_a_deck_give_the_same(tmp_path):
    text = WRITER.rpt_text(*ARRAYS, coordinates=None)
    body = RunBody(RUN["a"], RUN["b"])
    expected = loads(tmp_path)
    for names in ({}, {"surface": "RIM", "reaction": "TOP"}, {"surface": "BODY-1.RIM"}):
        # Six digits are printed of coordinates too, and the first load is where they count most.
        np.testing.assert_allclose(
            loads(tmp_path, text, body, deck=True, **names), expected, rtol=1e-3
        )


def test_read_abaqus_rpt__sets_of_a_deck_are_found_in_a_region_of_all(tmp_path):
    """One region of the whole part: the deck's sets tell its nodes apart."""
    text = WRITER.rpt_text(*ARRAYS, coordinates=None)
    text = text.replace("BODY-1.RIM", "BODY-1").replace("BODY-1.TOP", "BODY-1")
    found = loads(
        tmp_path, text, RunBody(RUN["a"], RUN["b"]), deck=True, surface="RIM", reaction="TOP"
    )
    np.testing.assert_allclose(found, loads(tmp_path), rtol=1e-3)


def test_read_abaqus_rpt__reports_of_one_frame_belong_together(tmp_path):
    """Forces in reports of their own after all displacements."""
    reports = re.split(r"(?=\*{80})", PRINTED)[1:]
    part = "Field Output reported at nodes for region: BODY-1.TOP"
    rims = [one[: one.index(part)] for one in reports]
    tops = [one[: one.index("Field Output reported")] + one[one.index(part) :] for one in reports]
    np.testing.assert_array_equal(loads(tmp_path, "".join(rims + tops)), loads(tmp_path))
    np.testing.assert_array_equal(loads(tmp_path, "".join(reports[::-1])), loads(tmp_path))


@pytest.mark.slow
def test_read_abaqus_rpt__wide_rows_go_on_on_a_second_line(tmp_path):
    wide = []
    for line in PRINTED.split("\n"):
        # Rows of five columns are wrapped after three, their headers and dashes too.
        if len(line) == 80 and line[0] != "*":
            wide += [line[:48], line[48:]]
        else:
            wide.append(line)
    text = "\n".join(wide)
    head = re.search(r"( +Node +COORD[^\n]*)\n([^\n]*U\.U1[^\n]*)\n([^\n]*)\n([^\n]*)\n", text)
    assert head is not None
    text = re.sub(
        r"( +Node +COORD[^\n]*)\n([^\n]*U\.U1[^\n]*)\n( +Label[^\n]*)\n([^\n]*)\n(-+)\n(-+)\n",
        r"\1\n\3\n\5\n\2\n\4\n\6\n",
        text,
    )
    np.testing.assert_array_equal(loads(tmp_path, text), loads(tmp_path))
    # A blank line in a row is not the end of its table.
    text = re.sub(r"(\n {13}100 [^\n]*\n)", r"\1\n", text)
    np.testing.assert_array_equal(loads(tmp_path, text), loads(tmp_path))


def test_read_abaqus_rpt__label_and_node_on_one_line_are_a_header(tmp_path):
    text = PRINTED.replace("            Node", "      Node Label").replace(
        "\n           Label", "\n                "
    )
    np.testing.assert_array_equal(loads(tmp_path, text), loads(tmp_path))


def test_read_abaqus_rpt__without_summaries_a_blank_line_ends_a_table(tmp_path):
    text = re.sub(r"(?s)  Minimum.*?Total[^\n]*\n", "", PRINTED)
    assert "Total" not in text
    np.testing.assert_array_equal(loads(tmp_path, text), loads(tmp_path))


@pytest.mark.slow
def test_read_abaqus_rpt__a_file_cut_anywhere_is_refused_or_ends_earlier(tmp_path):
    full = loads(tmp_path)
    for cut in np.linspace(0.2, 0.999, 12):
        try:
            found = loads(tmp_path, PRINTED[: int(cut * len(PRINTED))])
        except InputError:
            continue
        # Undeformed coordinates are medians over frames, of six digits each.
        np.testing.assert_allclose(found, full[: len(found)], rtol=1e-3)


def test_read_abaqus_rpt__a_cut_table_leaves_its_frame_out(tmp_path):
    row = PRINTED.rindex(f"\n{100:16d} ")
    done = read(tmp_path, PRINTED[: row + 1])
    assert any(re.search("increment ignored, .* is cut off$", line) for line in done.messages)
    short = PRINTED[:row] + PRINTED[PRINTED.index("\n\n", row) :]
    done = read(tmp_path, short)
    assert any(
        re.search(r"line \d+: increment ignored, 62 nodes missing", s) for s in done.messages
    )


def test_read_abaqus_rpt__elements_and_modes_are_not_used(tmp_path):
    extra = (
        "\nField Output reported at integration points for part: BODY-1\n\n Element Int S.S11\n"
        " Label Pt @Loc 1\n-----------------\n 1 1 2.\n\n\n   Frame: Mode 1: Value = 3.\n"
        "Field Output reported at nodes for part: B\n\n Node  U.U1\n---------------\n 1  2.\n\n"
    )
    done = read(tmp_path, PRINTED + extra)
    assert any("not used: Field Output reported at integration" in line for line in done.messages)
    np.testing.assert_array_equal(done.table.frame["p_over_E"], loads(tmp_path))


def changed_row(change):
    at = PRINTED.index(f"\n{50:16d} ") + 1
    end = PRINTED.index("\n", at)
    return PRINTED[:at] + change(PRINTED[at:end]) + PRINTED[end:]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (changed_row(lambda row: row.replace(".", ",")), "expected a finite number"),
        (changed_row(lambda row: row[:-8] + "1E999"), "expected a finite number"),
        (changed_row(lambda row: row[:-10] + " NoValue"), "'NoValue': expected a finite number"),
        (changed_row(lambda row: row + " 1."), "expected node, COORD.COOR1"),
        (
            changed_row(lambda row: row.replace("   50 ", "   49 ")),
            "node '49'; expected a whole number, each node once, averaged where",
        ),
        (
            changed_row(lambda row: row.replace("   50 ", " 50.5 ")),
            "'50.5'; expected a whole number",
        ),
        (PRINTED.replace("   ODB: /", "   ODB: /2", 1), "expected one run"),
        (PRINTED.replace("RF.RF2", "RF.RF3"), "increment ignored, RF.RF2 missing"),
        (
            PRINTED.replace("U.U1", "UT.U1"),
            "increment ignored, COORD.COOR1, COORD.COOR2, U.U1, U.U2 missing",
        ),
        (
            WRITER.rpt_text(*ARRAYS, coordinates=None),
            "increment ignored, COORD.COOR1, COORD.COOR2, U.U1, U.U2 missing",
        ),
        (re.sub(r"COOR1(.*)COOR2", r"COOR2\1COOR1", PRINTED), "expected one of the two to stay"),
        ("", "no 'Field Output Report'"),
        ("0.1;0.2\n", "no 'Field Output Report'"),
        (PRINTED.encode("utf-16"), "UTF-8"),
    ],
)
def test_read_abaqus_rpt__what_cannot_be_understood_is_named(tmp_path, text, message):
    with pytest.raises(InputError, match=rf"run\.rpt.*{re.escape(message)}"):
        read(tmp_path, text)


def test_read_abaqus_rpt__a_total_off_its_rows_is_refused(tmp_path):
    at = PRINTED.index("Total", PRINTED.index("RF.RF2"))
    end = PRINTED.index("\n", at)
    with pytest.raises(
        InputError, match=r"RF\.RF2 of BODY-1\.TOP adds up to .*, and the total is 9"
    ):
        read(tmp_path, PRINTED[:at] + "Total  0.  9." + PRINTED[end:])


@pytest.mark.slow
def test_read_abaqus_rpt__forces_that_cancel_are_refused(tmp_path):
    text = re.sub(
        rf"\n( +){N + 1}( +)0\.( +)(\S+)\n(?s:.*?)Total[^\n]*",
        rf"\n\g<1>{N + 1}\g<2>0.\g<3>\g<4>\n\g<1>{N + 2}\g<2>0.\g<3>-\g<4>\n\n",
        PRINTED,
    )
    with pytest.raises(
        InputError, match="cancels to 0; expected a region of the driven nodes alone"
    ):
        read(tmp_path, text)


@pytest.mark.slow
def test_read_abaqus_rpt__regions_with_the_same_columns_have_to_be_named(tmp_path):
    run = {**RUN, "force": 3 * RUN["force"]}
    other = WRITER.rpt_text(
        run["force"], RUN["nodes"], RUN["position"], regions=("BODY-2.RIM", "BODY-2.TOP")
    )
    with pytest.raises(InputError, match=r"of BODY-1\.RIM, BODY-2\.RIM; name one"):
        read(tmp_path, PRINTED + other)
    found = loads(tmp_path, PRINTED + other, surface="BODY-2.RIM", reaction="BODY-2.TOP")
    np.testing.assert_allclose(found, 3 * loads(tmp_path), rtol=1e-4)  # six digits are printed


def test_read_abaqus_rpt__one_frame_cannot_tell_what_coordinates_are(tmp_path):
    one = PRINTED[: PRINTED.index("*" * 80, 100)]
    with pytest.raises(
        InputError, match="between 1 frames; expected one of the two to stay, or --deck"
    ):
        read(tmp_path, one)
