"""Runs that average over error models: each of them printed once, written, and read back."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import ridgebayes as rb
from ridgebayes import Noise
from ridgebayes.comparison.bands import bands_table, loads_table
from ridgebayes.evidence.pairs import WeighedPairs, weigh_pairs
from ridgebayes.report.figures.gallery import Gallery

FORMS = ["modified", "hybrid"]
WHERE = {"textures": [(0.022, 0.02), (0.03, 0.015)], "loads": np.geomspace(2e-4, 0.01, 5)}
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
        found = weigh_pairs(data, forms, noises, **known)
        weighed = dict(found.weighed)
        for form in forms:
            values = [one.evidence.value for (own, _), one in weighed.items() if own == form.name]
            one = weighed[form.name, name]
            raised = replace(one.evidence, value=np.nanmax(values) + AHEAD, status="ok")
            drawn = replace(one.drawn, evidence=raised)
            weighed[form.name, name] = replace(one, evidence=raised, drawn=drawn)
        return WeighedPairs(found.pairs, weighed)

    return weigh


def led_by(name, monkeypatch, others):
    """Let an error model be printed; Student ones are not averaged over in a quick run."""
    noise = Noise.named(name)
    if noise.tail != "normal":
        return name
    weighed = [Noise.named(one) for one in dict.fromkeys([name, *others])]
    monkeypatch.setattr("ridgebayes.request.error_models_for", lambda noise, n_series: weighed)
    monkeypatch.setattr("ridgebayes.request.weigh_pairs", ahead(name))
    return "auto"


def run(table, name, monkeypatch, folder, others=("iid", "texture")):
    """Do the whole job quickly in a folder; figures are drawn where rows are independent."""
    if not name.startswith("iid"):
        monkeypatch.setattr(Gallery, "file", lambda self, name, kind: b"")
    noise = led_by(name, monkeypatch, others)
    table.write(folder / "mine.csv")
    what = {"forms": FORMS, "noise": noise, "rng": 2, "accuracy": "quick", "workers": 1}
    return rb.run(folder / "mine.csv", folder / "run", **what)


def content(folder):
    def refuse(constant):
        pytest.fail(f"{constant} is no JSON")

    text = (folder / "run.json").read_text(encoding="utf-8")
    return json.loads(text, parse_constant=refuse)


SERIES = ("series", "step+series", "step-smooth+series", "step+series:student")


IN_MAKE_TEST = ("step+series",)  # and texture below


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[] if name in IN_MAKE_TEST else [pytest.mark.long])
        for name in (*(noise.name for noise in Noise.every()), *SERIES)
    ],
)
def test_winner__each_error_model_is_printed_written_and_read_back(
    table, monkeypatch, tmp_path, name
):
    if name in SERIES:
        table = rb.ContactTable.from_frame(table.frame.assign(series=[*"ab"] * 4 + ["a"]))
    live, folder = run(table, name, monkeypatch, tmp_path), tmp_path / "run"
    assert live.noise.name == name
    assert {fit.noise.name for fit in live.fits.values()} == {name}
    assert live.failures == {}
    is_average = ":" not in name
    for fit in live.fits.values():
        assert fit.posteriors[name] is fit
        assert sum(fit.error_model_weights.values()) == pytest.approx(1, rel=1e-14)
        assert (len(fit.averaged) > 1) == is_average
        assert max(fit.error_model_weights, key=fit.error_model_weights.get) == name
    others = {path.name for path in folder.glob("posteriors/*")}
    assert others == {
        f"{form}--{noise}.nc"
        for form, fit in live.fits.items()
        for noise in fit.error_model_weights
        if noise != name
    }
    again, bands = rb.read_run(folder), bands_table(live, **WHERE)
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
    assert told["peak_memory_bytes"] > 1e7
    assert live.verdict.error_model in (folder / "report.md").read_text(encoding="utf-8")
    assert "</html>" in (folder / "report.html").read_text(encoding="utf-8")
    assert "evidence.svg" in {path.name for path in folder.glob("figures/*")}
    assert told["nugget"] == live.noise.nugget == again.noise.nugget == 1e-8
    weights = {(one["form"], one["noise"]): one["weight"] for one in told["fits"]}
    assert set(weights) == {
        (form, noise) for form, fit in live.fits.items() for noise in fit.error_model_weights
    }
    # Weights are of pairs: each pair that is left out has under one per cent of its form.
    assert 0.9 < sum(weights.values()) < 1 + 1e-12


@pytest.mark.parametrize(
    ("forms", "n_texture", "noise", "why"),
    [
        (FORMS, 1, "iid", "hybrid and modified can predict the same loads"),
        (["modified", "power-law"], 3, "texture", "the same where each texture has an offset"),
    ],
)
def test_verdict__of_forms_that_predict_the_same_is_undecided_and_says_why(
    table, tmp_path, monkeypatch, forms, n_texture, noise, why
):
    monkeypatch.setattr(Gallery, "file", lambda self, name, kind: b"")
    table = rb.ContactTable.from_frame(table.frame.iloc[: 3 * n_texture])
    table.write(tmp_path / "mine.csv")
    what = {"forms": forms, "noise": noise, "rng": 2, "accuracy": "quick", "workers": 1}
    rb.run(tmp_path / "mine.csv", tmp_path / "run", **what)
    told = content(tmp_path / "run")["verdict"]
    assert told["grade"] == "undecided"
    assert why in told["why"]
    assert "only their priors differ" in told["why"]


@pytest.fixture(scope="module")
def folder(table, tmp_path_factory):
    made = tmp_path_factory.mktemp("a")
    with pytest.MonkeyPatch.context() as patch:
        run(table, "texture", patch, made, others=("iid", "step"))
    return made / "run"


def test_summary__has_rows_of_every_posterior(folder):
    frame = pd.read_csv(folder / "summary.csv")
    again = rb.read_run(folder)
    pairs = set(zip(frame["form"], frame["noise"], strict=True))
    assert pairs == {(form, noise) for form, fit in again.fits.items() for noise in fit.posteriors}
    assert set(frame.query("noise == 'texture'")["parameter"]) >= {"c", "sigma", "tau_texture"}


def test_components__are_written_read_back_and_in_the_report(folder):
    found = rb.read_run(folder).components
    pd.testing.assert_frame_equal(pd.read_csv(folder / "components.csv"), found, rtol=1e-12)
    assert found["component"].tolist() == ["texture", "step"]
    reading = found["reading"].iloc[0]
    rows = (folder / "report.md").read_text(encoding="utf-8").splitlines()
    (row,) = (row for row in rows if row.startswith("| Texture offsets |"))
    assert row.endswith(f"| {reading} |")


@pytest.mark.parametrize("damage", ["gone", "cut", "modified--iid", "hybrid--step"])
def test_read_run__a_damaged_posterior_of_an_average_is_named(folder, tmp_path, damage):
    run = shutil.copytree(folder, tmp_path / "run")
    path = run / "posteriors/hybrid--iid.nc"
    if damage == "gone":
        path.unlink()
    elif damage == "cut":
        path.write_bytes(path.read_bytes()[:1000])
    else:
        shutil.copy(run / f"posteriors/{damage}.nc", path)
    of_step = ": holds error model 'step'" if damage == "hybrid--step" else ""
    with pytest.raises(rb.InputError, match=rf"hybrid--iid\.nc{of_step}"):
        rb.read_run(run)
