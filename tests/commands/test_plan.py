"""`ridgebayes plan` as a person types it: exit codes, what is said, what is written."""

import functools
import json
import re
from pathlib import Path

import pandas as pd
import pytest

import ridgebayes as rb
from ridgebayes.runtime.text import percent
from ridgebayes.scene.effects import plan_table

SCENE = """
[texture]
ridge_width = 0.02
groove_width = 0.03
groove_depth = 0.001
[load]
p_over_E = 0.004
[accuracy]
relative = 0.01
"""


@pytest.fixture
def command(command):
    """Call the subcommand in a folder that holds a scene."""
    Path("scene.toml").write_text(SCENE)
    return functools.partial(command, "plan")


def test_plan__says_what_the_scene_is_and_writes_nothing(command):
    said = command("scene.toml")
    assert (said.code, said.err) == (0, "")
    expected, simulate, heading, *rows, last = said.out.splitlines()
    scene = rb.Scene.from_toml("scene.toml")
    found = rb.contact_at_loads(scene, [0.004]).iloc[0]
    assert expected == (
        f"a/R = 0.02, b/R = 0.03: at p/E = 0.004 expect Q = {found['Q']} in a contact "
        f"{2 * found['half_width_over_R']:.2g} R wide, of which "
        f"{100 * found['contact_fraction']:.2g} % touches."
    )
    effects = rb.plan(scene)[0].effects
    assert simulate.startswith("To compute loads right to 1 %, simulate: ridges (")
    assert re.search(r" By the half-plane equation that takes (about|under) [\d.]+ s\.$", simulate)
    assert heading.split() == ["effect", "simulated", "changes", "loads", "by", "takes"]
    known = [effect for effect in effects if effect.cost_s == effect.cost_s]
    for row, effect in zip(rows, known, strict=True):
        cells = re.split(r"  +", row)
        size = percent(effect.estimate)
        assert cells[:3] == [effect.name, "yes" if effect.simulated else "no", size]
    assert last.startswith("Not modelled: adhesion, viscoelasticity, ")
    assert {path.name for path in Path().iterdir()} == {"scene.toml"}


def test_plan__says_each_texture(command):
    text = SCENE.replace("[texture]", "[[texture]]")
    more = "[[texture]]\nridge_width = 0.03\ngroove_width = 0.01\noffset = 'uniform'\n"
    Path("scene.toml").write_text(more + text)
    said = command("scene.toml")
    assert said.code == 0
    first, second = re.findall(r"^a/R = .*$", said.out, flags=re.M)
    assert first.startswith("a/R = 0.03, b/R = 0.01: at p/E = 0.004 expect Q = ")
    assert " on average over offsets in a contact " in first
    assert second.startswith("a/R = 0.02, b/R = 0.03: ")


UNITS = """
[body]
radius = "12 mm"
youngs_modulus = "60 kPa"
[texture]
ridge_width = "1 mm"
groove_width = "1 mm"
[load]
force = "5 N"
length = "12 mm"
"""


BEYOND = (
    "ridgebayes: load: 10 N on 12 mm is p/E = 0.58; expected at most p/E = 0.5, "
    "8.64 N on 12 mm: no solver goes further\n"
)


def test_plan__refuses_a_load_beyond_reach_at_once_and_in_its_own_units(command, monkeypatch):
    Path("scene.toml").write_text(UNITS.replace("5 N", "10 N"))
    monkeypatch.setattr("ridgebayes.commands.plan.plan", stopped)
    said = command("scene.toml")  # before anything is computed
    assert (said.code, said.err) == (2, BEYOND)


def test_plan__warns_of_friction_beyond_the_reach_of_finite_elements(command, monkeypatch):
    Path("scene.toml").write_text(UNITS + "friction = 0.3\n")
    monkeypatch.setattr("ridgebayes.commands.plan.plan", stopped)
    said = command("scene.toml")
    warning = "5 N on 12 mm is p/E = 0.29; expected at most p/E = 0.1. "
    assert said.code == 1
    assert said.err.startswith(f"ridgebayes: warning: {warning}")
    said = command("scene.toml", "--json")
    assert json.loads(said.out)["error"] == "enough"
    assert command("scene.toml", "--quiet").err == "ridgebayes: enough\n"
    monkeypatch.undo()


def test_plan__says_count_and_width_at_large_deformation_with_their_error(command):
    Path("scene.toml").write_text(UNITS + "[accuracy]\nrelative = 0.01\n")
    said = command("scene.toml")
    assert (said.code, said.err) == (0, "")
    assert "By two scales" in said.out
    assert "Standard error of the load: 0." in said.out


def stopped(*_, **__):
    raise rb.ComputationError("enough")


def test_generate__refuses_a_load_beyond_reach_before_it_runs(command, monkeypatch):
    Path("scene.toml").write_text(UNITS.replace("5 N", "10 N"))
    monkeypatch.setattr("ridgebayes.commands.generate.sweep_job", stopped)
    monkeypatch.setattr("sys.argv", ["ridgebayes"])
    said = command.func("generate", "scene.toml", "-o", "t.csv")
    assert (said.code, said.err) == (2, BEYOND)
    said = command.func("generate", "scene.toml", "--solver", "half-plane", "-o", "t.csv")
    assert said.err.startswith("ridgebayes: warning: 10 N on 12 mm is p/E = 0.58; ")
    assert said.err.endswith("ridgebayes: enough\n")


