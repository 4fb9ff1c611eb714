"""`ridgebayes import` and `export-deck` as a person types them."""

import functools
import re
from pathlib import Path

import numpy as np
import pytest

import ridgebayes as rb
from ridgebayes.fea.deck_text import deck_text, pressed_disk

A, B, NU = 0.06, 0.03, 0.49
SCENE = f"""
[body]
poissons_ratio = {NU}
[texture]
ridge_width = {A}
groove_width = {B}
[load]
p_over_E = 0.006
"""
TABLE = "Ridge [um],Groove [um],Q,P [N/mm]\n240,80,4,0.00094\n240,80,6,0.00364\n"
MAP = ("--map", "a=Ridge [um]", "--map", "b=Groove [um]", "--map", "line=P [N/mm]")
RUN = ("--surface", "NARC", "--reaction", "NTOP", "--texture", f"{A},{B}", "--nu", NU)
LOADS = np.linspace(0.0005, 0.01, 20)
REACHED = 0.00425


def printed(disk, gap_per_load=-1.0):
    """Return a run's output: a rim that sinks until it is at the next corner at `REACHED`."""
    number = disk.numbers
    nodes = [(n, at) for n, at in zip(number[disk.rim], disk.mesh.points[disk.rim], strict=True)]
    corner = disk.blocks[1][3]
    high = -np.sqrt(1 - corner[0] ** 2)
    lines = []
    for time, p in enumerate(LOADS, start=1):
        down = (high - corner[1]) * p / REACHED
        lines += [f"\n total force (fx,fy,fz) for set NTOP and time  {time:.7E}\n"]
        lines += [f"        0.000000E+00 {-p:13.6E}  0.000000E+00\n"]
        lines += [f" displacements (vx,vy,vz) for set NARC and time  {time:.7E}\n"]
        lines += [f"{n:10d}  0.000000E+00 {-down:13.6E}  0.000000E+00" for n, _ in nodes if n]
    return "\n".join(lines) + "\n"


@pytest.fixture
def run(command):
    """Call `import` in a folder that holds a deck and what a run of it would print."""
    disk = pressed_disk(rb.Scene.of([(A, B)], p_over_E=0.006, nu=NU), edges=4)
    Path("run.inp").write_text(deck_text(disk, "calculix"))
    Path("run.dat").write_text(printed(disk))
    Path("alone.dat").write_text(printed(disk))
    Path("mine.csv").write_text(TABLE)
    return functools.partial(command, "import")


def test_import__of_a_run_gives_the_load_at_which_the_corner_is_reached(run):
    said = run("run.dat", "--deck", "run.inp", *RUN, "-o", "t.csv")
    assert said.code == 0
    assert said.err.startswith("ridgebayes: warning: 1 row, a0.06_b0.03 Q = 4")
    frame = rb.read_table("t.csv").frame
    assert frame["Q"].iloc[0] == 4
    # Seven digits of a displacement are printed: 1e-5 of the gap's slope.
    assert frame["p_over_E"].iloc[0] == pytest.approx(REACHED, rel=2e-4)
    assert frame["rel_se"].iloc[0] > 0.1  # the first ridge is deep inside this rigid rim
    assert frame["source"].str.match(r"import calculix: run\.dat sha256=\w{16} deck=run\.inp").all()
    assert said.out.startswith("format: calculix\nrun.dat: 20 increments\n")
    assert f"texture: a/R = {A:g}, b/R = {B:g}, nu = 0.49" in said.out
    next_one = r"next: ridgebayes run --table t\.csv\n$"
    assert re.search(r"t\.csv: \d rows?, 1 texture\. " + next_one, said.out)


def test_import__brackets_are_the_increment(run):
    assert run("run.dat", "--deck", "run.inp", *RUN, "--brackets", "-o", "t.csv").code == 0
    row = rb.read_table("t.csv").frame.iloc[0]
    assert (row["p_over_E_lower"], row["p_over_E"]) == (
        pytest.approx(0.004, rel=1e-6),
        pytest.approx(0.0045, rel=1e-6),
    )


def test_import__dry_run_writes_nothing(run):
    before = sorted(Path().iterdir())
    said = run("run.dat", "--deck", "run.inp", *RUN, "--dry-run")
    assert said.code == 0
    assert "kept: " in said.out
    assert sorted(Path().iterdir()) == before


