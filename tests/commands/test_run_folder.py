"""A run folder is whole or not there, holds what the contract says, and comes back as it was."""

import json
import shutil
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import ridgebayes as rb
from ridgebayes.commands.run_files import verdicts
from ridgebayes.commands.run_folder import new_folder, write_csv

QUICK = {"noise": "iid", "accuracy": "quick", "command": "compare", "workers": 1}


@pytest.fixture(scope="module")
def compared(paper, tmp_path_factory):
    """A comparison and its folder."""
    folder = tmp_path_factory.mktemp("runs") / "run"
    forms = ["classic", "power-law", "modified"]
    return rb.run(replace(paper, where="my table"), folder, forms=forms, **QUICK), folder


@pytest.fixture(scope="module")
def comparison(compared):
    return compared[0]


@pytest.fixture(scope="module")
def written(compared):
    return compared[1]


@pytest.fixture
def run(written, tmp_path):
    """A copy that a test may damage."""
    return shutil.copytree(written, tmp_path / "run")


def run_folder(path):
    path.mkdir()
    (path / "run.json").write_text("{}")
    (path / "old.csv").write_text("old")
    return path


def names(folder):
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*"))


# --- whole or not at all --------------------------------------------------------------------------


def test_new_folder__takes_its_name_when_all_is_done(tmp_path, monkeypatch):
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    with new_folder(Path("deep/out")) as partial:  # stays where it is; makes folders above it
        monkeypatch.chdir(tmp_path)
        assert partial == tmp_path / "here/deep/.out.partial"
        (partial / "a.csv").write_text("a")
        assert not (tmp_path / "here/deep/out").exists()
    assert names(tmp_path) == ["here", "here/deep", "here/deep/out", "here/deep/out/a.csv"]


def fail_inside(error, path, **options):
    with new_folder(path, **options) as partial:
        (partial / "a.csv").write_text("a")
        raise error


LEFT = [".out.partial", ".out.partial/a.csv"]


@pytest.mark.parametrize(
    ("error", "options", "left"),
    [
        (rb.InputError("late"), {}, []),
        (KeyboardInterrupt(), {}, []),  # where nobody can go on
        (KeyboardInterrupt(), {"resume": False}, LEFT),
        (rb.ComputationError("x"), {"resume": False}, LEFT),
        (ZeroDivisionError(), {"resume": False}, LEFT),
    ],
)
def test_new_folder__a_failure_inside_leaves_no_final_folder(tmp_path, error, options, left):
    with pytest.raises(type(error)):
        fail_inside(error, tmp_path / "out", **options)
    assert names(tmp_path) == left


@pytest.mark.parametrize(
    "error", [rb.InputError("x"), rb.ComputationError("x"), OSError("disk full")]
)
def test_new_folder__a_failure_with_force_leaves_the_old_run_alone(tmp_path, error):
    old = run_folder(tmp_path / "out")
    with pytest.raises(type(error)):
        fail_inside(error, old, force=True)
    assert names(old) == ["old.csv", "run.json"]
    assert (old / "old.csv").read_text() == "old"


def test_new_folder__force_replaces_a_run_and_nothing_of_it_stays(tmp_path):
    old = run_folder(tmp_path / "out")
    run_folder(tmp_path / ".out.old")  # left by a crash
    with (
        pytest.raises(rb.InputError, match=r"out: exists; use another -o, or --force"),
        new_folder(old),
    ):
        pytest.fail("went on")
    with new_folder(old, force=True) as partial:
        (partial / "new.csv").write_text("new")
        assert (old / "old.csv").exists()
    assert names(tmp_path) == ["out", "out/new.csv"]


def test_new_folder__where_none_can_be_is_refused(tmp_path):
    (tmp_path / "file").write_text("mine")
    with (
        pytest.raises(rb.InputError, match=r"file/out: cannot be created \(Not a directory\)"),
        new_folder(tmp_path / "file" / "out"),
    ):
        pytest.fail("went on")
    assert names(tmp_path) == ["file"]


def test_new_folder__resume_goes_on_in_what_was_left(tmp_path):
    (tmp_path / ".out.partial").mkdir()
    (tmp_path / ".out.partial" / "chains-hybrid.npz").write_text("chains")
    with new_folder(tmp_path / "out", resume=True) as partial:
        assert (partial / "chains-hybrid.npz").read_text() == "chains"
    assert names(tmp_path) == ["out"]  # without the chains: all is in the posterior by now


def test_new_folder__resume_keeps_the_chains_when_it_fails_again(tmp_path):
    (tmp_path / ".out.partial").mkdir()
    (tmp_path / ".out.partial" / "chains-hybrid.npz").write_text("chains")
    with pytest.raises(rb.InputError):
        fail_inside(rb.InputError("another table"), tmp_path / "out", resume=True)
    assert (tmp_path / ".out.partial" / "chains-hybrid.npz").read_text() == "chains"


@pytest.mark.parametrize("n_row", [0, 1, 70_000])
def test_write_csv__in_pieces_that_workers_make_is_the_same_text(tmp_path, n_row):
    x = np.random.default_rng(3).standard_normal((n_row, 4))
    frame = pd.DataFrame(x, columns=list("abcd")).assign(form="a,b", n=np.arange(n_row))
    with ThreadPoolExecutor(2) as executor:
        write_csv(frame, tmp_path / "x.csv", executor)
    assert (tmp_path / "x.csv").read_bytes() == frame.to_csv(index=False).encode()


