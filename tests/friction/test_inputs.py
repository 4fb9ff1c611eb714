"""Joint draws: their counts against `predict`, their contacts against `contact_at_loads`."""

import json
import tracemalloc

import numpy as np
import pytest

import ridgebayes as rb
from ridgebayes import Noise
from ridgebayes.contact import two_scale
from ridgebayes.friction.files import write_inputs
from ridgebayes.friction.inputs import SMALL_STRAIN, InputDraws
from ridgebayes.model.forms import form_named
from ridgebayes.model.model import Model
from ridgebayes.model.observations import Observations
from ridgebayes.predict.q_distribution import mix_q
from ridgebayes.scene.scene import Texture
from tests.drawn import drawn_posterior

A, B = 0.022, 0.02


@pytest.fixture(scope="module")
def fit(fits):
    return fits["hybrid"]


class Average(rb.Fit):
    """Fits of several forms with weights, in the place of one fit."""

    averaged = None

    def __init__(self, averaged):
        object.__setattr__(self, "averaged", averaged)


@pytest.fixture(scope="module")
def average(paper):
    """Four forms, each under an error model of another kind, the power law's new K among them."""
    noises = {"hybrid": "texture+step", "power-law": "iid", "modified": "step-smooth"}
    noises["classic"] = "step:student"
    data = Observations.from_table(paper)
    models = [Model(data, form_named(form), Noise.named(noise)) for form, noise in noises.items()]
    parts = [rb.Fit.of(drawn_posterior(model, n_draw=128, n_point=16)) for model in models]
    return Average(list(zip(parts, (0.4, 0.3, 0.2, 0.1), strict=True)))


def predicted(source, a, b, loads, nu):
    parts, weights = zip(*source.averaged, strict=True)
    return mix_q([one.predict(a, b, loads, nu=nu) for one in parts], weights)


def assert_frequencies(counts, pmf, n):
    """Monte Carlo: within five standard errors, and what a thousand draws of offsets leave."""
    assert ((pmf > 0.05) & (pmf < 0.95)).any()
    se = np.sqrt(pmf * (1 - pmf) / n)
    assert np.all(np.abs(counts - pmf) < 5 * se + 2e-3)


@pytest.mark.slow
@pytest.mark.parametrize(
    "texture", [(0.022, 0.02), pytest.param((0.018, 0.045), marks=pytest.mark.long)]
)
def test_friction_inputs__counts_are_those_of_predict(average, texture):
    n, nu = 10_000, 0.4
    # Where one of the forms is in two minds.
    hybrid = average.averaged[0][0].predict_load(*texture, [4, 4, 6, 8, 10], nu=nu)
    loads = hybrid.median() * [0.98, 1.0, 1.0, 1.0, 1.1]
    drawn = rb.friction_inputs(average, rb.Scene.of([texture], nu=nu), loads, n=n, rng=2)
    q = predicted(average, *texture, loads, nu)
    assert_frequencies((drawn["Q"].values[..., None] == q.q).mean(axis=0), q.pmf, n)
    assert set(drawn["form"].values) == {"hybrid", "power-law", "modified", "classic"}
    assert np.all(np.diff(drawn["Q"].values, axis=1) >= 0)


def random_scene(rng, kind):
    """Return a scene at small strain or of two scales, and its load: centred or not."""
    a, b = np.exp(rng.uniform(np.log(0.008), np.log(0.05), 2)).tolist()
    texture = {"ridge_width": a, "groove_width": b}
    texture["offset"] = float(rng.choice([0.0, rng.uniform(-0.45, 0.45)]))
    if kind == "round":
        texture["corner_radius"] = float(rng.uniform(0.05, 0.3)) * a
    if kind == "drawn":
        texture |= {"ridge_width": f"lognormal({a}, 5 %)", "groove_width": f"lognormal({b}, 5 %)"}
    load = float(rng.uniform(0.5, 8)) * (a + b) ** 2
    body = {"poissons_ratio": float(rng.uniform(0, 0.5))}
    return rb.Scene.from_dict({"body": body, "texture": texture, "load": {"p_over_E": load}}), load