def test_import__of_a_table_takes_columns_and_units(run):
    words = ("mine.csv", *MAP, "--R", "8 mm", "--E", "60 kPa", "--nu", NU, "--role", "held-out")
    said = run(*words, "-o", "t.csv")
    assert said.code == 0
    assert said.out.endswith("t.csv: 2 rows, 1 texture.\n")  # nothing that a run could fit
    frame = rb.read_table("t.csv").frame
    assert frame[["a_over_R", "b_over_R"]].to_numpy().tolist() == [[0.03, 0.01]] * 2
    # P / (2 R E) with 0.94 N/m, 16 mm and 60 kPa.
    assert frame["p_over_E"].iloc[0] == pytest.approx(0.94 / 0.016 / 60e3, rel=1e-15)
    assert set(frame["role"]) == {"held-out"}
    assert set(frame["nu"]) == {NU}


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("run.dat", "-o", "t.csv"), ["--texture: missing", "A,B"]),
        (
            ("alone.dat", "-o", "t.csv"),
            ["--deck: missing", "--surface: missing", "--reaction: missing", "--nu: missing"],
        ),
        (
            ("alone.dat", "-o", "t.csv"),
            ["import alone.dat -o t.csv --texture '?,?' --nu '?' --deck '?.inp' --surface '?'"],
        ),
        (("run.dat", "--deck", "run.inp", *RUN, "--nu", "0.5", "-o", "t.csv"), ["has nu = 0.49"]),
        (("run.dat", "--deck", "run.inp", *RUN, "--E", "2", "-o", "t.csv"), ["has E = 1"]),
        (("run.dat", "--deck", "run.inp", *RUN, "--E", "2 kPa", "-o", "t.csv"), ["plain number"]),
        (("run.dat", "--deck", "no.inp", *RUN, "-o", "t.csv"), ["no.inp: no such file"]),
        (("run.dat", "--deck", "run.inp", *RUN, "--sheet", "A", "-o", "t.csv"), ["--sheet: not"]),
        (("run.dat", "--deck", "run.inp", *RUN, "--symmetry", "x", "-o", "t.csv"), ["half or"]),
        (("run.dat", "mine.csv", "-o", "t.csv"), ["2 files of format calculix"]),
        (
            ("mine.csv", *MAP, "--deck", "run.inp", "-o", "t.csv"),
            ["--deck: not used by format table"],
        ),
        (("mine.csv", *MAP, "--format", "marc", "-o", "t.csv"), ["--format marc", "calculix"]),
        (("mine.csv", "--closed-is", "2;3", "-o", "t.csv"), ["--closed-is 2;3: expected whole"]),
        (
            ("mine.csv", *MAP),
            ["R is missing", "E is missing", "-o mine-table.csv --R '? mm' --E '? kPa'"],
        ),
        (
            ("mine.csv", *MAP, "--R", "8 mm", "--E", "60 kPa"),
            ["-o: missing", "--dry-run", "import mine.csv -o mine-table.csv --R '8 mm'"],
        ),
        (("mine.csv", "--count-is", "lands", "-o", "t.csv"), ["--count-is lands: expected edges"]),
        (("mine.csv", "--decimal", ".", "-o", "t.csv"), ["--decimal .: expected point, comma"]),
        (("mine.csv", "--header-row", "9", "-o", "t.csv"), ["--header-row 9"]),
        (("run.inp", "-o", "t.csv"), ["its format is not recognised"]),
        (("no.csv", "-o", "t.csv"), ["no.csv: no such file"]),
        (("mine.csv", "--loads", "1;2", "-o", "t.csv"), ["--loads '1;2'", "commas"]),
    ],
)
def test_import__what_cannot_be_is_refused(run, words, expected):
    before = sorted(Path().iterdir())
    said = run(*words)
    assert said.code == 2
    assert said.err.startswith("ridgebayes: ")
    assert "Traceback" not in said.err
    for text in expected:
        assert text in said.err
    assert sorted(Path().iterdir()) == before


def test_import__of_a_run_takes_nu_and_sets_from_the_deck_beside_it(run):
    said = run("run.dat", "--texture", f"{A},{B}", "-o", "t.csv")
    assert said.code == 0
    assert "run.inp: deck = run.inp, nu = 0.49, surface = NARC, reaction = NTOP" in said.out
    with_all = run("run.dat", "--deck", "run.inp", *RUN, "-o", "u.csv")
    assert with_all.code == 0
    assert Path("t.csv").read_bytes() == Path("u.csv").read_bytes()


