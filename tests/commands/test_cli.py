"""Commands as a person types them: exit codes, what is said, and what is (not) written."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import meshio
import numpy as np
import pandas as pd
import pytest
import xarray as xr

import ridgebayes as rb
from ridgebayes import drawing
from ridgebayes.comparison.bands import bands_table
from ridgebayes.friction.files import write_inputs
from ridgebayes.table.datafiles import PAPER_SWEEP, data_path

# Ends at its first check, where no autocorrelation time can have settled: never converged.
QUICK = rb.SampleSettings(n_walker=16, n_step_max=100)
SWEEP = data_path(PAPER_SWEEP)
HEADER = "a_over_R,b_over_R,Q,p_over_E\n"
AT = ("--texture", "0.022,0.02")
OVER = ("--p-over-E", "0.001:0.02:5")


@pytest.fixture(scope="module", autouse=True)
def _two_prior_scales():
    """Two prior scales say as much here as all, in less than half of the time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            "ridgebayes.evidence.prior_sensitivity.scale_factors", lambda prior: (1.0, 1.8)
        )
        yield


def everything(folder=Path()):
    """Return every file and folder with its content, hidden ones too."""
    return {path: path.read_bytes() if path.is_file() else None for path in folder.rglob("*")}


@pytest.fixture
def refused(command):
    """Check that a command exits 2 with one message holding some words, and writes nothing."""

    def check(words, *expected):
        before = everything()
        said = command(*words)
        assert said.code == 2, said
        assert said.out == ""
        assert "Traceback" not in said.err
        if "Usage:" in said.err:
            assert said.err.count("─ Error ─") == 1
        else:
            assert said.err.count("ridgebayes: ") == 1
        for part in expected:
            assert part in said.err
        assert everything() == before
        return said.err

    return check