# Of ten scenes one has widths that are drawn, so many that their contacts are interpolated between
# textures, and two have round corners.
@pytest.mark.parametrize("n_scene", [4, pytest.param(200, marks=pytest.mark.long)])
def test_friction_inputs__contacts_are_those_of_their_scenes(fit, n_scene):
    rng = np.random.default_rng(5)
    for i in range(n_scene):
        kind = {1: "round", 5: "round", 9: "drawn"}.get(i % 10, "sharp")
        scene, load = random_scene(rng, kind)
        seed = int(rng.integers(1000))
        drawn = rb.friction_inputs(fit, scene, [load], n=40 if kind == "drawn" else 3, rng=seed)
        one = drawn.isel(draw=0, load=0)
        error, at = drawn.attrs["contact_relative_error"], float(one["p_over_E_mechanics"])
        widths = {name: float(one[name]) for name in ("a_over_R", "b_over_R")}
        texture = scene.textures[0].model_copy(update=widths)
        own = rb.Scene(textures=(texture,), nu=scene.nu)
        solver = "two-scale" if own.nu >= 0.3 else "half-plane"
        found = rb.contact_at_loads(own, [at], solver=solver, rel_tol=1e-8).iloc[0]
        assert found["Q"] == int(one["Q"])
        length = 2 * found["contact_fraction"] * found["half_width_over_R"]
        forces = rb.ridge_forces(own, [at], solver=solver, rel_tol=1e-8)
        expected = {
            "contact_length_over_R": length,
            "contact_fraction": found["contact_fraction"],
            "penetration_over_R": found["penetration_over_R"],
            "ridge_force_mean": 2 * load / found["Q"],
            "ridge_force_max": 2 * load * forces["share"].max(),
        }
        for name, value in expected.items():
            assert float(one[name]) == pytest.approx(value, rel=error, nan_ok=True), (own, name)


def test_friction_inputs__edges_are_those_of_edge_forces_scaled_to_the_load(fit):
    # Beside a transition, so that some draws have a count that the mechanics has at another load.
    load = 0.00905
    drawn = rb.friction_inputs(fit, rb.Scene.of([(A, B)]), [load], n=400, rng=1, edges=True)
    error = drawn.attrs["contact_relative_error"]
    for one in (
        drawn.isel(draw=int(np.argmin(drawn["Q"].values)), load=0),
        drawn.isel(draw=0, load=0),
    ):
        count = int(one["Q"])
        at = float(two_scale.half_plane_load(float(one["p_over_E_mechanics"])))
        exact = rb.edge_forces(rb.Scene.of([(A, B)]), [at])
        scale = load / at
        for name, column, factor in (
            ("edge_x", "x_over_R", 1.0),
            ("edge_K", "K", scale),
            ("edge_G", "G", scale**2),
        ):
            value = factor * exact[column].to_numpy()
            tolerance = 2 * error * np.abs(value).max()
            np.testing.assert_allclose(one[name].values[: 2 * count], value, atol=tolerance)
        assert one["edge_side"].values[: 2 * count].tolist() == exact["side"].tolist()
        assert not one["edge_side"].values[2 * count :].any()
    assert len(set(drawn["Q"].values.ravel().tolist())) > 1


def test_friction_inputs__of_a_largely_deformed_body_are_flagged_where_nothing_was_checked(fit):
    drawn = rb.friction_inputs(fit, rb.Scene.of([(A, B)]), [0.019, 0.3, 0.4], n=20, rng=7)
    assert not drawn["extrapolation"][:, 0].any()
    flags = drawn["extrapolation_of"].values
    assert ["strain" in text for text in flags[0]] == [False, False, True]
    # The body is softer than its half-plane: the mechanics reaches a count at a higher load.
    at = drawn["p_over_E_mechanics"].values[:, 1]
    assert (np.abs(at / 0.3 - 1) < 0.3).all()


def test_friction_inputs__tell_units_provenance_and_extrapolation(fit):
    scene = rb.Scene.of([(A, B)], p_over_E=0.0155).model_copy(update={"nu": 0.29})
    drawn = rb.friction_inputs(fit, scene, 31, n=50, rng=7)
    assert drawn["load"].values.tolist() == pytest.approx([i / 31 for i in range(1, 32)])
    np.testing.assert_allclose(drawn["p_over_E"][0], 0.0155 * drawn["load"])
    assert all("units" in drawn[name].attrs for name in drawn.data_vars)
    assert json.loads(drawn.attrs["scene"])["p_over_E"] == 0.0155
    assert drawn.attrs["seed"] == 7
    assert drawn.attrs["ridgebayes_version"] == rb.__version__
    strained = drawn["p_over_E"].values > SMALL_STRAIN
    assert strained.any()
    assert (drawn["extrapolation"].values == strained).all()
    assert set(drawn["extrapolation_of"].values[strained]) == {"strain"}
    # The energy's own relation, and the load that forces carry.
    carried = drawn["ridge_force_mean"] * drawn["Q"] / (2 * drawn["p_over_E"])
    np.testing.assert_allclose(carried, 1, rtol=1e-12)


