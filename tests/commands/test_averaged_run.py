"""Runs that average over error models: each of them printed once, written, and read back."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import ridgebayes as rb
from ridgebayes.commands.run_files import read_run, write_comparison, write_run_json
from ridgebayes.comparison.bands import bands_table, loads_table
from ridgebayes.comparison.compare import Execution, compare_with
from ridgebayes.errors import InputError
from ridgebayes.evidence.error_models import WeighedErrorModels, weigh_error_models
from ridgebayes.inference.presets import QUICK
from ridgebayes.model.noise import Noise

FORMS = ["modified", "hybrid"]
WHERE = {
    "textures": [(0.022, 0.02), (0.03, 0.015)],
    "loads": np.geomspace(2e-4, 0.01, 5),
    "compressed": True,
}
COMPARE = "ridgebayes.comparison.compare"
AHEAD = 1.2  # ln evidence by which a forced error model leads: those within 1.1 would do as well


@pytest.fixture(scope="module")
def table():
    """Three rows of three textures: Hybrid's loads as printed, times exp(0.03 z)."""
    rng = np.random.default_rng(7)
    rows = [
        (a, b, Q, float(rb.Hybrid().load(Q, a, b)) * np.exp(0.03 * rng.standard_normal()))
        for a, b in [(0.012, 0.03), (0.022, 0.02), (0.032, 0.01)]
        for Q in (4, 6, 8)
    ]
    frame = pd.DataFrame(rows, columns=["a_over_R", "b_over_R", "Q", "p_over_E"])
    return rb.ContactTable.from_frame(frame)


def ahead(name):
    """Weigh error models, and let one lead in every form."""

    def weigh(data, forms, noises, **known):
        found = dict(weigh_error_models(data, forms, noises, **known).candidates)
        for form in forms:
            values = [one.evidence.value for (own, _), one in found.items() if own == form.name]
            one = found[form.name, name]
            raised = replace(one.evidence, value=np.nanmax(values) + AHEAD, status="ok")
            found[form.name, name] = replace(one, evidence=raised)
        return WeighedErrorModels(found)

    return weigh


def compared(table, name, monkeypatch, others=("iid", "texture")):
    """Compare quickly with an error model printed; Student ones are not averaged over then."""
    noise = Noise.named(name)
    if noise.tail == "normal":
        weighed = [Noise.named(one) for one in dict.fromkeys([name, *others])]
        monkeypatch.setattr(f"{COMPARE}.error_models_for", lambda noise, data: weighed)
        monkeypatch.setattr(f"{COMPARE}.weigh_error_models", ahead(name))
    given = "auto" if noise.tail == "normal" else noise
    # Prior ranges are the same work whatever is printed: one error model's will do.
    execution = Execution(accuracy=QUICK, scores=name == "texture")
    return compare_with(execution, table, FORMS, noise=given, rng=2)


def written(comparison, folder):
    folder.mkdir()
    write_comparison(comparison, folder)
    write_run_json(folder, comparison, command="run", seed=2, options={}, stages=[], peak_memory=7)
    return folder


def content(folder):
    def refuse(constant):
        pytest.fail(f"{constant} is no JSON")

    text = (folder / "run.json").read_text(encoding="utf-8")
    return json.loads(text, parse_constant=refuse)


# Of Student tails one stands for all, which differ in their likelihood alone.
@pytest.mark.parametrize(
    "name",
    [
        pytest.param(
            noise.name,
            marks=[pytest.mark.long]
            if noise.tail != "normal" and noise.name != "iid:student"
            else [],
        )
        for noise in Noise.every()
    ],
)
def test_winner__each_error_model_is_printed_written_and_read_back(
    table, monkeypatch, tmp_path, name
):
    live = compared(table, name, monkeypatch)
    assert live.noise.name == name
    assert {fit.noise.name for fit in live.fits.values()} == {name}
    assert live.failures == {}
    is_average = ":" not in name
    for fit in live.fits.values():
        assert fit.posteriors[name] is fit
        assert sum(fit.error_model_weights.values()) == pytest.approx(1, rel=1e-14)
        assert (len(fit.averaged) > 1) == is_average
        assert max(fit.error_model_weights, key=fit.error_model_weights.get) == name
    folder = written(live, tmp_path / "run")
    others = {path.name for path in folder.glob("posteriors/*")}
    assert others == {
        f"{form}--{noise}.nc"
        for form, fit in live.fits.items()
        for noise in fit.error_model_weights
        if noise != name
    }
    again, bands = read_run(folder), bands_table(live, **WHERE)
    assert set(bands["noise"]) == {"average" if is_average else name}
    shown = bands_table(again, **WHERE)
    # Algebra: the same thinned draws; one that a logarithm and back moved may change sides.
    pd.testing.assert_frame_equal(bands, shown, rtol=0, atol=2.5e-3)
    smooth = bands["kind_of_band"] == "simulation"
    pd.testing.assert_frame_equal(bands[smooth], shown[smooth], rtol=0, atol=1e-9)
    loads = loads_table(again)
    assert set(loads["noise"]) == {"average" if is_average else name}
    for form, fit in again.fits.items():
        assert fit.error_model_weights == pytest.approx(
            live.fits[form].error_model_weights, rel=1e-12
        )
    mine, theirs = live.verdict, again.verdict
    assert (mine.form, mine.grade, mine.why) == (theirs.form, theirs.grade, theirs.why)
    assert theirs.ln_bf_range == pytest.approx(mine.ln_bf_range, rel=1e-9)
    told = content(folder)
    assert told["verdict"]["error_model"] == told["noise"] == name
    assert told["peak_memory_bytes"] == 7
    assert told["nugget"] == live.noise.nugget == again.noise.nugget == 1e-8
    weights = {(one["form"], one["noise"]): one["weight"] for one in told["fits"]}
    assert set(weights) == {
        (form, noise) for form, fit in live.fits.items() for noise in fit.error_model_weights
    }
    # Of pairs: what is left out has under one per cent of a form each.
    assert 0.9 < sum(weights.values()) < 1 + 1e-12


