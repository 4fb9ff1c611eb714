"""The jobs behind the commands: which files, with which columns, the same for the same seed.

Sampling is short: what is tested here holds for an unconverged fit as well.
"""

import json
import math
import re
import shutil

import numpy as np
import pandas as pd
import pytest

import ridgebayes as rb
from ridgebayes.commands.run import report_job
from ridgebayes.errors import OutputError
from ridgebayes.runtime.progress import Progress
from tests.columns import COLUMNS

# Ends at its first check, where no autocorrelation time can have settled: never converged.
QUICK = rb.SampleSettings(n_walker=16, n_step_max=100)
FORMS = ["modified", "hybrid"]
EVERY_FORM = ["classic", "power-law", "modified", "hybrid", "half-plane"]
COMPARE = "ridgebayes.commands.run.compared"
STANDARD = {"noise": "iid", "accuracy": "standard", "priors": None, "time_limit": None}
STANDARD |= {"prior_odds": None}
COMPARED = {
    "table.csv",
    "summary.csv",
    "evidence.csv",
    "bayes_factors.csv",
    "components.csv",
    "loo.csv",
    "prior_sensitivity.csv",
    "run.json",
}


def posteriors(*forms):
    return {f"posterior-{form}.nc" for form in forms}


def names(folder):
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*")}


def about(folder):
    return json.loads((folder / "run.json").read_text(encoding="utf-8"))


def run_job(folder, *, seed=0, workers=1, **wanted):
    """Run in this process: workers take seconds to import what they need."""
    return rb.run(folder=folder, rng=seed, workers=workers, **{"noise": "iid"} | wanted)


def compare_job(folder, table, **wanted):
    return run_job(folder, table=table, command="compare", **wanted)


def fit_job(folder, table, form, **wanted):
    return run_job(folder, table=table, forms=form, command="fit", **wanted)


class Pages:
    """Stands in for figures and report, and remembers what it was asked for."""

    def __init__(self):
        self.asked = []

    def __call__(self, *galleries, folder, command=""):
        self.asked.append([gallery and gallery.data.comparison for gallery in galleries])
        (folder / "report.html").write_text("a page")


class Counted(Progress):
    """A progress that can be looked at afterwards."""

    made: list[Progress]

    def __enter__(self):
        self.made.append(self)
        return super().__enter__()


@pytest.fixture(scope="module")
def table(tmp_path_factory, paper):
    """Three textures of the paper and the held-out one, as a user's file."""
    chosen = [(0.012, 0.03), (0.022, 0.02), (0.032, 0.01), (0.012, 0.09)]
    frame = paper.frame
    keep = [pair in chosen for pair in zip(frame["a_over_R"], frame["b_over_R"], strict=True)]
    path = tmp_path_factory.mktemp("tables") / "mine.csv"
    rb.ContactTable.from_frame(frame[keep]).write(path)
    return path


@pytest.fixture(scope="module")
def runs(tmp_path_factory, table):
    """The main job on a user's table, again by workers, and a comparison with another seed."""
    folder, pages = tmp_path_factory.mktemp("runs"), Pages()
    Counted.made = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("ridgebayes.commands.run.write_pages", pages)
        # Workers would draw figures for pages that are not written.
        patch.setattr("ridgebayes.commands.run.Gallery", lambda data, executor: None)
        patch.setattr("ridgebayes.commands.run.Progress", Counted)
        done = {
            name: run_job(folder / name, table=table, forms=FORMS, settings=QUICK, **options)
            for name, options in {
                "first": {"seed": 5},
                "again": {"seed": 5, "workers": 2},
                "other": {"seed": 6, "command": "compare"},
            }.items()
        }
    return folder, done, pages, list(Counted.made)


# --- the main job ---------------------------------------------------------------------------------


