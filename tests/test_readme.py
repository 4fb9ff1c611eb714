"""The README is run: its code, its commands, its numbers."""

import re
import shlex
from pathlib import Path

import pytest
from typer.testing import CliRunner

import ridgebayes as rb
from ridgebayes.commands.cli import app
from ridgebayes.evidence import power_law_evidence, quadrature_evidence
from ridgebayes.evidence.prior_sensitivity import scale_factors
from ridgebayes.inference.laplace import fit_laplace
from ridgebayes.model.default_priors import default_priors
from ridgebayes.model.forms import FORMS, form_named
from ridgebayes.model.model import Model
from ridgebayes.model.noise import Noise
from ridgebayes.model.observations import Observations
from ridgebayes.model.prior_files import read_priors, resolve_priors

ROOT = Path(__file__).parents[1]
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(\w*)\n(.*?)^```$", TEXT, flags=re.MULTILINE | re.DOTALL)
PYTHON = [code for language, code in BLOCKS if language == "python"]
SHELL = [code for language, code in BLOCKS if language == "sh"]
PRIORS = [code for language, code in BLOCKS if language == "toml"]


def commands(block):
    return [shlex.split(line, comments=True) for line in block.splitlines()]


def test_blocks__are_all_known():
    # A new block has to be run or checked below, and then counted here.
    assert [language for language, _ in BLOCKS] == ["sh", "python", "sh", "toml", "sh"]
    assert TEXT.count("```") == 2 * len(BLOCKS)


def test_python_blocks__print_what_their_comments_say(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    said, expected, namespace = [], [], {}
    namespace["print"] = lambda *words: said.append(" ".join(map(str, words)))
    for code in PYTHON:
        expected += re.findall(r"^print\(.*\)\s+# (.+)$", code, flags=re.MULTILINE)
        exec(compile(code, "README.md", "exec"), namespace)  # the block is ours
    assert len(expected) == sum(code.count("print(") for code in PYTHON) == 4
    assert said == expected
    assert "</html>" in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_priors_block__holds_the_default_priors(tmp_path):
    (tmp_path / "priors.toml").write_text(PRIORS[0], encoding="utf-8")
    data = Observations.from_table(rb.paper_sweep())
    text = read_priors(tmp_path / "priors.toml")
    found = resolve_priors(text, [rb.Hybrid()], [Noise()], data)
    assert list(found) == ["hybrid", "noise"]
    assert found["hybrid"] | found["noise"] == default_priors(rb.Hybrid())


def test_make_commands__have_targets():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = [words[1] for words in commands(SHELL[0]) if words[0] == "make"]
    assert targets == ["run", "fast", "test"]
    for target in targets:
        assert re.search(rf"^{target}:", makefile, flags=re.MULTILINE)


def test_command_block__runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, *words in commands(SHELL[1]):
        assert name == "ridgebayes"
        done = CliRunner().invoke(app, words, catch_exceptions=False)
        assert done.exit_code == 0, done.output
    bands = (tmp_path / "bands.csv").read_text(encoding="utf-8").splitlines()
    assert len(bands) == 1 + 50


def test_scene_block__runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "data").symlink_to(ROOT / "data")
    for name, *words in commands(SHELL[2]):
        assert name == "ridgebayes"
        done = CliRunner().invoke(app, words, catch_exceptions=False)
        assert done.exit_code == 0, done.output
    assert (tmp_path / "micro.csv").is_file()
    assert list((tmp_path / "figures").glob("deformed-*.png"))


def test_command_table__lists_every_command_and_no_other():
    listed = re.findall(r"^\| `ridgebayes (\S+)` \|", TEXT, flags=re.MULTILINE)
    assert listed == [one.name or one.callback.__name__ for one in app.registered_commands]


def test_option_names__exist():
    for option in set(re.findall(r"`(--[\w-]+)", TEXT)) - {"--help"}:
        helped = [
            CliRunner().invoke(app, [command.callback.__name__, "--help"]).output
            for command in app.registered_commands
        ]
        assert any(option in text for text in helped), option


def test_files_named__exist():
    named = re.findall(r"[`(]((?:docs|data|benchmarks|notebooks)/[\w./-]*|[A-Z]+\.md)[`)]", TEXT)
    assert len(named) == 19
    for name in named:
        assert (ROOT / name).exists(), name


def results_table():
    """Return the cells of each row of the table of results, by form."""
    rows = re.findall(r"^\| (.+?) \| (.+) \|$", TEXT, flags=re.MULTILINE)
    cells = {name: rest.split(" | ") for name, rest in rows if len(rest.split(" | ")) == 5}
    cells.pop("form")
    return {name.lower().replace(" ", "-"): row for name, row in cells.items()}


