"""Abaqus's printed tables: loads of a known run, and what is left out or refused.

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
from tests.fea.runs import read_abaqus_dat

WRITER = SimpleNamespace(**runpy.run_path(str(Path(__file__).with_name("abaqus_writer.py"))))
RUN = WRITER.pressed()
ARRAYS = (RUN["force"], RUN["nodes"], RUN["position"])
PRINTED = WRITER.dat_text(*ARRAYS)
N = len(RUN["nodes"])


def read(tmp_path, text=PRINTED, *, deck=None, run=RUN, body=None, brackets=False, **options):
    (tmp_path / "run.dat").write_bytes(text.encode() if isinstance(text, str) else text)
    (tmp_path / "run.inp").write_text(WRITER.deck_text(run) if deck is None else deck)
    half = not (run["nodes"][:, 0] < 0).any()
    body = body or RunBody(run["a"], run["b"], E=run["E"], symmetry="half" if half else "full")
    names = {"surface": "RIM", "reaction": "TOP", **options}
    return read_abaqus_dat(
        tmp_path / "run.dat", body, deck=tmp_path / "run.inp", brackets=brackets, **names
    )


def loads(*args, **options):
    return read(*args, **options).table.frame["p_over_E"].to_numpy()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("full", "R", "E"),
    [
        (True, 1.0, 1.0),
        (False, 8.0, 0.06),
        (True, 40.0, 2e5),
        *(
            pytest.param(*case, marks=pytest.mark.long)
            for case in ((False, 1.0, 1.0), (True, 8.0, 0.06), (False, 40.0, 2e5))
        ),
    ],
)
def test_read_abaqus_dat__finds_the_loads(tmp_path, full, R, E):
    run = WRITER.pressed(full=full, R=R, E=E)
    text = WRITER.dat_text(run["force"], run["nodes"], run["position"])
    done = read(tmp_path, text, run=run)
    found = done.table.frame
    assert found["Q"].tolist() == [4, 6, 8]
    np.testing.assert_allclose(found["p_over_E"], run["load"], rtol=6e-3)  # second order
    assert (np.abs(found["p_over_E"] / run["load"] - 1) < 3 * found["rel_se"]).all()
    assert "34 increments" in done.messages[0]
    assert set(found["solver"]) == {"abaqus"}


@pytest.mark.slow
def test_read_abaqus_dat__rows_and_totals_are_the_same_load(tmp_path):
    driven = [N + 1, N + 2, N + 3]
    deck = WRITER.deck_text(RUN).replace(
        f"NSET=TOP\n{N + 1},", f"NSET=TOP\n{N + 1},{N + 2},{N + 3}"
    )
    one = loads(tmp_path)
    three, total = (
        loads(tmp_path, WRITER.dat_text(*ARRAYS, driven=driven, total=t), deck=deck)
        for t in (False, True)
    )
    # Five digits are printed of each.
    np.testing.assert_allclose(three, one, rtol=2e-4)
    np.testing.assert_allclose(total, one, rtol=2e-4)


@pytest.mark.slow
def test_read_abaqus_dat__a_total_counts_before_the_rows(tmp_path):
    text = WRITER.dat_text(*ARRAYS, total=True)
    text = re.sub(r"TOTAL( +0\.000 +)(\S+)", lambda m: f"TOTAL{m[1]}{2 * float(m[2]):.4E}", text)
    np.testing.assert_allclose(loads(tmp_path, text), 2 * loads(tmp_path), rtol=2e-4)


@pytest.mark.slow
def test_read_abaqus_dat__rows_of_zeros_are_zeros(tmp_path):
    texts = []
    for least in (0.0, 1e-12):
        run = {**RUN, "position": RUN["position"].copy()}
        # Nodes about the second corner stay where they were, in the third level before contact.
        held = np.abs(run["nodes"][:, 0] - run["corners"][1]) < 0.01
        run["position"][1, held] = run["nodes"][held] + least
        texts.append(WRITER.dat_text(run["force"], run["nodes"], run["position"]))
    assert texts[0].count("\n") < texts[1].count("\n")
    found, expected, moving = (read(tmp_path, one).table.frame for one in (*texts, PRINTED))
    assert expected["rel_se"][0] > 1.5 * moving["rel_se"][0]  # these nodes do count
    columns = ["p_over_E", "rel_se"]
    np.testing.assert_allclose(found[columns], expected[columns], rtol=1e-6)  # 1e-12 of R moved


def test_read_abaqus_dat__printed_digits_are_errors_of_the_load(tmp_path):
    errors = []
    for R in (1.0, 1000.0):
        run = WRITER.pressed(R=R)
        text = WRITER.dat_text(run["force"], run["nodes"], run["position"])
        errors.append(read(tmp_path, text, run=run).table.frame["rel_se"][0])
    # Of displacements of up to 34, in units of R / 1000, two decimals are printed: half of 0.01.
    # A gap closes with the depth d at a rate of 1, p/E = 0.00155 grows by 0.3 + 24 d, d = 0.0044.
    expected = 0.005 / 1000 * (0.3 + 24 * 0.0044) / 0.00155
    assert np.sqrt(errors[1] ** 2 - errors[0] ** 2) == pytest.approx(expected, rel=0.2)


def test_read_abaqus_dat__missing_rows_without_an_end_leave_a_level_out(tmp_path):
    start = PRINTED.index("INCREMENT     5 SUMMARY")
    head, tail = PRINTED[:start], PRINTED[start:]
    row = tail.index(f"\n {N - 3:10d} ")
    text = head + tail[:row] + "\n" + tail[tail.index("\n   THE FOLLOWING TABLE", row) :]
    done = read(tmp_path, text)
    assert any("a table of RIM with 237 of 241 nodes, and no end" in s for s in done.messages)
    assert any("33 increments" in line for line in done.messages)


@pytest.mark.slow
def test_read_abaqus_dat__a_file_cut_anywhere_is_refused_or_ends_earlier(tmp_path):
    full = read(tmp_path).table.frame["p_over_E"]
    for cut in np.linspace(0.2, 0.999, 12):
        try:
            found = loads(tmp_path, PRINTED[: int(cut * len(PRINTED))])
        except InputError:
            continue
        np.testing.assert_array_equal(found, full[: len(found)])


def test_read_abaqus_dat__no_summary_needs_all_rows(tmp_path):
    text = re.sub(r"\n (MAXIMUM|MINIMUM|AT NODE).*", "", PRINTED)
    np.testing.assert_array_equal(loads(tmp_path, text), loads(tmp_path))
    short = text.replace(f"\n {7:10d} ", "\n notnode ")
    with pytest.raises(
        InputError, match="increment ignored, a table of RIM with 240 of 241 nodes, and no end"
    ):
        read(tmp_path, short)


def test_read_abaqus_dat__a_page_in_the_middle_of_a_table_changes_nothing(tmp_path):
    row = PRINTED.index(f"\n {100:10d} ")
    page = (
        "\n1\n\n   Abaqus 2023      Date 12-Jun-2026   Time 19:05:39\n   For use by someone\n"
        "\n 10 kN on a pad                    STEP    1  INCREMENT    1\n"
        " 2 mm thick                    TIME COMPLETED IN THIS STEP   0.00\n\n"
    )
    text = PRINTED[:row] + page + PRINTED[row:]
    np.testing.assert_array_equal(loads(tmp_path, text), loads(tmp_path))


def test_read_abaqus_dat__a_table_begun_again_on_a_page_goes_on(tmp_path):
    row = PRINTED.index(f"\n {100:10d} ")
    start = PRINTED.index("   THE FOLLOWING TABLE")
    again = PRINTED[start : PRINTED.index("NOTE", start) + 5]
    text = PRINTED[:row] + "\n\n" + again + PRINTED[row:]
    np.testing.assert_array_equal(loads(tmp_path, text), loads(tmp_path))


@pytest.mark.slow
def test_read_abaqus_dat__a_long_name_on_the_next_line_is_a_name(tmp_path):
    text = PRINTED.replace("NODE SET RIM", "NODE SET\n   RIM")
    np.testing.assert_array_equal(loads(tmp_path, text), loads(tmp_path))


def test_read_abaqus_dat__tables_of_all_nodes_hold_the_sets(tmp_path):
    n = N + 5  # the rim, the driven node and the first ridge
    text = ""
    for k, force in enumerate(RUN["force"], start=1):
        moved, forces = np.zeros((n, 2)), np.zeros((n, 2))
        moved[:N], forces[N, 1] = RUN["position"][k - 1] - RUN["nodes"], force
        text += f"    INCREMENT {k:5d} SUMMARY\n"
        for columns, values in ((("U1", "U2"), moved), (("RF1", "RF2"), forces)):
            table = WRITER._table("X", columns, range(1, n + 1), values, total=False)
            text += "\n".join(table).replace("NODES BELONGING TO NODE SET X", "ALL NODES") + "\n"
    assert f"\n {N + 1:10d} " in text
    np.testing.assert_array_equal(loads(tmp_path, text), loads(tmp_path))


def test_read_abaqus_dat__an_increment_printed_again_counts_once_as_last(tmp_path):
    start = PRINTED.index("INCREMENT     5 SUMMARY")
    start = PRINTED.rindex("\n", 0, start)
    end = PRINTED.rindex("\n", 0, PRINTED.index("INCREMENT     6 SUMMARY"))
    block = PRINTED[start:end]
    wrong = re.sub(r"(\n +242 +0\.000 +)\S+", r"\g<1>9.0000E-01", block)
    wrong = re.sub(r"((?:MAXIMUM|MINIMUM) +0\.000 +)\S+", r"\g<1>9.0000E-01", wrong)
    assert wrong != block
    done = read(tmp_path, PRINTED[:start] + wrong + PRINTED[start:])
    assert "1 increments printed again: the later one counts" in done.messages
    np.testing.assert_array_equal(done.table.frame["p_over_E"], loads(tmp_path))


def test_read_abaqus_dat__a_perturbation_step_is_left_out(tmp_path):
    extra = PRINTED[PRINTED.index("                        S T E P") :].replace(
        "P       1", "P       2"
    )
    extra = extra.replace("\n\n", "\n     THIS IS A LINEAR PERTURBATION STEP.\n\n", 1)
    done = read(tmp_path, PRINTED + extra)
    assert any("31 more: increment ignored, a perturbation step" in line for line in done.messages)
    np.testing.assert_array_equal(done.table.frame["p_over_E"], loads(tmp_path))


def changed_row(new):
    at = PRINTED.index(f"\n {50:10d} ")
    return PRINTED[: at + 1] + new + PRINTED[PRINTED.index("\n", at + 1) :]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (changed_row("         50      1,5E-03  2.0E-03"), "'1,5E-03': expected a finite number"),
        (changed_row("         50      1E999  2.0E-03"), "'1E999': expected a finite number"),
        (changed_row("         50      ********  2.0E-03"), r"'\*+': expected a finite number"),
        (changed_row("         50  TR  1.5E-03  2.0E-03"), "expected node, U1, U2, in global"),
        (changed_row("         50      1.5E-03"), "expected node, U1, U2"),
        (
            changed_row("         49      1.5E-03  2.0E-03"),
            "node '49'; .*, each node once",
        ),
        (changed_row("        900      1.5E-03  2.0E-03"), "node 900 is not in the deck's RIM"),
        (changed_row("         50      1.5E-03  9.0"), "MAXIMUM .* is not that of the rows"),
        (PRINTED.replace(" SUMMARY", " SHORT"), "a table before its increment"),
        (re.sub("MAXIMUM +", "MAXIMUM 1. ", PRINTED, count=1), "'1. .*; expected U1, U2"),
        (PRINTED.replace("SET RIM", "SET PART_RIM"), "the tables are .*U1 U2 of PART_RIM"),
        ("", "no increment with U1 and U2 of RIM"),
        ("0.1;0.2\n", "no increment with U1 and U2 of RIM"),
        (PRINTED.encode("utf-16"), "not UTF-8"),
        (PRINTED.replace("pads", "").encode() + b"\xff\n", "0xff is not UTF-8"),
    ],
)
def test_read_abaqus_dat__what_cannot_be_understood_is_named(tmp_path, text, message):
    with pytest.raises(InputError, match=rf"run\.dat.*{message}"):
        read(tmp_path, text)