def test_run__writes_the_files_of_the_contract_and_no_others(runs):
    folder, _, _, _ = runs
    expected = (
        COMPARED | posteriors(*FORMS) | {"bands.csv", "loads.csv", "costs.csv", "report.html"}
    )
    assert names(folder / "first") == expected | {"left_out.csv", "coverage.csv"}
    assert {path.name for path in folder.iterdir()} == {"first", "again", "other"}


@pytest.mark.parametrize("name", COLUMNS)
def test_run__columns_are_the_contract_in_its_order(runs, name):
    header = (runs[0] / "first" / name).read_text(encoding="utf-8").split("\n")[0]
    if name == "bands.csv":
        fixed, _, tail = header.partition(",p_q_ge_4")
        assert fixed == COLUMNS[name]
        counts = [int(part.removeprefix("p_q_ge_")) for part in f"p_q_ge_4{tail}".split(",")]
        assert counts == list(range(4, 4 + 2 * len(counts), 2))
    else:
        assert header == COLUMNS[name]


def test_run__the_table_as_used_stands_in_the_folder(runs, table):
    written = rb.read_table(runs[0] / "first" / "table.csv")
    assert written.digest() == rb.read_table(table).digest()


def test_run__the_same_seed_gives_the_same_bytes(runs):
    folder, _, _, _ = runs
    files = sorted(path.name for path in (folder / "first").glob("*.csv"))
    assert len(files) == 12
    files.remove("costs.csv")  # seconds, which no two runs share
    costs = [pd.read_csv(folder / name / "costs.csv") for name in ("first", "again")]
    for column in ("task", "method", "error"):
        assert costs[0][column].tolist() == costs[1][column].tolist()
    for name in files:
        assert (folder / "first" / name).read_bytes() == (folder / "again" / name).read_bytes()


def test_run__another_seed_moves_what_was_drawn_and_nothing_else(runs):
    folder, _, _, _ = runs
    drawn = ("summary", "evidence", "bayes_factors", "loo", "prior_sensitivity")
    for name in (f"{one}.csv" for one in drawn):
        assert (folder / "first" / name).read_bytes() != (folder / "other" / name).read_bytes()
    assert (folder / "first/table.csv").read_bytes() == (folder / "other/table.csv").read_bytes()


def test_run__bands_hold_every_texture_at_200_loads_for_each_form_and_the_average(runs, table):
    bands = pd.read_csv(runs[0] / "first" / "bands.csv")
    rows = bands.groupby(["kind_of_band", "form", "a_over_R", "b_over_R"]).size()
    assert len(rows) == 2 * (len(FORMS) + 1) * 4
    assert set(rows) == {200}
    observed = pd.read_csv(table)["p_over_E"]
    # Algebra: the ends of a logarithmic grid.
    assert math.isclose(bands["p_over_E"].min(), observed.min(), rel_tol=1e-14)
    assert math.isclose(bands["p_over_E"].max(), observed.max(), rel_tol=1e-14)
    steps = np.diff(np.log(bands["p_over_E"].to_numpy().reshape(-1, 200)))
    np.testing.assert_allclose(steps, np.log(observed.max() / observed.min()) / 199, rtol=1e-7)
    assert set(bands["prob"]) == {0.9}


def test_run__held_out_rows_are_predicted_and_not_fitted(runs, table):
    frame = rb.read_table(table).frame
    held_out = frame[frame["role"] == "held-out"]
    assert len(held_out) == 3
    loads = pd.read_csv(runs[0] / "first" / "loads.csv")
    seen = loads.query("form == 'average' and kind_of_band == 'simulation' and b_over_R == 0.09")
    assert seen["p_over_E_observed"].tolist() == held_out["p_over_E"].tolist()
    fit = rb.read_run(runs[0] / "first").fits["hybrid"]
    assert len(fit.model.data) == len(frame) - 3
    assert (0.012, 0.09) not in fit.model.data.textures