def test_friction_inputs__the_same_seed_gives_the_same_draws(fit):
    scene = rb.Scene.of([(A, B)])
    one, same, other = (rb.friction_inputs(fit, scene, 3, n=60, rng=s) for s in (1, 1, 2))
    assert one.identical(same)
    assert not one["draw_index"].equals(other["draw_index"])


def test_input_draws__keep_nothing_of_a_draw(fit):
    scene = rb.Scene.from_dict(
        {
            "body": {"poissons_ratio": "uniform(0.3, 0.5)"},
            "texture": {"ridge_width": A, "groove_width": f"normal({B}, 3 %)", "offset": 0.1},
            "load": {"p_over_E": "lognormal(0.002, 10 %)"},
        }
    )
    tracemalloc.start()
    try:
        peaks = []
        for n in (2_000, 40_000):
            tracemalloc.reset_peak()
            InputDraws(fit, scene, 2, n=n, rng=1)
            peaks.append(tracemalloc.get_traced_memory()[1])
    finally:
        tracemalloc.stop()
    # Each number of each draw would be 300 kB more.
    assert peaks[1] < peaks[0] + 1e5


def test_input_draws__need_callables_that_draw_with_their_generator(fit):
    own = iter(np.linspace(0.9, 1.1, 4000) * B)
    texture = {"ridge_width": A, "groove_width": lambda _: next(own)}
    scene = rb.Scene.from_dict({"texture": texture, "load": {"p_over_E": 0.002}})
    draws = InputDraws(fit, scene, 1, n=40, rng=1)
    with pytest.raises(rb.InputError, match="a callable that draws only with its generator"):
        list(draws.blocks())


@pytest.mark.parametrize(
    "suffix", [".nc", *(pytest.param(s, marks=pytest.mark.long) for s in (".csv", ".parquet"))]
)
def test_write_inputs__blocks_are_the_whole(fit, tmp_path, monkeypatch, suffix):
    import pandas as pd
    import xarray as xr

    monkeypatch.setattr("ridgebayes.friction.inputs._BLOCK", 7)
    make = lambda: InputDraws(fit, rb.Scene.of([(A, B)]), 2, n=20, rng=1, edges=True)  # noqa: E731
    whole = rb.friction_inputs(fit, rb.Scene.of([(A, B)]), 2, n=20, rng=1, edges=True)
    target = tmp_path / f"x{suffix}"
    write_inputs(make().blocks(), target)
    if suffix == ".nc":
        with xr.open_dataset(target, engine="h5netcdf") as found:
            xr.testing.assert_equal(found, whole)
            assert found.attrs["scene"] == whole.attrs["scene"]
        return
    read = pd.read_csv if suffix == ".csv" else pd.read_parquet
    frame = read(target)
    assert len(frame) == 2 * int(whole["Q"].sum())  # two edges a ridge
    first = frame[(frame["draw"] == 3) & (frame["load"] == 0.5)]
    np.testing.assert_allclose(first["edge_x"], whole["edge_x"][3, 0].dropna("edge"))


def test_write_inputs__netcdf_of_too_many_draws_is_refused_at_once(fit, tmp_path, monkeypatch):
    monkeypatch.setattr("ridgebayes.friction.files.LARGEST", 30_000)
    monkeypatch.setattr("ridgebayes.friction.inputs._BLOCK", 7)
    draws = InputDraws(fit, rb.Scene.of([(A, B)]), 2, n=1_000, rng=1)
    with pytest.raises(
        rb.InputError, match=r"x.nc: 1,000 draws of .* expected at most \d+ in NetCDF"
    ):
        write_inputs(draws.blocks(), tmp_path / "x.nc")
    assert not list(tmp_path.iterdir())


def test_friction_inputs__bad_input_is_one_clear_error(fit, tmp_path):
    scene = rb.Scene.of([(A, B)])
    two = rb.Scene.of([(A, B), (B, A)])
    for wanted, given, words in (
        (two, {}, "expected one texture, got 2"),
        (scene, {"loads": [0.01, -1.0]}, "loads: expected .* got -1.0"),
        (scene, {"loads": ["x"]}, "loads: expected a number of loads"),
        (scene, {"loads": 0}, "loads: expected 1 to"),
        (scene, {"n": 0}, "n: expected a whole number"),
        (rb.Scene(textures=(Texture(a_over_R=A, b_over_R=B, offset=0.5),)), {}, "counts are odd"),
    ):
        with pytest.raises(rb.InputError, match=words):
            rb.friction_inputs(fit, wanted, **given)
    with pytest.raises(rb.InputError, match=r"expected a file of .nc, .parquet, .csv"):
        write_inputs(rb.friction_inputs(fit, scene, 1, n=2), tmp_path / "x.xlsx")