def number(cell):
    return float(cell.strip("*"))


def exact_evidence(fit):
    if fit.form.name == "power-law":
        return power_law_evidence(fit.model).value
    return quadrature_evidence(fit.model.log_density, fit_laplace(fit.model)).value


def test_results_table__has_every_form():
    assert sorted(results_table()) == sorted(FORMS)


@pytest.fixture(scope="module")
def on_elements():
    """Log evidence of each form on the finite-element rows that a run compares."""
    data = Observations.from_table(rb.reference_fe())
    found = {}
    for name in FORMS:
        model = Model(data, form_named(name))
        if name == "power-law":
            found[name] = power_law_evidence(model).value
        else:
            found[name] = quadrature_evidence(model.log_density, fit_laplace(model)).value
    return found


@pytest.mark.parametrize("form", ["classic", "power-law", "modified", "hybrid", "half-plane"])
def test_results_table__evidences_to_the_digits_shown(fits, on_elements, form):
    *_, sweep, fe = results_table()[form]
    assert number(fe) == round(on_elements[form], 2)
    if form == "half-plane":
        with pytest.raises(rb.InputError, match="circular"):
            rb.calibrate(rb.paper_sweep(), rb.HalfPlane(), noise="iid")
    else:
        assert number(sweep) == round(exact_evidence(fits[form]), 2)


@pytest.mark.parametrize("form", ["classic", "modified", "hybrid"])
def test_results_table__coefficients_to_the_digits_shown(fits, form):
    shown = re.findall(r"(\w+) = ([\d.]+) ± ([\d.]+)", results_table()[form][1])
    summary = fits[form].summary.set_index("parameter")
    assert [name for name, _, _ in shown] == list(fits[form].form.parameter_names)
    for name, mean, sd in shown:
        # Half a unit of the last digit, and three Monte Carlo errors.
        slack = 3 * summary.loc[name, "mcse_mean"]
        for text, value in ((mean, summary.loc[name, "mean"]), (sd, summary.loc[name, "sd"])):
            unit = 10.0 ** -len(text.partition(".")[2])
            assert abs(float(text) - value) <= 0.5 * unit + slack, (name, text, value)


def test_results_table__printed_coefficients_are_those_of_the_forms():
    shown = {form: re.findall(r"[\d.]+", row[2]) for form, row in results_table().items()}
    for form in (rb.Classic(), rb.Modified(), rb.Hybrid()):
        assert tuple(map(float, shown[form.name])) == form.printed


def test_bayes_factors_in_the_text__to_the_digits_shown(fits, on_elements):
    sweep = {name: exact_evidence(fits[name]) for name in ("hybrid", "modified")}
    shown = [float(text) for text in re.findall(r"ln BF = (\d+\.\d+)", TEXT)]
    assert shown == [
        round(sweep["hybrid"] - sweep["modified"], 2),
        round(on_elements["half-plane"] - on_elements["hybrid"], 1),
    ]
    between = on_elements["hybrid"] - on_elements["modified"]
    assert f"which beats Modified by {between:.2f} there" in TEXT
    fit = rb.calibrate(rb.reference_fe(), rb.HalfPlane(), noise="iid", rng=0)
    row = fit.summary.set_index("parameter")
    mean, sd = row.loc["c", ["mean", "sd"]]
    assert f"c = {mean:.4f} ± {sd:.4f}" in TEXT


def test_prior_sensitivity_in_the_text__to_the_digits_shown(fits):
    model = {name: fits[name].model for name in ("hybrid", "modified")}
    default = {name: exact_evidence(fits[name]) for name in model}
    ln_bf = []
    for scaled in (("c", "c1"), ("c2",), ("sigma",)):
        for factor in scale_factors(scaled[0]):
            new = {}
            for name, original in model.items():
                stretched = {
                    p: q.stretched(factor) for p, q in original.priors.items() if p in scaled
                }
                changed = original.with_priors(stretched)
                new[name] = quadrature_evidence(
                    changed.log_density, fit_laplace(changed), tol=1e-4
                ).value
            # The error model's prior is both forms'; coefficients are each form's own.
            together = scaled == ("sigma",)
            ways = [new] if together else [default | {name: new[name]} for name in model]
            ln_bf += [way["hybrid"] - way["modified"] for way in ways]
    low, high = re.search(r"move that from ([\d.]+) to (\d+\.\d+)", TEXT).groups()
    assert (float(low), float(high)) == (round(min(ln_bf), 1), round(max(ln_bf), 1))