def test_run__says_how_it_was_made(runs, table):
    content = about(runs[0] / "first")
    assert content["command"] == "run"
    assert content["seed"] == 5
    assert content["versions"]["ridgebayes"] == rb.__version__
    assert content["table_digest"] == rb.read_table(table).digest()
    assert content["options"] == {"table": str(table), "forms": FORMS} | STANDARD
    assert content["table"] == str(table)
    assert content["verdicts"]["complete"] is False
    assert set(content["verdicts"]["missing"]) == set(FORMS)
    assert [stage["name"] for stage in content["stages"]] == [
        "evidences",
        "posteriors",
        "prior sensitivity",
        "walk modified",
        "walk hybrid",
        "leave-one-out",
        "textures and steps left out",
        "coverage of the bands",
        "what accuracy costs",
        "files of posteriors",
        "bands",
        "what the report shows",
        "figures and report",
    ]
    for stage in content["stages"]:
        assert set(stage) == {"name", "wall_s", "cpu_s"}
        assert stage["wall_s"] >= 0
        assert stage["cpu_s"] >= 0


def test_run__announces_as_many_stages_as_come(runs):
    announced = [progress.n_stage for progress in runs[3]]
    assert announced == [len(progress.stages) for progress in runs[3]]
    assert announced[:2] == [13, 13]


@pytest.fixture
def no_pages(monkeypatch):
    pages = Pages()
    monkeypatch.setattr("ridgebayes.commands.run.write_pages", pages)
    return pages


@pytest.mark.parametrize(
    "place", [pytest.param("write_run_json", marks=pytest.mark.long), "bands_table"]
)
def test_run__that_fails_mid_way_leaves_its_posteriors_and_no_final_folder(
    tmp_path, table, monkeypatch, no_pages, runs, place
):
    def fail(*_, **__):
        raise OutputError("disk full")

    monkeypatch.setattr(COMPARE, lambda *_, **__: runs[1]["first"])
    monkeypatch.setattr(f"ridgebayes.commands.run.{place}", fail)
    kept = r"disk full; what is finished is kept in \S+/\.out\.partial"
    with pytest.raises(OutputError, match=kept):
        # One process: what a test puts in the place of a function is not there in a worker.
        run_job(tmp_path / "out", table=table, forms=FORMS, settings=QUICK)
    assert not (tmp_path / "out").exists()
    assert posteriors(*FORMS) | {"summary.csv"} < names(tmp_path / ".out.partial")


# --- the main job on the embedded sweep -----------------------------------------------------------


@pytest.fixture(scope="module")
def default(tmp_path_factory):
    """The main job with nothing named but one form, so that the second comparison is the rest."""
    folder, pages = tmp_path_factory.mktemp("default") / "run", Pages()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("ridgebayes.commands.run.write_pages", pages)
        done = run_job(folder, forms=["modified"], settings=QUICK)
    return folder, done, pages


def test_default__compares_every_form_on_the_finite_element_rows(default):
    folder, _, pages = default
    expected = COMPARED | posteriors(*EVERY_FORM) | {"bands.csv", "loads.csv"}
    assert names(folder / "reference-fe") == expected
    again = rb.read_run(folder / "reference-fe")
    assert list(again.fits) == EVERY_FORM
    assert again.table.digest() == rb.reference_fe().digest()
    assert pages.asked[0][1].table.where == again.table.where == "finite-element reference rows"


def test_default__the_table_is_the_embedded_sweep(default, paper):
    folder, _, _ = default
    content = about(folder)
    assert content["table"] == "embedded sweep"
    assert content["options"] == {"table": None, "forms": ["modified"]} | STANDARD
    assert rb.read_run(folder).table.digest() == paper.digest()


def test_default__unfinished_fits_of_the_second_comparison_are_failures_too(default):
    folder, done, _ = default
    assert {name.split(": ")[0] for name in done.failures} == {"reference-fe"}
    assert "reference-fe: half-plane" in done.failures
    assert not done.complete
    content = about(folder)
    assert content["verdicts"]["failures"] == {}
    assert set(content["reference-fe"]["verdicts"]["probabilities"]) == set(EVERY_FORM)