def test_plan__says_lengths_in_the_scenes_units(command):
    Path("scene.toml").write_text(UNITS.replace("5 N", "0.1 N"))
    said = command("scene.toml")
    assert (said.code, said.err) == (0, "")
    assert "at 0.1 N on 12 mm (p/E = 0.00579) expect Q = " in said.out
    assert re.search(r"in a contact 0\.\d+ R \(\d\.\d mm\) wide", said.out)


def test_plan__new_writes_a_scene_to_start_from(command):
    said = command("--new", "my.toml")
    assert said.code == 0
    assert said.out.startswith("my.toml: a scene to start from.")
    assert command("my.toml").code == 0
    text = Path("my.toml").read_text()
    # Keys that are commented out are valid as well: of the loads, one at a time.
    loads = ("line", "force", "length", "p_over_E", "friction")
    kept = [
        line for line in text.splitlines() if not line.startswith(tuple(f"# {k} " for k in loads))
    ]
    Path("all.toml").write_text("\n".join(re.sub(r"^# (?=\w+ = )", "", one) for one in kept))
    assert rb.Scene.from_toml("all.toml").textures[0].role == "held-out"


def test_plan__figures_fail_one_by_one(command, monkeypatch):
    monkeypatch.setattr("ridgebayes.commands.plan_figures._deformed", stopped)
    said = command("scene.toml", "--figures", "drawn")
    assert said.code == 0
    assert "expect Q = " in said.out
    assert said.err == "ridgebayes: warning: deformed-a0.02_b0.03: no figure: enough\n"
    assert {path.stem for path in Path("drawn").iterdir()} == {
        "counts-a0.02_b0.03",
        "effects-a0.02_b0.03",
    }


def test_plan__is_told_where_figures_cannot_be_written(command):
    Path("letter").write_text("mine")
    said = command("scene.toml", "--figures", "letter/drawn")
    assert said.code == 1
    assert "expect Q = " in said.out
    assert said.err.startswith("ridgebayes: letter/drawn: cannot be written: Not a directory; ")


def test_plan__replaces_figures_if_forced_and_tells_only_its_own(command):
    Path("drawn").mkdir()
    for name in ("counts-a0.02_b0.03.png", "thesis.docx"):
        Path("drawn", name).write_text("mine")
    refused = command("scene.toml", "--figures", "drawn")
    assert refused.code == 2
    assert "drawn/counts-a0.02_b0.03.png: exists; use another name, or --force" in refused.err
    assert Path("drawn/counts-a0.02_b0.03.png").read_text() == "mine"
    said = command("scene.toml", "--figures", "drawn", "--force")
    assert said.code == 0
    assert "counts-a0.02_b0.03.png" in said.out
    assert "thesis.docx" not in said.out


def test_plan__writes_the_table(command):
    assert command("scene.toml", "-o", "plan.csv").code == 0
    frame = pd.read_csv("plan.csv")
    expected = plan_table(rb.plan(rb.Scene.from_toml("scene.toml")))
    pd.testing.assert_frame_equal(frame, expected)


def test_plan__draws_each_texture(command):
    said = command("scene.toml", "--figures", "drawn/here")
    assert said.code == 0
    names = {path.name for path in Path("drawn/here").iterdir()}
    assert names == {
        f"{name}-a0.02_b0.03.{kind}"
        for name in ("deformed", "effects", "counts")
        for kind in ("png", "svg")
    }
    for path in Path("drawn/here").iterdir():
        start = b"\x89PNG" if path.suffix == ".png" else b"<?xml"
        assert path.read_bytes().startswith(start)


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ((), "SCENE: missing; expected a scene file or --new"),
        (("scene.toml", "-o", "plan.xlsx"), "plan.xlsx: a table file ends in .csv or .parquet"),
        (
            ("scene.toml", "--figures", "scene.toml"),
            "scene.toml: not a folder; --figures names one",
        ),
        (("--new", "my.txt"), "my.txt: expected a file name that ends in .toml, got '.txt'"),
        (("--new", "scene.toml"), "scene.toml: exists; use another name, or --force"),
        (("scene.toml", "--new", "my.toml"), "--new: cannot be combined with a scene"),
        (("nowhere.toml",), "nowhere.toml: cannot be read: No such file"),
        (("scene.toml", "-o", "."), ".: a table file ends in .csv or .parquet"),
        (("scene.toml", "-o", "no/plan.csv"), "no/plan.csv: folder no does not exist"),
    ],
)
def test_plan__bad_words_are_told_apart_from_failures(command, words, expected):
    said = command(*words)
    assert (said.code, said.out) == (2, "")
    assert expected in said.err
    assert {path.name for path in Path().iterdir()} == {"scene.toml"}