def test_write_csv__in_full_and_with_plain_line_ends(tmp_path):
    values = [1 / 3, 1e-300, 0.1 + 0.2, 123456789.123456789]
    write_csv(pd.DataFrame({"form": "a,b", "x": values}), tmp_path / "x.csv")
    lines = (tmp_path / "x.csv").read_bytes().decode().split("\n")
    assert lines[0] == "form,x"
    assert [float(line.split(",")[-1]) for line in lines[1:-1]] == values  # bit for bit
    assert lines[1].startswith('"a,b",')
    assert lines[-1] == ""
    assert b"\r" not in (tmp_path / "x.csv").read_bytes()
    assert names(tmp_path) == ["x.csv"]


# --- what is in it --------------------------------------------------------------------------------


def test_summary__is_not_rounded(written, comparison):
    frame = pd.read_csv(written / "summary.csv", dtype=str)
    live = pd.concat(fit.summary for fit in comparison.fits.values())
    for column in ("mean", "sd", "eti_lower", "eti_upper", "ess_bulk", "r_hat", "mcse_mean"):
        assert [float(text) for text in frame[column]] == live[column].tolist()
        digits = frame[column].str.replace(r"e.*|[.\-]", "", regex=True).str.lstrip("0").str.len()
        assert (digits > 6).all(), column


def test_verdicts__of_a_comparison_with_a_failure(comparison):
    found = verdicts(replace(comparison, failures={"hybrid": "no interior mode"}))["verdicts"]
    assert found["complete"] is False
    assert found["best"] == "modified"
    assert found["probabilities"] == comparison.probabilities
    assert found["converged"] == {"classic": True, "power-law": True, "modified": True}
    assert found["missing"] == {}
    assert found["failures"] == {"hybrid": "no interior mode"}
    assert found["caution"] == "rows are not independent"
    assert (found["n_calibration"], found["n_held_out"], found["n_left_out"]) == (41, 3, 0)


def test_verdicts__name_what_a_fit_lacks_and_that_nothing_rests_on_it(comparison):
    lacking = replace(
        comparison.fits["classic"], convergence_failures=("c: too short", "sigma: too short")
    )
    compared = replace(comparison, fits={**comparison.fits, "classic": lacking})
    content = verdicts(compared)
    assert content["verdicts"]["converged"]["classic"] is False
    assert content["verdicts"]["missing"] == {"classic": ("c: too short", "sigma: too short")}
    why = content["fits"][0]["why"]  # Classic is e^60 less probable than Modified
    assert why.startswith("c: too short; sigma: too short; no more draws were taken: the form's")
    assert compared.unconverged == {}


# --- read back ------------------------------------------------------------------------------------


def test_read_run__brings_every_table_back(written, comparison):
    again = rb.read_run(written)
    assert again.table.where == "my table"
    assert again.table.digest() == comparison.table.digest()
    assert again.noise == comparison.noise
    assert again.failures == comparison.failures
    assert again.best == comparison.best
    for name in ("evidence", "bayes_factors", "loo", "prior_sensitivity"):
        pd.testing.assert_frame_equal(
            getattr(again, name), getattr(comparison, name), rtol=1e-14, check_dtype=False
        )


def test_read_run__brings_every_posterior_back(written, comparison):
    again = rb.read_run(written)
    assert list(again.fits) == list(comparison.fits)
    for name, fit in comparison.fits.items():
        # Algebra: a logarithm and back.
        np.testing.assert_allclose(again.fits[name].draws, fit.draws, rtol=1e-14)
        assert again.fits[name].convergence_failures == fit.convergence_failures
        assert again.fits[name].seed == fit.seed
        assert again.fits[name].model.priors == fit.model.priors
        assert again.fits[name].form == fit.form
        assert again.fits[name].cautions == fit.cautions
        # Algebra: the summary is kept to 15 decimals.
        pd.testing.assert_frame_equal(again.fits[name].summary, fit.summary, rtol=1e-9)


def test_read_run__a_comparison_of_one_form_has_no_factors(paper, tmp_path):
    done = rb.run(paper, tmp_path / "run", forms="modified", **QUICK)
    factors = rb.read_run(tmp_path / "run").bayes_factors
    assert list(factors) == list(done.bayes_factors)
    assert factors.empty


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("posterior-classic.nc", 0, "posterior-classic.nc: not a readable NetCDF file"),
        ("posterior-power-law.nc", 5_000, "posterior-power-law.nc: not a readable NetCDF file"),
        ("posterior-modified.nc", -1, "posterior-modified.nc: not a readable NetCDF file"),
        ("posterior-classic.nc", None, "posterior-classic.nc"),
        ("table.csv", None, "table.csv"),
        ("table.csv", 0, "table.csv"),
        ("evidence.csv", None, "evidence.csv: missing; run again"),
        ("loo.csv", 0, "loo.csv: damaged"),
        *(
            ("run.json", content, "run.json: damaged")
            for content in (b"", b'{"command": "comp', b"[]", b"null", b'{"verdicts": 3}', b"\xff")
        ),
    ],
)
def test_read_run__a_missing_or_damaged_file_is_named(run, name, content, message):
    path = run / name
    if content is None:
        path.unlink()
    else:
        path.write_bytes(content if isinstance(content, bytes) else path.read_bytes()[:content])
    with pytest.raises(rb.InputError, match=message):
        rb.read_run(run)


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("noise", "student", "noise 'student': not an error model"),
        ("forms", ["classic", "quadratic"], "form 'quadratic'; expected one of classic"),
    ],
)
def test_read_run__a_name_that_this_version_does_not_know_is_told(run, key, value, message):
    content = json.loads((run / "run.json").read_text(encoding="utf-8"))
    (run / "run.json").write_text(json.dumps({**content, key: value}))
    with pytest.raises(rb.InputError, match=message):
        rb.read_run(run)