# --- fit, compare, report -------------------------------------------------------------------------


def test_compare__writes_the_comparison_without_bands_and_pages(tmp_path, table, no_pages, capsys):
    done = compare_job(tmp_path / "out", table, forms=["modified"], seed=3, settings=QUICK)
    assert names(tmp_path / "out") == COMPARED | posteriors("modified")
    assert no_pages.asked == []
    content = about(tmp_path / "out")
    assert (content["command"], content["seed"]) == ("compare", 3)
    assert content["options"] == {"table": str(table), "forms": ["modified"]} | STANDARD
    assert list(done.fits) == ["modified"]
    assert len(content["stages"]) == 5


def test_compare__default_forms_are_the_four_printed_ones(tmp_path, table, monkeypatch):
    asked = []

    def compare(request):
        asked.extend(form.name for form in request.forms)
        raise rb.ComputationError("enough")

    monkeypatch.setattr(COMPARE, compare)
    with pytest.raises(rb.ComputationError, match="enough"):
        compare_job(tmp_path / "out", table)
    assert asked == EVERY_FORM[:4]


def test_fit__writes_one_posterior_with_its_evidence(tmp_path, table):
    done = fit_job(tmp_path / "out", table, "power-law", settings=QUICK)
    expected = {"table.csv", "summary.csv", "evidence.csv", "run.json"}
    assert names(tmp_path / "out") == expected | posteriors("power-law")
    content = about(tmp_path / "out")
    assert content["command"] == "fit"
    assert content["options"] == {"table": str(table), "form": "power-law"} | STANDARD
    assert rb.read_run(tmp_path / "out").probabilities == {"power-law": 1.0}
    assert list(done.fits) == ["power-law"]


@pytest.mark.long
def test_report__real_pages_stand_in_the_folder_whole(default, tmp_path):
    folder = shutil.copytree(default[0], tmp_path / "run")
    before = {path: path.read_bytes() for path in folder.rglob("*.csv")}
    report_job(folder)
    for where in (folder, folder / "reference-fe"):
        assert "<html" in (where / "report.html").read_text(encoding="utf-8")
        assert (where / "report.md").read_text(encoding="utf-8").startswith("#")
        kinds = [path.suffix for path in (where / "figures").iterdir()]
        assert kinds.count(".png") == kinds.count(".svg") > 0
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert not re.findall(
        r'(?:src|href)="(?!data:|#|(?:reference-fe/)?figures/)', page
    )  # self-contained
    assert "did not converge" in page or "not converged" in page
    assert {path: path.read_bytes() for path in folder.rglob("*.csv")} == before


# --- resuming -------------------------------------------------------------------------------------


def test_resume__after_a_kill_ends_with_the_same_bytes(tmp_path, table, monkeypatch, runs):
    """Killed while the second form is walked: the first form's chains are kept and used."""
    from ridgebayes.comparison import compare as module

    walk, calls = module.walk_pair, []

    def killed(pair, *given, **options):
        calls.append(pair.form.name)
        if len(calls) == 2:
            raise KeyboardInterrupt
        return walk(pair, *given, **options)

    options = {"forms": FORMS, "seed": 5, "settings": QUICK}
    monkeypatch.setattr("ridgebayes.comparison.compare.walk_pair", killed)
    with pytest.raises(KeyboardInterrupt):
        compare_job(tmp_path / "out", table, **options)
    assert names(tmp_path) == {".out.partial", ".out.partial/chains-modified.npz"}
    monkeypatch.undo()
    compare_job(tmp_path / "out", table, resume=True, **options)
    assert names(tmp_path / "out") == COMPARED | posteriors(*FORMS)
    for name in COMPARED - {"run.json"}:
        ours, theirs = (tmp_path / "out" / name), (runs[0] / "first" / name)
        assert ours.read_bytes() == theirs.read_bytes()