def test_import__writes_a_map_to_start_from_that_works_when_filled_in(run):
    said = run("mine.csv", *MAP, "--write-map", "m.toml")
    assert said.code == 2
    assert "m.toml: a map to start from" in said.err
    text = Path("m.toml").read_text()
    assert 'R = "? mm"  # fill in' in text
    Path("m.toml").write_text(text.replace("? mm", "8 mm").replace("? kPa", "60 kPa"))
    assert run("mine.csv", "--map", "m.toml", "-o", "t.csv").code == 0
    assert rb.read_table("t.csv").textures == ((0.03, 0.01),)


def test_import__interpolated_counts_lie_in_the_middle_of_their_increments(run):
    steps = (f"0.03,0.01,{i / 1000},{2 + 2 * (i // 4)}\n" for i in range(1, 12))
    loads = "".join(step * (1 + i % 3) for i, step in enumerate(steps))  # some loads are held
    Path("steps.csv").write_text("a/R,b/R,p/E,ridges\n" + loads)
    assert run("steps.csv", "-o", "t.csv").code == 0
    frame = rb.read_table("t.csv").frame
    assert frame["p_over_E_lower"].tolist() == [0.003, 0.007]
    assert frame["p_over_E"].tolist() == [0.004, 0.008]
    assert run("steps.csv", "--interpolate", "-o", "u.csv").code == 0
    frame = rb.read_table("u.csv").frame
    assert frame["p_over_E"].tolist() == [0.0035, 0.0075]
    # A uniform distribution over the increment.
    np.testing.assert_allclose(frame["rel_se"], 0.001 / np.sqrt(12) / frame["p_over_E"], rtol=1e-12)


def test_import__skipped_rows_and_header_row_say_where_the_table_is(run):
    Path("two.csv").write_text("Q,Ridge,x\n1,2,3\n4,5,6\n\n" + TABLE.replace("Ridge", "w"))
    words = ("two.csv", "--map", "a=w [um]", "--R", "8 mm", "--E", "60 kPa", "-o", "t.csv")
    for option in (("--skip-rows", "4"), ("--header-row", "5")):
        assert run(*words, *option, "--force").code == 0
        assert rb.read_table("t.csv").textures == ((0.03, 0.01),)


def test_export_deck__says_how_to_import_it(command):
    Path("my.toml").write_text(SCENE.replace("0.006", '"lognormal(0.006, 5 %)"'))
    said = command("export-deck", "my.toml", "-o", "my.inp", "--edges", "4")
    assert (said.code, said.err) == (0, "")
    assert re.match(r"my\.inp: \d+ elements, \d+ levels, R = 1, E = 1\n", said.out)
    assert (
        "ridgebayes import my.dat --deck my.inp --surface NARC --reaction NTOP "
        f"--texture {A},{B} --nu {NU} -o TABLE.csv\n"
        "medians are taken of load.p_over_E\n" in said.out
    )
    assert Path("my.inp").read_text().startswith("** soft cylinder on rigid ridges")
    again = command("export-deck", "my.toml", "-o", "my.inp")
    assert (again.code, "exists" in again.err) == (2, True)


@pytest.mark.parametrize(
    ("change", "words", "expected"),
    [
        (("0.49", "0.5"), (), "my.toml: nu = 0.5: expected at most 0.499 for CalculiX"),
        (("", ""), ("--format", "ansys"), "my.toml: --format ansys: expected calculix or abaqus"),
        (("[load]", "offset = 0.2\n[load]"), (), "my.toml: offset = 0.2"),
    ],
)
def test_export_deck__what_cannot_be_is_refused(command, change, words, expected):
    Path("my.toml").write_text(SCENE.replace(*change) if change[0] else SCENE)
    said = command("export-deck", "my.toml", "-o", "my.inp", *words)
    assert said.code == 2
    assert expected in said.err
    assert not Path("my.inp").exists()


def test_export_deck__a_file_of_another_kind_is_refused(command):
    said = command("export-deck", "my.toml", "-o", "my.xlsx")
    assert (said.code, said.out) == (2, "")
    assert "my.xlsx: expected a file name that ends in .inp, got '.xlsx'" in said.err
