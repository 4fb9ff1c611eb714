"""Words of commands at their end: text for people, one JSON object for programs, or nothing."""

import json
import re
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

import ridgebayes as rb
from ridgebayes.commands.answers import _rounded
from ridgebayes.commands.cli import app
from ridgebayes.commands.shared_options import Output
from ridgebayes.commands.terminal import Answer, tell, to_plain

KEYS = ["command", "version", "exit_code", "messages", "files", "result"]
COMMANDS = [one.name for one in app.registered_commands]
GENERATE = ("generate", "--texture", "0.02,0.02", "-o", "t.csv")
# Words of each command that are wrong before anything is computed.
WRONG = {
    "run": ("--table", "no.csv"),
    "generate": ("no.toml", "-o", "t.csv"),
    "fit": ("no.csv", "--form", "hybrid"),
    "compare": ("no.csv",),
    "predict": ("no", "--texture", "0.02,0.02", "--p-over-E", "0.01", "-o", "b.csv"),
    "friction": ("no", "no.toml", "-o", "x.nc"),
    "design": ("no", "--scene", "no.toml", "--goal", "P(Q >= 8) >= 0.9"),
    "coverage": ("no.csv",),
    "plan": ("no.toml",),
    "cost": ("no.csv",),
    "import": ("no.csv", "-o", "t.csv"),
    "export-deck": ("no.toml", "-o", "run.inp"),
    "report": ("no",),
}


def test_wrong_words__are_of_every_command():
    assert sorted(WRONG) == sorted(COMMANDS)


@pytest.mark.parametrize("name", WRONG)
def test_json__an_error_is_an_object_too(command, name):
    plain, said = command(name, *WRONG[name]), command(name, *WRONG[name], "--json")
    assert plain.code == said.code == 2
    assert plain.err == said.err == f"ridgebayes: {json.loads(said.out)['error']}\n"
    content = json.loads(said.out)
    assert list(content) == [*KEYS, "error"]
    assert (content["command"], content["exit_code"], content["result"]) == (name, 2, None)
    assert list(Path().iterdir()) == []


@pytest.mark.parametrize("name", COMMANDS)
def test_json__wrong_usage_is_an_object_too(command, name):
    said = command(name, "--colour", "red", "--json")
    assert said.code == 2
    content = json.loads(said.out)
    assert list(content) == [*KEYS, "error"]
    assert content["command"] == name
    assert "--colour" in content["error"]


def test_json__of_no_command_is_an_object_too(command):
    content = json.loads(command("weigh", "--json").out)
    assert content["command"] is None
    assert "weigh" in content["error"]


def test_json__of_what_failed_half_way_has_result_and_error(command, monkeypatch):
    monkeypatch.setattr(
        "ridgebayes.commands.run.command", lambda asked: Answer(result=1, problem="not all")
    )
    said = command("report", "run", "--json")
    content = json.loads(said.out)
    assert said.code == content["exit_code"] == 1
    assert (content["result"], content["error"]) == (1, "not all")


def test_quiet__says_nothing_but_errors(command):
    said = command(*GENERATE, "--quiet")
    assert (said.code, said.out, said.err) == (0, "", "")
    said = command(*GENERATE, "-q")
    assert (said.code, said.out) == (2, "")
    assert said.err.startswith("ridgebayes: t.csv: exists")


def test_quiet__hides_warnings(capsys):
    answer = Answer(("done",), warnings=("far out",))
    tell("predict", answer, 0, "", Output())
    assert tuple(capsys.readouterr()) == ("done\n", "ridgebayes: warning: far out\n")
    tell("predict", answer, 0, "", Output(quiet=True))
    assert tuple(capsys.readouterr()) == ("", "")


def test_closed_output__is_no_error(monkeypatch):
    monkeypatch.setattr("sys.stdout", None)  # as Python sets it without an output
    tell("predict", Answer((pd.DataFrame({"a/R": [0.02]}),)), 0, "", Output())


def test_verbose__adds_details(capsys):
    answer = Answer(("short",), details=("long",))
    tell("plan", answer, 0, "", Output(verbose=True))
    assert capsys.readouterr().out == "short\nlong\n"


@pytest.mark.parametrize("name", COMMANDS)
def test_help__has_the_options_of_all_commands(name):
    done = CliRunner().invoke(app, [name, "--help"], env={"COLUMNS": "200", "NO_COLOR": "1"})
    assert done.exit_code == 0
    for option in ("--quiet", "--verbose", "--json"):
        assert option in done.output


def test_version__is_that_of_the_package():
    done = CliRunner().invoke(app, ["--version"])
    assert (done.exit_code, done.output) == (0, f"ridgebayes {rb.__version__}\n")


def test_table__is_aligned_text_where_it_is_piped(capsys):
    table = pd.DataFrame({"form": ["hybrid", "[x]"], "n": [1, 200], "share": [0.25, 1e-9]})
    tell("compare", Answer((table,)), 0, "", Output())
    assert capsys.readouterr().out == (
        "form      n  share\nhybrid    1   0.25\n[x]     200  1e-09\n"
    )


def test_table__is_ruled_on_a_terminal(capsys, monkeypatch):
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    tell("compare", Answer((pd.DataFrame({"form": ["hybrid"]}),)), 0, "", Output())
    assert re.search("─{4,}", capsys.readouterr().out)


@pytest.mark.parametrize(
    ("files", "line"),
    [
        (["t.csv"], "t.csv"),
        (["out/a.csv", "out/figures/x.png", "out/figures/y.png"], "out: a.csv, figures/ (2 files)"),
        (["t.csv", "found/x.png"], "t.csv, found/ (1 file)"),
        ([f"out/{i:02d}.csv" for i in range(20)], None),
    ],
)
def test_files__are_listed(capsys, files, line):
    tell("run", Answer(files=[Path(name) for name in files]), 0, "", Output())
    out = capsys.readouterr().out
    assert out == f"Written: {line}\n" if line else out.endswith("15.csv, and 4 more\n")


def test_plain__holds_no_numpy_and_no_nan():
    value = {"a": np.float64(0.5), "b": np.array([1, 2]), "c": (np.inf, np.bool_(True)), 1: None}
    assert to_plain(value) == {"a": 0.5, "b": [1, 2], "c": [None, True], "1": None}


def test_coefficients__of_textures_have_short_labels():
    row = {"parameter": "K[a0.027777777777777776_b0.022222222222222223]", "mean": 56.4, "sd": 0.5}
    summary = pd.DataFrame([row | {"eti_lower": 55.6, "eti_upper": 57.2, "prob": 0.9}])
    (shown,) = _rounded(summary).to_numpy().tolist()
    assert shown == ["K[a0.027778_b0.022222]", "56.40", "0.50", "55.60 to 57.20"]
