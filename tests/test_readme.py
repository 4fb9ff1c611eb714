"""The README's numbers and names, and those of the page of results behind it."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.special import logsumexp

import ridgebayes as rb
from ridgebayes.evidence.prior_sensitivity import scale_factors
from ridgebayes.model.forms import FORMS, form_named
from tests.drawn import drawn_posterior, model_of

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
RESULTS = (ROOT / "docs" / "results.md").read_text(encoding="utf-8")


def test_readme__is_short():
    assert len(README.splitlines()) <= 120


TYPES = {
    "table": "rb.ContactTable",
    "fit": "rb.Fit",
    "q": "rb.QDistribution",
    "load": "rb.LoadDistribution",
    "weighed": "rb.Comparison",
    "fit.converged": "bool",
    "table.calibration": "rb.ContactTable",
    "rb.citations(fit)": "pd.DataFrame",
}


def test_library_block__is_fifteen_lines_that_type_checkers_understand(tmp_path):
    (block,) = re.findall(r"^```python\n(.*?)^```$", README, flags=re.MULTILINE | re.DOTALL)
    assert len([line for line in block.splitlines() if line]) <= 15
    asserted = "\n".join(f"assert_type({name}, {kind})" for name, kind in TYPES.items())
    program = f"from typing import assert_type\nimport pandas as pd\n{block}\n{asserted}\n"
    (tmp_path / "readme.py").write_text(program, encoding="utf-8")
    mypy = [sys.executable, "-m", "mypy", "--config-file", str(ROOT / "pyproject.toml")]
    words = ["--cache-dir", str(ROOT / ".mypy_cache"), str(tmp_path / "readme.py")]
    done = subprocess.run([*mypy, *words], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout


def table_of(text):
    """Return the cells of each row of the table of forms, by form."""
    rows = re.findall(r"^\| (\w[\w -]+) \| (.+) \|$", text, flags=re.MULTILINE)
    cells = {name.lower().replace(" ", "-"): rest.split(" | ") for name, rest in rows}
    return {name: row for name, row in cells.items() if name in FORMS}


def test_files_named__exist():
    named = re.findall(r"\]\((?!https)([\w./-]+)\)|`([\w-]+/[\w./-]*\.(?:ipynb|py))`", README)
    assert len(named) > 15
    for link, code in named:
        assert (ROOT / (link or code)).exists(), link or code


# The default run's evidences, with error models summed out, by fewer draws than its own.
def test_table__is_that_of_the_default_run(compare, paper):
    compared = compare(paper, rng=0, accuracy="quick")
    assert compared.noise.name == "step-smooth"
    n_noise = compared.evidence["noise"].nunique()
    used = compared.evidence.query("used").groupby("form")["log_evidence"]
    found = used.agg(lambda values: logsumexp(values) - np.log(n_noise))
    shown = table_of(README)
    assert list(shown) == list(found.sort_values(ascending=False).index)
    for form, (*_, fitted, evidence) in shown.items():
        # Three standard errors of the least draws, and a rounding.
        assert abs(number(evidence) - found[form]) < 0.2, form
        fit = compared.fits[form]
        for name, mean, sd in re.findall(r"(\w+) = ([\d.]+) ± ([\d.]+)", fitted):
            values = fit.draws[:, fit.model.parameter_names.index(name)]
            assert abs(float(mean) - values.mean()) < 0.2 * values.std(), (form, name)
            assert abs(float(sd) / values.std() - 1.0) < 0.2, (form, name)
    (ln_bf,) = re.findall(r"ln BF = ([\d.]+) over Modified", README)
    assert abs(float(ln_bf) - (found["hybrid"] - found["modified"])) < 0.2


def number(cell):
    return float(cell.strip("*"))


def evidence_of(model):
    """Return a log evidence by many draws, and what it may differ from two printed digits."""
    found = drawn_posterior(model, n_draw=2_048).evidence
    assert found.ok
    assert 0 < found.se < 0.01
    return found.value, 0.005 + 4 * found.se  # rounding, Monte Carlo


def test_results__have_every_form():
    assert sorted(table_of(RESULTS)) == sorted(FORMS)


@pytest.fixture(scope="module")
def on_elements():
    """Log evidence of each form on the finite-element rows that a run compares."""
    return {name: evidence_of(model_of(rb.reference_fe(), form_named(name))) for name in FORMS}


@pytest.mark.parametrize("form", ["classic", "power-law", "modified", "hybrid", "half-plane"])
def test_results_table__evidences_to_the_digits_shown(fits, on_elements, form):
    *_, sweep, fe = table_of(RESULTS)[form]
    value, slack = on_elements[form]
    assert abs(number(fe) - value) < slack < 0.03
    if form == "half-plane":
        with pytest.raises(rb.InputError, match="circular"):
            rb.calibrate(rb.paper_sweep(), rb.HalfPlane(), noise="iid")
    else:
        value, slack = evidence_of(fits[form].model)
        assert abs(number(sweep) - value) < slack < 0.03


@pytest.mark.parametrize("form", ["classic", "modified", "hybrid"])
def test_results_table__coefficients_to_the_digits_shown(fits, form):
    shown = re.findall(r"(\w+) = ([\d.]+) ± ([\d.]+)", table_of(RESULTS)[form][1])
    summary = fits[form].summary.set_index("parameter")
    assert [name for name, _, _ in shown] == list(fits[form].form.parameter_names)
    for name, mean, sd in shown:
        # Half a unit of the last digit, and three Monte Carlo errors.
        slack = 3 * summary.loc[name, "mcse_mean"]
        for text, value in ((mean, summary.loc[name, "mean"]), (sd, summary.loc[name, "sd"])):
            unit = 10.0 ** -len(text.partition(".")[2])
            assert abs(float(text) - value) <= 0.5 * unit + slack, (name, text, value)


def test_results_table__printed_coefficients_are_those_of_the_forms():
    shown = {form: re.findall(r"[\d.]+", row[2]) for form, row in table_of(RESULTS).items()}
    for form in (rb.Classic(), rb.Modified(), rb.Hybrid()):
        assert tuple(map(float, shown[form.name])) == form.published


def test_bayes_factors_in_the_text__to_the_digits_shown(fits, on_elements):
    sweep = {name: evidence_of(fits[name].model) for name in ("hybrid", "modified")}
    shown = [float(text) for text in re.findall(r"ln BF = (\d+\.\d+)", RESULTS)]
    shown += map(float, re.findall(r"which beats Modified by (\d+\.\d+) there", RESULTS))
    pairs = [
        (sweep["hybrid"], sweep["modified"], 0.0),
        (on_elements["half-plane"], on_elements["hybrid"], 0.05),  # one digit
        (on_elements["hybrid"], on_elements["modified"], 0.0),
    ]
    for text, ((one, slack), (other, more), rounding) in zip(shown, pairs, strict=True):
        assert abs(text - (one - other)) < slack + more + rounding
    fit = rb.calibrate(rb.reference_fe(), rb.HalfPlane(), noise="iid", rng=0)
    row = fit.summary.set_index("parameter")
    mean, sd = row.loc["c", ["mean", "sd"]]
    c, spread = map(float, re.search(r"with c = ([\d.]+) ± ([\d.]+)", RESULTS).groups())
    assert abs(c - mean) < 5e-5 + 4 * row.loc["c", "mcse_mean"]
    assert abs(spread - sd) < 5e-5 + 4 * row.loc["c", "mcse_mean"]


@pytest.mark.long
def test_prior_sensitivity_in_the_text__to_the_digits_shown(fits):
    model = {name: fits[name].model for name in ("hybrid", "modified")}
    default = {name: evidence_of(model[name])[0] for name in model}
    ln_bf = []
    for scaled in (("c", "c1"), ("c2",), ("sigma",)):
        for factor in scale_factors(scaled[0]):
            new = {}
            for name, original in model.items():
                stretched = {
                    p: q.stretched(factor) for p, q in original.priors.items() if p in scaled
                }
                changed = model_of(original.data, original.form, original.noise, stretched)
                new[name] = evidence_of(changed)[0]
            # The error model's prior is both forms'; coefficients are each form's own.
            together = scaled == ("sigma",)
            ways = [new] if together else [default | {name: new[name]} for name in model]
            ln_bf += [way["hybrid"] - way["modified"] for way in ways]
    low, high = re.search(r"move that from ([\d.]+) to (\d+\.\d+)", RESULTS).groups()
    # One printed digit, and four standard errors of two evidences.
    assert abs(float(low) - min(ln_bf)) < 0.1
    assert abs(float(high) - max(ln_bf)) < 0.1