@pytest.fixture
def quick(monkeypatch):
    """Make sampling short: enough where convergence does not matter."""
    monkeypatch.setattr(
        "ridgebayes.inference.presets.Preset.settings", property(lambda self: QUICK)
    )


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A run folder of two forms."""
    folder = tmp_path_factory.mktemp("finished") / "run"
    forms = ["modified", "classic"]
    rb.run(SWEEP, folder, forms=forms, noise="iid", settings=QUICK, command="compare")
    return folder


@pytest.fixture
def run(finished, tmp_path):
    """A copy that a test may damage, in the working folder."""
    shutil.copytree(finished, tmp_path / "run")
    return Path("run")


# --- bad tables -----------------------------------------------------------------------------------

BAD_TABLES = {  # of each kind of refusal; `tests/table` has the others
    "missing column": (
        "a_over_R,b_over_R,Q\n0.01,0.02,4\n",
        ["header", "missing column p_over_E", "'a_over_R', 'b_over_R', 'Q'"],
    ),
    "text in a number": (
        HEADER + "0.01,0.02,4,0.001\n0.01,wide,6,0.004\n",
        ["row 2", "(line 3)", "b_over_R = 'wide'", "must be a number"],
    ),
    "another encoding": ((HEADER + "0.01,0.02,4,0.001\n").encode("utf-16"), ["not UTF-8"]),
    "a lateral offset": (
        HEADER[:-1] + ",offset_over_R\n0.01,0.02,4,0.001,0.002\n",
        ["row 1: offset_over_R: expected 0, got 0.002", "this version fits only centred bodies"],
    ),
    "nothing to fit": (
        HEADER[:-1] + ",role\n0.01,0.02,4,0.001,held-out\n",
        ["expected a row with role calibration and status ok, got none"],
    ),
}


@pytest.mark.parametrize("name", BAD_TABLES)
@pytest.mark.parametrize(
    "words",
    [
        ("fit", "mine.csv", "--form", "hybrid"),
        ("compare", "mine.csv", "-o", "out"),
        ("run", "--table", "mine.csv", "-o", "out"),
    ],
    ids=["fit", "compare", "run"],
)
def test_table__every_bad_one_is_refused(refused, words, name):
    content, expected = BAD_TABLES[name]
    Path("mine.csv").write_bytes(content if isinstance(content, bytes) else content.encode())
    refused(words, "mine.csv", *expected)


# --- bad options ----------------------------------------------------------------------------------

IID = ("--noise", "iid")
FIT = ("fit", SWEEP, *IID, "--form")
COMPARE = ("compare", SWEEP, *IID)


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ((*FIT, "quadratic"), ["form 'quadratic': unknown", "classic, power-law, modified"]),
        ((*COMPARE, "--forms", "hybrid,,classic"), ["--forms 'hybrid,,classic': an empty name"]),
        ((*FIT, "half-plane"), ["41 calibration rows have solver 'half-plane'", "circular"]),
        ((*FIT, "hybrid", "--noise", "loud"), ["noise 'loud'", "expected STRUCTURE"]),
        *(
            ((*FIT, "hybrid", "--noise", name), [f"noise {name!r}", "expected STRUCTURE"])
            for name in ("", "IID", "iid+iid", "step+texture", "iid:", "auto:student", "iid,step")
        ),
        (
            (*FIT, "hybrid", "--noise", "step+series"),
            ["noise 'step+series'", "two series", "got one"],
        ),
        *(
            ((*COMPARE, "--time-limit", value), ["time_limit: expected finite and > 0, got"])
            for value in ("0", "-1", "nan", "inf")
        ),
        (("run", "--time-limit", "soon"), ["--time-limit", "valid number"]),
        *(
            ((*COMPARE, "--prior-odds", text), [f"--prior-odds {text!r}", "expected FORM=NUMBER"])
            for text in ("hybrid", "hybrid=", "=2", "hybrid=two", "hybrid=1,hybrid=2", "hybrid=nan")
        ),
        ((*COMPARE, "--prior-odds", "cubic=2"), ["prior odds: expected forms", "got 'cubic'"]),
        ((*FIT, "hybrid", "--prior-odds", "hybrid=2"), ["No such option"]),
        (("run", "--priors", "none.toml"), ["none.toml: no such file"]),
        ((*COMPARE, "--priors", "."), [".: is not a file"]),
        ((*FIT, "hybrid", "--seed", "-1"), ["--seed", "0"]),
        ((*COMPARE, "--seed", "1.5"), ["--seed", "integer"]),
        (("fit", SWEEP), ["Missing option '--form'"]),
        (("fit",), ["Missing argument"]),
        (("weigh",), ["No such command 'weigh'"]),
        (("run", "--colour", "red"), ["No such option", "--colour"]),
    ],
)
def test_options__bad_ones_are_refused(refused, words, expected):
    refused(words, *expected)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("[hybrid]\nc3 = 'normal(0, 1)'", "[hybrid]: expected one of c1, c2, got 'c3'"),
        ("[classic]\nc = 'empirical(rows.csv, b)'", "row 3, b: expected a finite number, got 'x'"),
    ],
)
@pytest.mark.parametrize("words", [COMPARE, ("run", *IID)], ids=["compare", "run"])
def test_priors__a_bad_file_is_refused_in_one_line(refused, words, text, expected):
    Path("p.toml").write_text(text)
    Path("rows.csv").write_text("a,b\n1,2\n3,x\n")
    err = refused((*words, "--priors", "p.toml"), "p.toml", expected)
    assert len(err.splitlines()) == 1


TEXTURES = ["0.01;0.02", "0.01", "0.01,0.02,0.03", "a,b", "", "-0.01,0.02", "0,0.02", "nan,0.02"]
TEXTURES += ["0.2 mm,0.02", "0.2 mm:0.16 mm"]


@pytest.mark.parametrize("text", TEXTURES)
def test_texture__typed_wrongly_is_refused(refused, run, text):
    told = (f"--texture {text!r}", "expected ")
    refused(["generate", "--texture", text, "-o", "t.csv"], *told)
    refused(["predict", run, "--texture", text, *OVER, "-o", "b.csv"], *told)


LOADS = ["", "0", "inf", "a:b:c", "0.001:0.02", "0:0.02:5", "0.02:0.001:5", "0.001:0.02:0"]
LOADS += ["0.001:0.02:2.5", "0.001:0.02:5:6", "0.001:inf:5", "nan:0.02:5", "log:0.001:0.02"]


@pytest.mark.parametrize("text", LOADS)
def test_loads__typed_wrongly_are_refused(refused, run, text):
    words = ["predict", run, *AT, "--p-over-E", text, "-o", "b.csv"]
    refused(words, f"--p-over-E {text!r}", "expected one load, LO:HI:N or log:LO:HI:N", "0.0")


# --- bad places -----------------------------------------------------------------------------------


@pytest.mark.parametrize("words", [(*FIT, "hybrid"), COMPARE, ("run",)])
def test_output__an_existing_one_needs_force(refused, run, words):
    refused([*words, "-o", "run"], "run: exists", "--force")


@pytest.mark.parametrize("words", [(*FIT, "hybrid"), COMPARE, ("run",)])
def test_output__force_leaves_what_is_no_run_untouched(refused, words):
    Path("thesis").mkdir()
    Path("thesis/chapter.tex").write_text("years of work")
    Path("letter").write_text("mine")
    for name in ("thesis", "letter"):
        refused([*words, "-o", name, "--force"], f"{name}: not a run folder (no run.json in it)")


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("nowhere", "no such folder"),
        ("thesis", "not a run folder, no run.json in it"),
        ("letter", "is a file"),
        ("checked", "written by ridgebayes coverage, not a run"),
        ("begun", "the run is not finished, its parts are in .begun.partial; continue it with --r"),
        (".begun.partial", "the run is not finished, its parts are in .begun.partial"),
        (".", "not a run folder, no run.json in it"),
        ("/", "not a run folder, no run.json in it"),
    ],
)
def test_run_folder__what_is_none_is_refused(refused, name, why):
    Path("checked").mkdir()
    Path("checked/coverage.json").write_text("{}")
    Path(".begun.partial").mkdir()
    Path("thesis").mkdir()
    Path("thesis/chapter.tex").write_text("years of work")
    Path("letter").write_text("mine")
    told, rule = why, "expected a folder written by ridgebayes run"
    refused(["predict", name, *AT, *OVER, "-o", "b.csv"], told, rule)
    refused(["report", name], told)


# --- generate -------------------------------------------------------------------------------------

SCENE = "[texture]\nridge_width = 0.02\ngroove_width = 0.02\n"


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("no.toml",), ["no.toml", "No such file"]),
        (
            ("my.toml", "--texture", "0.01,0.02"),
            ["SCENE and --texture", "expected only one of the two"],
        ),
        (("--texture", "0.02,0.02", "--p-max", "nan"), ["p_over_E = nan", "finite"]),
        (("--texture", "0.02,0.02", "--p-max", "-1"), ["p_over_E = -1.0", "greater than 0"]),
        (("--texture", "0.02,0.02", "--p-max", "1e-9"), ["no transition under p/E = 1e-09"]),
        (("--texture", "0.02,0.02", "--nu", "0.7"), ["nu = 0.7", "0.5"]),
        (("--texture", "0.02,0.02", "--tol", "0"), ["rel_tol = 0.0", "(0, 0.1]"]),
        (("--texture", "0.02,0.02", "--solver", "magic"), ["solver = 'magic'", "half-plane"]),
    ],
)
def test_generate__bad_options_are_refused(refused, words, expected):
    Path("my.toml").write_text(SCENE)
    refused(["generate", *words, "-o", "t.csv"], *expected)


@pytest.mark.parametrize("words", [(), ("--nu", "0.4"), ("--p-max", "0.01")])
def test_generate__nothing_named_is_the_embedded_sweep(command, paper, words):
    said = command("generate", *words, "-o", "t.csv")
    unused = "ridgebayes: warning: --p-max and --nu have no effect without --texture\n"
    assert (said.code, said.err) == (0, unused if words else "")
    assert said.out == "t.csv: 44 rows, 10 textures\n"
    table = rb.read_table("t.csv")
    np.testing.assert_allclose(  # algebra: rounding of another machine's linear solver
        table.column("p_over_E"), paper.column("p_over_E"), rtol=1e-12
    )
    assert everything().keys() == {Path("t.csv")}


def test_generate__textures_and_options_reach_the_solver(command):
    textures = ("--texture", "0.02,0.02", "--texture", "0.03,0.01")
    options = ("--p-max", "0.01", "--nu", "0.3", "--solver", "hertz")
    assert command("generate", *textures, *options, "-o", "t.csv").code == 0
    frame = rb.read_table("t.csv").frame
    assert rb.read_table("t.csv").textures == ((0.02, 0.02), (0.03, 0.01))
    assert set(frame["nu"]) == {0.3}
    assert set(frame["solver"]) == {"hertz"}
    assert 0.005 < frame["p_over_E"].max() <= 0.01


def test_generate__rows_that_failed_are_written_and_exit_1(command, paper, monkeypatch):
    frame = paper.frame
    failed = frame.index.isin([2, 3, 4])
    frame["status"] = frame["status"].mask(failed, "tolerance not reached")
    frame["p_over_E"] = frame["p_over_E"].mask(failed)
    partly = rb.ContactTable.from_frame(frame)
    monkeypatch.setattr("ridgebayes.simulate.generation.generate", lambda *_, **__: partly)
    said = command("generate", "-o", "t.csv")
    assert said.code == 1
    assert said.out == "t.csv: 44 rows, 10 textures\n"
    assert said.err == "ridgebayes: 3 rows are not ok, see column status of t.csv\n"
    assert rb.read_table("t.csv").digest() == partly.digest()


ELEMENTS = ("--texture", "0.06,0.02", "--p-max", "0.004", "--solver", "cylinder-fe")


def test_generate__fields_of_the_cylinder_are_kept(command):
    said = command("generate", *ELEMENTS, "--fields", "found", "-o", "t.csv")
    assert (said.code, said.err) == (0, "")
    label = "a0.06_b0.02"
    names = {"loads.csv", f"contact-{label}.csv"}
    names |= {f"fields-{label}{suffix}" for suffix in (".xdmf", ".h5")}
    names |= {f"deformed-{label}{suffix}" for suffix in (".png", ".svg")}
    assert {path.name for path in Path("found").iterdir()} == names
    assert Path("found/loads.csv").read_bytes() == Path("t.csv").read_bytes()
    contact = pd.read_csv(f"found/contact-{label}.csv")
    (load,) = rb.read_table("t.csv").frame["p_over_E"]
    assert contact["p_over_E"].unique().tolist() == [load]
    # Balance: half the line load over E R, in the body's right half; the solver's tolerance.
    pushed = (contact["pressure"] * contact["length"] * contact["normal_y"]).sum()
    assert pushed == pytest.approx(load, rel=1e-8)
    with meshio.xdmf.TimeSeriesReader(f"found/fields-{label}.xdmf") as series:
        series.read_points_cells()
        assert series.num_steps == 1
        assert series.read_data(0)[0] == load
    assert command("generate", *ELEMENTS, "--fields", "found", "-o", "u.csv").code == 2


def test_generate__fields_without_finite_elements_are_refused(refused):
    words = ("--texture", "0.06,0.02", "--fields", "found", "-o", "t.csv")
    refused(["generate", *words], "--fields found", "use --solver cylinder-fe")


# --- what is done ---------------------------------------------------------------------------------


def test_fit__done_is_exit_0_and_says_the_coefficients(command):
    said = command(*FIT, "modified", "-o", "out")
    assert said.code == 0
    assert said.out.startswith("out: 41 rows fitted, 3 held out.\n")
    assert "modified, error model iid, drawn by importance: converged\n" in said.out
    assert re.search(r"^c +1\.37\d\d +0\.003\d +1\.3\d{3} to 1\.3\d{3}$", said.out, flags=re.M)
    files = "evidence.csv, posterior-modified.nc, run.json, summary.csv, table.csv"
    assert said.out.endswith(f"\nWritten: out: {files}\n")
    assert all(re.fullmatch(r".+: \d+\.\d\d s", line) for line in said.err.splitlines())
    assert ", ".join(sorted(path.name for path in Path("out").iterdir())) == files
    assert everything(Path("out")).keys() == everything().keys() - {Path("out")}


def test_fit__unconverged_writes_its_files_and_exits_1(command, quick):
    said = command(*FIT, "modified")
    assert said.code == 1
    assert "Traceback" not in said.err
    last = said.err.splitlines()[-1]
    assert last.startswith("ridgebayes: modified did not converge: walk: c: ")
    assert "NOT converged" in said.out
    fit = rb.read_run(Path("ridgebayes-out")).fits["modified"]  # the default folder
    assert not fit.converged
    assert all(reason in last for reason in fit.convergence_failures)


def test_compare__done_is_exit_0_and_prints_verdict_and_coefficients(command):
    words = (*COMPARE, "--forms", "modified, hybrid", "--seed", "4", "-o", "out")
    said = command(*words, "--accuracy", "quick", "--verbose")
    assert said.code == 0
    assert "strong for hybrid (Kass & Raftery); rows are not independent" in said.out
    assert "The evidence supports Hybrid among the forms compared. " in said.out
    assert "Grade: supports." in said.out
    assert re.search(r"^hybrid +c1 +1\.33\d+ ", said.out, flags=re.M)
    content = json.loads(Path("out/run.json").read_text())
    assert content["seed"] == 4
    assert content["forms"] == ["modified", "hybrid"]
    assert content["verdicts"]["complete"] is True


def test_compare__prior_odds_are_in_words_in_run_json_and_in_the_tables(command):
    words = (*COMPARE, "--forms", "modified,hybrid", "--prior-odds", "modified=200, hybrid = 2")
    said = command(*words, "--accuracy", "quick", "-o", "out")
    assert said.code == 0
    assert "The evidence supports Hybrid among the forms compared. " in said.out
    told = "Probabilities are at prior probabilities of your own, Modified 0.990 and Hybrid 0.0099."
    assert told in said.out
    content = json.loads(Path("out/run.json").read_text())
    assert content["options"]["prior_odds"] == {"modified": 200, "hybrid": 2}
    assert content["verdicts"]["best"] == "modified"
    assert content["verdict"]["form"] == "hybrid"
    prior = content["verdicts"]["prior_probabilities"]
    assert prior == pytest.approx({"modified": 200 / 202, "hybrid": 2 / 202}, rel=1e-14)
    again = rb.read_run(Path("out"))
    assert again.prior_probabilities == pytest.approx(prior, rel=1e-14)
    assert again.probabilities == pytest.approx(content["verdicts"]["probabilities"], rel=1e-14)


def perfect(path):
    """Write rows that Modified makes without misfit: its sigma runs to zero."""
    rows = [
        {"a_over_R": a, "b_over_R": b, "Q": q, "p_over_E": float(rb.Modified().load(q, a, b))}
        for a, b in [(0.012, 0.01), (0.022, 0.02), (0.032, 0.03)]
        for q in (4, 6, 8)
    ]
    pd.DataFrame(rows).to_csv(path, index=False)


def test_compare__a_form_that_fails_is_named_and_the_rest_kept(command, quick):
    perfect("perfect.csv")
    said = command("compare", "perfect.csv", *IID, "--forms", "classic,modified", "-o", "out")
    assert said.code == 1
    assert "modified failed: modified: the form reproduces all rows" in said.err
    assert "Traceback" not in said.err
    assert Path("out/posterior-classic.nc").is_file()
    assert not Path("out/posterior-modified.nc").exists()
    content = json.loads(Path("out/run.json").read_text())
    assert list(content["verdicts"]["failures"]) == ["modified"]
    assert set(pd.read_csv("out/evidence.csv")["form"]) == {"classic"}
    assert command("predict", "out", *AT, *OVER, "-o", "b.csv").code == 0


def test_rows_that_are_not_ok__are_counted_aloud(command, quick, paper):
    frame = paper.frame
    frame["status"] = frame["status"].mask(frame.index == 3, "diverged")
    rb.ContactTable.from_frame(frame).write("mine.csv")
    said = command("compare", "mine.csv", *IID, "--forms", "modified", "-o", "out")
    assert "mine.csv: 1 row is not ok and not fitted" in said.out
    assert "out: 40 rows fitted, 3 held out." in said.out


def test_run__passes_every_option_on(command, monkeypatch, finished):
    asked = {}

    def run(**wanted):
        asked.update(wanted)
        return rb.read_run(finished)

    monkeypatch.setattr("ridgebayes.commands.run.run", run)
    words = ("--table", "t.csv", "--forms", "classic,hybrid", "--noise", "iid", "--seed", "7")
    words += ("--workers", "3", "--scheduler", "tcp://host:1", "--prior-odds", "Hybrid=2")
    said = command("run", *words, "--force", "--resume", "-o", "out")
    assert asked.pop("began") > 0
    assert asked == {
        "folder": Path("out"),
        "table": Path("t.csv"),
        "forms": ["classic", "hybrid"],
        "noise": "iid",
        "rng": 7,
        "force": True,
        "resume": True,
        "accuracy": "standard",
        "priors": None,
        "prior_odds": {"hybrid": 2.0},
        "time_limit": None,
        "workers": 3,
        "scheduler": "tcp://host:1",
    }
    assert said.code == 1  # those fits were short
    assert f"read {Path('out/report.html')}" in said.out


def test_report__is_written_again(command, monkeypatch, run):
    asked = []
    monkeypatch.setattr(
        "ridgebayes.commands.run.write_pages",
        lambda *galleries, folder, command: asked.append((galleries, folder, command)),
    )
    said = command("report", run)
    assert said.code == 0
    assert said.out.startswith(f"read {run / 'report.html'}\n")
    ((galleries, folder, line),) = asked
    assert (len(galleries), folder) == (1, run)
    assert line.startswith("ridgebayes ")


# --- predict --------------------------------------------------------------------------------------


def test_predict__is_the_table_of_the_library(command, run):
    words = ("--texture", "0.022,0.02", "--texture", "0.012,0.09", "--nu", "0.4", "--prob", "0.5")
    said = command("predict", run, *words, *OVER, "--form", "classic", "-o", "b.csv")
    assert said.code == 0
    expected = bands_table(
        rb.read_run(run),
        textures=[(0.022, 0.02), (0.012, 0.09)],
        loads=np.linspace(0.001, 0.02, 5),
        nu=0.4,
        forms=["classic"],
        prob=0.5,
        kinds=["simulation"],
    )
    # Bit for bit: floats are written in full.
    assert Path("b.csv").read_text() == expected.to_csv(index=False, lineterminator="\n")
    n_outside = int(expected["extrapolation"].sum())
    first, *lines = said.out.splitlines()
    told = "error of probabilities up to 0.005 (from the number of draws)"
    assert first == f"b.csv: 10 rows; {told}"
    assert len(lines) == 1 + 10
    for line, row in zip(lines[1:], expected.to_dict("records"), strict=True):
        low, high = row["q_lower"], row["q_upper"]
        cells = [f"{row['p_over_E']:.4g}", f"{row['q_median']}"]
        cells += [f"{low}" if low == high else f"{low} to {high}", row["extrapolation_of"]]
        assert line.split(maxsplit=2)[2].split() == " ".join(cells).split()
    assert 0 < n_outside <= 10
    # Once, of all rows; 0.02 at nu = 0.4 is 0.0224 at one half.
    assert said.err == (
        f"ridgebayes: warning: {n_outside} of 10 rows lie beyond the calibrated range of "
        "load, a/pitch, b/R\n"
    )


@pytest.mark.parametrize(
    ("kind", "kinds"),
    [("curve", ["curve"]), (None, ["simulation"]), ("both", ["curve", "simulation"])],
)
def test_predict__writes_a_row_a_texture_and_load_of_each_kind(command, run, kind, kinds):
    words = ("predict", run, *AT, "--p-over-E", "0.01", "-o", "b.csv")
    assert command(*words, *(("--kind", kind) if kind else ())).code == 0
    rows = pd.read_csv("b.csv")
    assert rows["kind_of_band"].tolist() == kinds
    defaults = rows[["form", "nu", "prob"]].drop_duplicates().to_numpy().tolist()
    assert defaults == [["average", 0.5, 0.9]]
    # Lengths in um, and a ridge as wide as the radius.
    for texture, n_told in (("40,30", 1), ("1,1", 0)):
        said = command(*words[:2], "--texture", texture, *words[4:], "--force")
        assert said.err.count("without units widths are shares") == n_told
        assert "warning: 1 of 1 row lies beyond the calibrated range of a/R, b/R" in said.err


def test_predict__takes_units_of_a_body_or_of_a_scene(command, run):
    Path("my.toml").write_text(
        '[body]\nradius = "8 mm"\nyoungs_modulus = "60 kPa"\npoissons_ratio = 0.4\n'
        '[texture]\nridge_width = "0.2 mm"\ngroove_width = "0.16 mm"\n'
        '[load]\nforce = "0.192 N"\nlength = "20 mm"\n'
    )
    plain = ("--texture", "0.025,0.02", "--p-over-E", "0.01", "--nu", "0.4")
    body = ("--R", "8 mm", "--E", "60 kPa", "--texture", "0.2 mm,0.16mm", "--nu", "0.4")
    scene = ("--scene", "my.toml")
    words = {
        "plain": plain,
        "pressure": (*body, "--load", "0.6 kPa"),
        "line": (*body, "--load", "9.6 N/m"),
        "scene": scene,  # its textures, at its highest load
        "force": (*scene, "--load", "0.192 N"),
        "one-load": (*scene, "--texture", "0.025,0.02", "--p-over-E", "0.01"),
    }
    found = {}
    for name, given in words.items():
        assert command("predict", run, *given, "-o", f"{name}.csv").code == 0
        found[name] = Path(f"{name}.csv").read_bytes()
    assert set(found.values()) == {found["plain"]}
    shape = 'corner_radius = "0.1 mm"\ngroove_depth = "0.2 mm"\n[load]\nfriction = 0.3'
    Path("round.toml").write_text(Path("my.toml").read_text().replace("[load]", shape))
    design = ("design", run, "--goal", "P(Q >= 4) >= 0.9", *SIZES)
    shape = f'offset = "uniform(-0.5, 0.5)"\n{shape}'  # its median is no offset
    Path("askew.toml").write_text(Path("my.toml").read_text().replace("[load]", shape))
    for words, scene, more in ((("predict", run), "round", ""), (design, "askew", ", offset")):
        said = command(*words, "--scene", f"{scene}.toml", "-o", f"{words[0]}.csv")
        shown = f"corner_radius, friction, groove_depth{more} of the scene: no effect"
        assert said.err.count(shown) == said.err.count(f"warning: {shown}") == 1
    assert Path("predict.csv").read_bytes() == found["scene"]


UNSURE = ("--R", "8 mm", "--E", "60 kPa ± 20 %", "--thickness", "20 mm")


def test_predict__carries_an_error_as_typed_or_of_a_scene(command, run):
    Path("my.toml").write_text(
        '[body]\nradius = "8 mm"\nyoungs_modulus = "lognormal(60 kPa, 20 %)"\n'
        '[texture]\nridge_width = "0.3 mm"\ngroove_width = "0.25 mm"\n'
        '[load]\nforce = "0.35 N"\nlength = "20 mm"\n'
    )
    typed = (*UNSURE, "--texture", "0.3 mm,0.25 mm", "--load", "0.35 N")
    assert command("predict", run, "--scene", "my.toml", "-o", "scene.csv").code == 0
    assert command("predict", run, *typed, "-o", "typed.csv").code == 0
    scene, own = pd.read_csv("scene.csv"), pd.read_csv("typed.csv")
    # Reference: `friction` of the same scene, 0.14 of the draws; Monte Carlo.
    assert scene["p_q_ge_8"].iloc[0] == pytest.approx(0.15, abs=0.04)
    pd.testing.assert_frame_equal(scene, own)
    assert scene["load_unit"].tolist() == ["N"]


@pytest.mark.parametrize(
    ("load", "shown", "label"),
    [
        ('max = "1.2 kPa"', ["load in kPa", "1.2"], "= $p/E$ times 60 kPa"),
        ('max = "lognormal(1.2 kPa, 10 %)"', ["load in kPa", "1.2"], "$p/E$ times 60 kPa"),
        ('force = "0.384 N"\nlength = "20 mm"', ["load in N", "0.384"], "$p/E$ times 19.2 N"),
        ("p_over_E = 0.02", [], "$p/E$ (square-root scale)"),
    ],
)
def test_predict__shows_loads_in_the_unit_of_the_scene(
    command, run, monkeypatch, load, shown, label
):
    drawn = []
    monkeypatch.setattr(drawing.style, "as_bytes", lambda figure, _: drawn.append(figure) or b"")
    Path("my.toml").write_text(
        '[body]\nradius = "8 mm"\nyoungs_modulus = "60 kPa"\n'
        f'[texture]\nridge_width = "0.2 mm"\ngroove_width = "0.16 mm"\n[load]\n{load}\n'
    )
    said = command("predict", run, "--scene", "my.toml", "--plot", "b.png", "-o", "b.csv")
    head, row = (re.split(r"\s{2,}", line.strip()) for line in said.out.splitlines()[1:3])
    assert [line[head.index("p/E") + 1] for line in (head, row)][: len(shown)] == shown
    assert ("load in" in said.out) == bool(shown)
    (axes,) = (one for one in drawn[0].axes if one.get_visible())
    assert label in axes.get_xlabel()
    assert axes.get_xlim()[1] == pytest.approx(float(shown[1]) if shown else 0.02)


BAD_PREDICTIONS = [
    ((*AT, *OVER, "--prob", "2"), "prob: expected 0 < prob < 1, got 2.0"),
    ((*AT, *OVER, "--prob", "nan"), "prob: expected 0 < prob < 1, got nan"),
    ((*AT, *OVER, "--nu", "0.7"), "expected 0 <= nu <= 0.5"),
    ((*AT, *OVER, "--form", "hybrid"), "form 'hybrid': not in this run"),
    (OVER, "--texture"),
    (AT, "--p-over-E"),
    ((*AT, "--load", "1.2 kPa"), "--load '1.2 kPa': needs Young's modulus (--E, or"),
    ((*AT, "--E", "60 kPa", "--load", "5 N/m"), "--load '5 N/m': needs the radius (--R, or"),
    ((*AT, "--R", "8 mm", "--E", "6 kPa", "--load", "5 N"), "needs the body's length"),
    ((*AT, "--load", "3 mm"), "--load '3 mm': expected a number and a unit of a load"),
    ((*AT, "--load", "1,2 kPa"), "'1,2 kPa': has a decimal comma"),
    ((*AT, *OVER, "--E", "5 mm"), "--E '5 mm': must be a number and a unit of pressure"),
    ((*AT, *OVER, "--R", "0 mm"), "--R '0 mm': must be > 0"),
    ((*AT, *OVER, "--load", "1 kPa"), "--p-over-E and --load: expected only one of the two"),
    ((*AT, *OVER, "--scene", "a.toml", "--R", "8 mm"), "--scene, and --R or --E or"),
    ((*AT, *OVER, "--scene", "a.toml"), "a.toml: cannot be read"),
    ((*AT, *OVER, "--kind", "all"), "--kind 'all': expected curve, simulation or both"),
    ((*OVER, "--texture", "0.2 mm,0.2 mm"), "'0.2 mm': needs the radius; expected --R"),
    ((*AT, *OVER, "--plot", "b.jpg"), "b.jpg: expected a file name that ends in .png or"),
    ((*AT, *OVER, "--plot", "no/b.png"), "no/b.png: folder no does not exist"),
    ((*AT, *OVER, "--plot", "b.pdf", "--width", "8 mm"), "--width '8 mm': expected 50 to 1000"),
    ((*AT, *OVER, "--plot", "b.pdf", "--width", "85"), "--width '85': must be a number and a u"),
    ((*AT, *OVER, "--width", "85 mm"), "--width '85 mm': needs --plot"),
    ((*AT, "--R", "8 mm ± 5 %", "--load", "9 N/m"), "textures with units beside an uncertain"),
    ((*AT, *UNSURE), "no loads"),
    (("--texture", "3 mm,2 mm", *UNSURE[2:], "--load", "1 kPa"), "'3 mm': needs the radius"),
    ((*UNSURE, "--load", "1 kPa"), "no textures"),
    ((*AT, *UNSURE[2:], "--load", "9 N/m"), "needs the radius"),
    ((*AT, *UNSURE, "--load", "1 kPa:2 kPa ± 3 %:4"), "one load where it has an error"),
    ((*AT, *OVER, "-o", "b.xlsx"), "b.xlsx"),
    ((*AT, *OVER, "-o", "my.csv"), "my.csv: exists"),
]


@pytest.mark.parametrize(("words", "expected"), BAD_PREDICTIONS)
def test_predict__bad_options_are_refused(refused, run, words, expected):
    Path("my.csv").write_text("mine")
    refused(["predict", run, "-o", "b.csv", *words], expected)


def test_predict__writes_parquet_too(command, run):
    for name in ("b.csv", "b.parquet"):
        assert command("predict", run, *AT, *OVER, "-o", name).code == 0
    written = pd.read_parquet("b.parquet")
    pd.testing.assert_frame_equal(
        written, pd.read_csv("b.csv", keep_default_na=False), check_dtype=False
    )


@pytest.mark.parametrize("name", ["b.png", "b.svg", "b.pdf"])
def test_predict__draws_bands_as_wide_as_asked(command, run, name):
    words = ("predict", run, *AT, *OVER, "-o", "b.csv", "--plot", name, "--width", "85 mm")
    said = command(*words)
    assert said.code == 0
    assert said.out.endswith(f"Written: b.csv, {name}\n")
    assert Path(name).read_bytes().startswith((b"\x89PNG", b"<?xml", b"%PDF"))
    assert "exists" in command(*words).err
    for box in re.findall(rb"/MediaBox \[ 0 0 ([\d.]+)", Path(name).read_bytes()):
        assert float(box) == pytest.approx(85 / 25.4 * 72, rel=1e-6)


def test_predict__json_has_every_row_of_which_few_are_shown(command, run):
    shown = command("predict", run, *AT, "--p-over-E", "0.001:0.02:50", "-o", "a.csv").out
    assert ". 5 of the rows:\n" in shown
    assert len(shown.splitlines()) == 1 + 1 + 5
    said = command("predict", run, *AT, "--p-over-E", "0.001:0.02:50", "-o", "b.csv", "--json")
    rows = json.loads(said.out)["result"]
    frame = pd.read_csv("b.csv")
    assert list(rows[0]) == list(frame.columns)
    assert [row["p_over_E"] for row in rows] == frame["p_over_E"].tolist()
    assert "beyond the calibrated range" in json.loads(said.out)["messages"][-1]


# --- friction -------------------------------------------------------------------------------------

FINGER = """
[body]
radius = "8 mm"
youngs_modulus = "lognormal(60 kPa, 20 %)"
[texture]
ridge_width = "0.18 mm"
groove_width = "0.16 mm"
[load]
max = "0.9 kPa"
"""


@pytest.fixture
def finger(tmp_path):
    path = tmp_path / "finger.toml"
    path.write_text(FINGER)
    return path


def test_friction__is_what_the_library_draws(command, run, finger):
    words = ("friction", run, finger, "--n", 20, "--loads", 2, "--edges", "--seed", 5)
    said = command(*words, "-o", "x.nc", "--json")
    assert said.code == 0
    expected = rb.friction_inputs(rb.read_run(run), finger, 2, n=20, rng=5, edges=True)
    with xr.open_dataset("x.nc", engine="h5netcdf") as found:
        xr.testing.assert_equal(found, expected)
        assert "lognormal(60 kPa, 20 %)" in found.attrs["scene_distributions"]
    told = json.loads(said.out)
    assert told["files"] == ["x.nc"]
    means = [row["Q"] for row in told["result"]]
    np.testing.assert_allclose(means, expected["Q"].mean("draw"))
    write_inputs(expected, Path("y.csv"))
    assert command(*words, "-o", "x.csv").code == 0
    assert Path("x.csv").read_bytes() == Path("y.csv").read_bytes()


def test_friction__with_the_model_writes_bands_and_shares(command, refused, run, finger):
    words = ("friction", run, finger, "--n", 20, "--loads", 2, "--seed", 5, "--model")
    said = command(*words, "-o", "x.nc", "--json")
    assert said.code == 0
    drawn = rb.friction_inputs(rb.read_run(run), finger, 2, n=20, rng=5, edges=True)
    expected = rb.FrictionModel().predict(drawn, rng=5)
    told = json.loads(said.out)
    assert told["files"] == ["x.nc", "x-mu.csv", "x-mu-shares.csv"]
    pd.testing.assert_frame_equal(pd.DataFrame(told["result"]), expected.bands, check_dtype=False)
    pd.testing.assert_frame_equal(pd.read_csv("x-mu.csv"), expected.bands)
    pd.testing.assert_frame_equal(pd.read_csv("x-mu-shares.csv"), expected.shares)
    with xr.open_dataset("x.nc", engine="h5netcdf") as found:
        assert "edge" not in found.dims  # not asked for
    refused([*words, "-o", "x.csv"], "x-mu.csv: exists")


def test_friction__of_round_corners_leaves_interlocking_out_and_says_so(command, run, finger):
    finger.write_text(FINGER.replace("[load]", 'corner_radius = "50 um"\n[load]'))
    words = ("friction", run, finger, "--n", 20, "--loads", 2, "--model", "-o", "x.nc")
    said = command(*words)
    assert said.code == 0
    assert "bands without interlocking (kappa = 0): it needs sharp corners" in said.err
    drawn = rb.friction_inputs(rb.read_run(run), finger, 2, n=20, rng=0)
    expected = rb.FrictionModel(kappa=0).predict(drawn, rng=0)
    pd.testing.assert_frame_equal(pd.read_csv("x-mu.csv"), expected.bands)
    assert "interlocking" not in set(pd.read_csv("x-mu-shares.csv")["name"])


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("--loads", "3", "--p-over-E", "1:2:3"), "--p-over-E and --loads: expected only one"),
        (("--loads", "0"), "--loads"),
        (("-o", "x.txt"), "expected a file of .nc, .parquet, .csv"),
    ],
)
def test_friction__bad_options_are_refused(refused, run, finger, words, expected):
    words = words if "-o" in words else (*words, "-o", "x.nc")
    refused(["friction", run, finger, *words], expected)


# --- design ---------------------------------------------------------------------------------------

GOAL = "P(Q >= 8) >= 0.9"
SIZES = ("--a", "120 um:280 um", "--b", "80 um:240 um", "--step", "40 um")


@pytest.mark.long
def test_design__is_what_the_library_finds(command, run, finger):
    words = ("design", run, "--scene", finger, "--goal", GOAL, *SIZES)
    words += ("--tolerance", "5 um", "--objective", "max-pitch", "--seed", 5)
    said = command(*words, "-o", "d", "--json")
    assert said.code == 0
    expected = rb.design(
        rb.read_run(run),
        finger,
        GOAL,
        sizes={"a": (0.015, 0.035), "b": (0.01, 0.03), "step": 0.005},
        tolerance=f"{5 / 8_000}",
        objective="max-pitch",
        rng=5,
    )
    told, content = json.loads(said.out), json.loads(Path("d/design.json").read_text())
    assert told["result"]["recommended"] == content["recommended"] == expected.recommended
    assert content["check"] == expected.check
    names = ["design.html", "design.json", "design.png", "design.svg", "designs.csv"]
    assert told["files"] == [f"d/{name}" for name in names]
    pd.testing.assert_frame_equal(
        pd.read_csv("d/designs.csv", keep_default_na=False, na_values=[]), expected.designs
    )
    page = Path("d/design.html").read_text()
    assert "Recommended texture" in page
    assert expected.conditions in page
    assert "http" not in page
    before = Path("d/designs.csv").read_bytes()
    assert command(*words, "-o", "d").code == 2
    assert command(*words, "-o", "d", "--force").code == 0
    assert Path("d/designs.csv").read_bytes() == before


def test_design__a_goal_that_nothing_meets_is_no_failure(command, run, finger):
    words = ("design", run, "--scene", finger, "--goal", "P(Q >= 30) >= 0.9", *SIZES)
    said = command(*words, "-o", "d")
    assert said.code == 0
    assert "0 of 25 textures meet the goal; the nearest misses it by" in said.out
    assert "times the load" in said.out
    assert "beyond what was calibrated: Q" in said.err
    content = json.loads(Path("d/design.json").read_text())
    assert (content["feasible"], content["recommended"]) == (False, None)
    assert content["best"]["margin"] < 0
    assert "No texture meets the goal" in Path("d/design.html").read_text()


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("--goal", "Q >= 8"), "goal 'Q >= 8': expected one such as"),
        (("--goal", GOAL, "--goal", "P(Q <= 6) >= 0.9"), "contradict each other"),
        (("--goal", GOAL, "--b", "0.03"), "--b '0.03': expected LO:HI"),
        (("--goal", GOAL, "--a", "0.1 mm:0.3"), "expected two lengths with units, or two over R"),
        (("--goal", GOAL, "--step", "10 kg"), "--step '10 kg': must be a number and a unit"),
        (("--goal", GOAL, "--step", "wide"), "--step 'wide'"),
        (("--goal", GOAL, "--p-over-E", "1:2"), "loads: '1:2': expected one load, LO:HI:N"),
    ],
)
def test_design__bad_options_are_refused(refused, run, finger, words, expected):
    refused(["design", run, "--scene", finger, *words, "-o", "d"], expected)


def test_generate_and_plan__take_medians_and_say_so(command, finger):
    for words in (("generate", finger, "-o", "t.csv"), ("plan", finger)):
        said = command(*words)
        assert said.code == 0
        assert "medians are taken of body.youngs_modulus" in said.out


# --- the program itself ---------------------------------------------------------------------------


def test_interrupted__is_not_a_traceback(command, monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("ridgebayes.commands.run.run", interrupted)
    said = command("run")
    assert said.code == 130
    assert said.err == "ridgebayes: interrupted; continue run with --resume\n"


@pytest.mark.parametrize("name", ["compare", "cost", "coverage"])
def test_interrupted__what_has_no_resume_advises_none_and_leaves_nothing(
    command, monkeypatch, name
):
    def interrupted(*_, **__):
        assert list(Path().glob(".*.partial"))
        raise KeyboardInterrupt

    for inner in ("run.compared", "cost.cost", "coverage.coverage"):
        monkeypatch.setattr(f"ridgebayes.commands.{inner}", interrupted)
    said = command(name, SWEEP)
    assert said.code == 130
    assert said.err.splitlines()[-1] == "ridgebayes: interrupted"
    assert everything() == {}


@pytest.mark.parametrize("form", ["HYBRID", "Power law"])
def test_form__is_known_as_pages_write_it(command, form):
    said = command(*FIT, form, "--accuracy", "quick", "-o", "out")
    assert said.code == 0
    name = "power-law" if form.lower().startswith("p") else "hybrid"
    assert Path(f"out/posterior-{name}.nc").is_file()
    words = ("predict", "out", *AT, *OVER, "--form", form, "-o", "b.csv")
    assert command(*words).code == 0


def test_output__that_nobody_reads_to_its_end_is_no_failure(tmp_path):
    words = ["generate", "--texture", "0.02,0.02", "--p-max", "0.001"]
    code = "from ridgebayes.commands.cli import main; main()"
    nobody, into = os.pipe()
    os.close(nobody)  # as `| head` does when it has seen enough
    said = subprocess.run(
        [sys.executable, "-c", code, *words, "-o", tmp_path / "t.csv"],
        stdout=into,
        stderr=subprocess.PIPE,
        text=True,
    )
    os.close(into)
    assert said.returncode == 0
    assert "pipe" not in said.stderr
    assert (tmp_path / "t.csv").is_file()
