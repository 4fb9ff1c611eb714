"""`ridgebayes coverage` as a person types it: exit codes, what is said, what is written."""

import functools
import json
import re
from pathlib import Path

import pandas as pd
import pytest

from ridgebayes import Noise
from ridgebayes.checks.coverage import COVERAGE_COLUMNS, PROBS
from ridgebayes.commands.run_folder import RUN_JSON

ROWS = """a_over_R,b_over_R,Q,p_over_E
0.012,0.03,4,0.00084
0.012,0.03,6,0.0034
0.032,0.01,4,0.00098
0.032,0.01,6,0.0038
0.022,0.02,4,0.00092
0.022,0.02,6,0.0036
"""
FILES = {"coverage.csv", "coverage.json", "coverage.png", "coverage.svg"}


@pytest.fixture
def command(command):
    """Call the subcommand in a folder that holds a table."""
    Path("table.csv").write_text(ROWS)
    return functools.partial(command, "coverage")


@pytest.fixture
def canned(monkeypatch):
    """Stand in for the computation: what it was asked, and a table of the right shape."""
    asked = {}

    def coverage(data, forms, noises, *, rng, executor, progress):
        asked.update(data=data, forms=forms, noises=noises, rng=rng, executor=executor)
        rows = []
        for form in forms:
            for noise in noises:
                with progress(f"{form.name}, {noise.name}"):
                    rows += [
                        (form.name, noise.name, prob, 6, 5, 0.83, 0.1, 0.2, 0.3, 3, 0, 0, "")
                        for prob in PROBS
                    ]
        frame = pd.DataFrame(rows, columns=COVERAGE_COLUMNS)
        return frame.assign(**asked.get("failure", {}))

    monkeypatch.setattr("ridgebayes.commands.coverage.coverage", coverage)
    return asked


def test_coverage__computes_and_writes_everything(command):
    words = ("table.csv", "-o", "out", "--forms", "modified", "--noise", "iid")
    said = command(*words, "--workers", 1, "--seed", 3)
    assert (said.code, said.err.count("\n")) == (0, 2)
    assert re.search(r"^modified, iid: [0-9.]+ s$", said.err, re.MULTILINE)
    assert {path.name for path in Path("out").iterdir()} == FILES
    assert {path.name for path in Path().iterdir()} == {"out", "table.csv"}
    frame = pd.read_csv("out/coverage.csv")
    assert list(frame.columns) == COVERAGE_COLUMNS
    assert frame["prob"].tolist() == list(PROBS)
    assert (frame["n"] == 6).all()
    about = json.loads(Path("out/coverage.json").read_text())
    assert about["seed"] == 3
    assert about["options"] == {
        "table": "table.csv",
        "forms": ["modified"],
        "noise": ["iid"],
        "workers": 1,
    }
    assert {"python", "ridgebayes", "numpy"} <= set(about["versions"])
    assert "Bands of 90 %:" in said.out


def test_coverage__takes_the_embedded_sweep_four_forms_and_all_error_models(command, canned):
    assert command("--workers", 1).code == 0
    assert len(canned["data"].calibration) == 41
    names = {form.name for form in canned["forms"]}
    assert names == {"classic", "modified", "hybrid", "power-law"}
    assert canned["noises"] == list(Noise.every())
    assert (canned["rng"], canned["executor"]) == (0, None)
    assert {path.name for path in Path("ridgebayes-coverage").iterdir()} == FILES


def test_coverage__replaces_its_own_folders_only_and_only_when_told(command, canned):
    words = ("table.csv", "-o", "out", "--noise", "iid", "--workers", 1)
    assert command(*words).code == 0
    before = Path("out/coverage.json").read_bytes()
    refused = command(*words)
    assert refused.code == 2
    assert "out: exists; use another -o, or --force" in refused.err
    assert Path("out/coverage.json").read_bytes() == before
    assert command(*words, "--force", "--seed", 1).code == 0
    assert json.loads(Path("out/coverage.json").read_text())["seed"] == 1
    Path("out/coverage.json").rename(Path("out") / RUN_JSON)
    refused = command(*words, "--force")
    assert refused.code == 2
    assert "no coverage.json in it" in refused.err
    assert {path.name for path in Path("out").iterdir()} == FILES - {"coverage.json"} | {RUN_JSON}


def test_coverage__that_failed_somewhere_is_written_and_says_so(command, canned):
    canned["failure"] = {"n_failed": 1, "failed": "a0.022_b0.02: no interior mode"}
    said = command("table.csv", "-o", "out", "--forms", "hybrid", "--noise", "iid", "--workers", 1)
    assert said.code == 1
    assert "ridgebayes: hybrid, iid: a0.022_b0.02: no interior mode" in said.err
    assert {path.name for path in Path("out").iterdir()} == FILES


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("--noise", "nois"), "noise 'nois': not an error model; expected "),
        (("--noise", "iid,,step"), "--noise 'iid,,step': an empty name"),
        (("--noise", "iid,iid"), "noise: expected error models without repeats, got iid, iid"),
        (("--forms", "half-plane"), "circular"),
        (
            ("one.csv", "--workers", "1"),
            "leaving out each texture: expected rows of two",
        ),
        (("brackets.csv", "--workers", "1"), "got only brackets and counts"),
    ],
)
def test_coverage__refuses_bad_input_and_writes_nothing(command, words, expected):
    Path("one.csv").write_text("\n".join(ROWS.split("\n")[:3]))
    rows = pd.read_csv("table.csv")
    rows.assign(p_over_E_lower=rows["p_over_E"] / 2).to_csv("brackets.csv", index=False)
    said = command(*words)
    assert said.code == 2
    assert expected in said.err
    assert "Traceback" not in said.err
    assert {path.name for path in Path().iterdir()} == {"brackets.csv", "one.csv", "table.csv"}