@pytest.fixture(scope="module")
def folder(table, tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        live = compared(table, "texture", patch, others=("iid", "step"))
    # One Student error model that is left to its twin.
    fit = live.fits["modified"]
    weights = {name: 0.9 * weight for name, weight in fit.error_model_weights.items()}
    student = {"texture:student": 0.1}
    fit = replace(
        fit, error_model_weights=weights | student, others={**fit.others, "texture:student": fit}
    )
    row = live.evidence.query("form == 'modified' and noise == 'texture' and used")
    value = row["log_evidence"] + np.log(student["texture:student"] / weights["texture"])
    extra = row.assign(noise="texture:student", log_evidence=value)
    evidence = pd.concat([live.evidence, extra], ignore_index=True)
    fits = {**live.fits, "modified": fit}
    return written(replace(live, fits=fits, evidence=evidence), tmp_path_factory.mktemp("a") / "b")


def test_run_json__says_what_a_student_error_model_is_left_to(folder):
    fits = {(one["form"], one["noise"]): one for one in content(folder)["fits"]}
    student = fits["modified", "texture:student"]
    assert student["left_to"] == "texture"
    weights = [fits["modified", noise]["weight"] for noise in ("texture:student", "texture")]
    lead = np.log(weights[0] / weights[1])
    assert lead < -1
    assert student["why"] == (
        f"left to texture: ln evidence {lead:+.1f} relative to it, so its weight is under 0.37 of "
        "the other's"
    )
    assert fits["modified", "texture"]["left_to"] is None
    assert not (folder / "posteriors/modified--texture-student.nc").exists()


def test_read_run__what_is_left_to_a_twin_adds_its_weight_there(folder):
    fit = read_run(folder).fits["modified"]
    weights = fit.error_model_weights
    assert weights["texture:student"] == pytest.approx(0.1, rel=0.02)
    together = weights["texture"] + weights["texture:student"]
    shares = [weight for posterior, weight in fit.averaged if posterior is fit]
    assert shares == [pytest.approx(together, rel=1e-14)]
    assert sum(weight for _, weight in fit.averaged) == pytest.approx(1, rel=1e-14)
    assert "texture:student" not in fit.posteriors


def test_summary__has_rows_of_every_posterior(folder):
    frame = pd.read_csv(folder / "summary.csv")
    again = read_run(folder)
    pairs = set(zip(frame["form"], frame["noise"], strict=True))
    assert pairs == {(form, noise) for form, fit in again.fits.items() for noise in fit.posteriors}
    assert set(frame.query("noise == 'texture'")["parameter"]) >= {"c", "sigma", "tau_texture"}


@pytest.mark.parametrize("damage", ["gone", "cut", "another"])
def test_read_run__a_damaged_posterior_of_an_average_is_named(folder, tmp_path, damage):
    run = shutil.copytree(folder, tmp_path / "run")
    path = run / "posteriors/hybrid--iid.nc"
    if damage == "gone":
        path.unlink()
    elif damage == "cut":
        path.write_bytes(path.read_bytes()[:1000])
    else:
        shutil.copy(run / "posteriors/modified--iid.nc", path)
    with pytest.raises(InputError, match=r"hybrid--iid\.nc"):
        read_run(run)


def test_read_run__a_posterior_under_another_error_model_than_its_name_is_refused(folder, tmp_path):
    run = shutil.copytree(folder, tmp_path / "run")
    shutil.copy(run / "posteriors/hybrid--step.nc", run / "posteriors/hybrid--iid.nc")
    with pytest.raises(InputError, match=r"hybrid--iid\.nc: holds error model 'step'"):
        read_run(run)
