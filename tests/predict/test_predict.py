import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from scipy import special, stats

import ridgebayes as rb
from ridgebayes.model.prior_files import resolve_priors
from ridgebayes.predict.joint_draws import RatioLoads
from ridgebayes.predict.posterior_loads import PosteriorLoads
from ridgebayes.predict.q_distribution import mix_q
from tests.drawn import drawn_posterior, model_of

A, B = 0.022, 0.02
LOADS = np.geomspace(5e-4, 0.02, 25)


def counts_of_draws(fit, a, b, p):
    """Count rung by rung the transition loads that are at or below p, for each draw."""
    counts = np.full((len(fit.draws), len(p)), 2)
    for Q in range(4, 60, 2):
        load = fit.form.load(Q, a, b, fit.draws[:, :-1])
        counts[load[:, None] <= p] = Q
    return counts


@pytest.mark.parametrize("name", ["classic", "power-law", "modified", "hybrid"])
@pytest.mark.parametrize("nu", [0.5, 0.3])
def test_predict_q__simulation_is_what_brute_force_simulation_shows(fits, name, nu):
    fit = fits[name]
    q = fit.predict(A, B, LOADS, nu=nu)
    n = len(fit.draws)
    for step, Q in enumerate(q.q):
        # P(Q >= n) of one noise number each: the share of draws whose n-th load is at or below.
        rng = np.random.default_rng(step)
        mean = np.log(fit.form.load(Q, A, B, fit.draws[:, :-1], nu)) if Q > 2 else -np.inf
        y = mean + fit.draws[:, -1] * rng.standard_normal(n)
        share = (y[:, None] <= np.log(LOADS)).mean(axis=0)
        expected = q.survival[:, step]
        # Monte Carlo: five standard errors of a share of 10,240, and half a draw.
        se = np.sqrt(expected * (1 - expected) / n)
        assert np.all(np.abs(share - expected) <= 5 * se + 0.5 / n)


@pytest.mark.parametrize("name", ["power-law", "hybrid"])
def test_predict_q__curve_is_the_share_of_draws_with_that_count(fits, name):
    fit = fits[name]
    q = fit.predict(A, B, LOADS, kind="curve")
    counts = counts_of_draws(fit, A, B, LOADS)
    expected = (counts[..., None] == q.q).mean(axis=0)
    np.testing.assert_allclose(q.pmf, expected, atol=1e-12)  # algebra: shares of 10,240


@pytest.mark.parametrize("kind", ["simulation", "curve"])
@pytest.mark.parametrize("name", ["classic", "power-law", "modified", "hybrid"])
def test_predict_q__is_a_distribution_that_rises_with_load(fits, name, kind):
    q = fits[name].predict(0.012, 0.03, LOADS, kind=kind)
    assert np.all(q.survival[:, 0] == 1)
    assert np.all(np.diff(q.survival, axis=1) <= 0)
    assert np.all(np.diff(q.survival, axis=0) >= -1e-14)  # algebra: a mean of 10,240
    assert np.all(q.pmf >= 0)
    np.testing.assert_allclose(q.pmf.sum(axis=-1), 1, rtol=1e-13)
    assert q.survival[:, -1].max() < 1e-6  # the first count that is negligible ends the ladder
    assert np.all(np.diff(q.median()) >= 0)


def quick(paper, noise, form=None):
    model = model_of(paper, form or rb.Hybrid(), noise)
    return drawn_posterior(model, n_draw=128)


@pytest.mark.slow
@pytest.mark.parametrize(
    "noise", ["iid", "texture", "texture+step", "iid:student", "texture:student"]
)
def test_predict_q__of_very_many_loads_is_that_of_each(paper, noise):
    fit = quick(paper, noise)
    p = np.append(np.random.default_rng(2).uniform(0.003, 0.03, 30_000), [0.0, 0.012])
    nu = np.where(p > 0.02, 0.4, 0.5)
    many = fit.predict(A, B, p, nu=nu)
    few = fit.predict(A, B, p[::600], nu=nu[::600])
    n = few.survival.shape[-1]
    # Discretisation: a tenth of the standard error that the number of draws leaves.
    atol = 0.1 * 0.5 / np.sqrt(len(fit.draws))
    np.testing.assert_allclose(many.survival[::600, :n], few.survival, rtol=0, atol=atol)


@pytest.mark.slow
@pytest.mark.parametrize("noise", ["iid:student", "texture:student"])
def test_predictions__of_student_errors_are_the_average_of_student_distributions(paper, noise):
    model = model_of(paper, rb.Hybrid(), noise)
    fit = drawn_posterior(model, n_draw=2_560)
    q, load = fit.predict(A, B, LOADS), fit.predict_load(A, B, 8)
    rng, n = np.random.default_rng(3), len(fit.draws)
    offset = np.zeros(n)
    if noise.startswith("texture"):
        offset, variance = (x[:, 0] for x in fit.shared_offsets(1).at((A, B), np.array([8])))
        offset = offset + np.sqrt(variance) * rng.standard_normal(n)
    y = np.log(fit.form.load(8, A, B, fit.draws[:, :2])) + offset
    z = (np.log(LOADS) - y[:, None]) / fit.draws[:, 2, None]
    expected = special.stdtr(fit.draws[:, -1, None], z).mean(axis=0)
    # Monte Carlo: the quoted error of 0.005.
    assert np.abs(q.at_least(8) - expected).max() < 0.005
    assert np.abs(cdf_at(load, LOADS) - expected).max() < 0.005
    assert float(load.mean()) == float(load.std()) == np.inf


def test_predict_q__of_student_errors_has_no_count_of_more_than_the_whole_width(observed):
    wide = ((0.3, 0.3), (0.2, 0.3))
    data = observed([0, 0, 1, 1], [4, 6, 4, 6], [-1.6, -0.2, -2.0, -0.6], textures=wide)
    priors = {"df": rb.Uniform(0.3, 0.6)}  # tails that reach any count
    model = model_of(data, rb.Modified(), "iid:student", priors)
    fit = drawn_posterior(model, n_draw=128)
    q = fit.predict(0.3, 0.3, [0.01, 1.0])  # a groove, and a ridge and half a groove beside it
    assert q.at_least(6).tolist() == [0, 0]
    assert np.all(q.at_least(4) > 0.01)
    assert fit.predict(0.9, 1.0, 1.0).at_least(4) == 0
    # A narrow texture's last count lies within the second block of eight.
    q = fit.predict(0.04, 0.04, 5.0)
    assert q.q[q.survival > 0][-1] == 26


def peak_of(work):
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.long
@pytest.mark.parametrize("kind", ["simulation", "curve"])
def test_predict_load__of_a_million_places_takes_little_memory(paper, kind):
    fit = quick(paper, "iid")  # 128 draws of 10^5 textures: 100 MB, and the same of errors
    share, pitch = np.linspace(0.3, 0.7, 250)[:, None], np.linspace(0.03, 0.06, 400)
    found = []

    def textures():
        load = fit.predict_load(share * pitch, (1 - share) * pitch, 6, kind=kind)
        found.append((load.median(), load.extrapolation))

    def counts():
        load = fit.predict_load(A, B, np.resize([4, 6, 8, 10], 10**6), kind=kind)
        found.append((load.interval(0.9)[1], load.extrapolation_of))

    assert peak_of(textures) < 5e7
    assert peak_of(counts) < 1.5e8
    few = fit.predict_load(share[::50] * pitch[::60], (1 - share[::50]) * pitch[::60], 6, kind=kind)
    np.testing.assert_allclose(found[0][0][::50, ::60], few.median(), rtol=1e-9)  # of a solver
    four = fit.predict_load(A, B, [4, 6, 8, 10], kind=kind).interval(0.9)[1]
    np.testing.assert_allclose(found[1][0][:4], four, rtol=1e-9)


@pytest.mark.parametrize("name", ["hybrid", "power-law"])
def test_predict_load__takes_a_poissons_ratio_of_each_place(fits, name):
    fit = fits[name]
    mixed = fit.predict_load(A, B, [4, 6, 6], nu=[0.5, 0.3, 0.0]).median()
    apart = [fit.predict_load(A, B, q, nu=nu).median() for q, nu in ((4, 0.5), (6, 0.3), (6, 0.0))]
    np.testing.assert_allclose(mixed, apart, rtol=1e-9)  # solver


def test_predict_q__flags_what_was_not_calibrated(fits):
    fit = fits["hybrid"]
    # Calibrated: a/pitch from 0.286 to 0.762, a/R 0.012 to 0.032, b/R 0.01 to 0.03, p/E to 0.02.
    a = [0.012, 0.033, 0.22, 0.012, 0.04, 0.0079, 0.022]
    b = [0.03, 0.03, 0.20, 0.09, 0.01, 0.007, 0.02]
    p = [0.001, 0.001, 0.001, 0.001, 0.001, 0.001, 0.021]
    q = fit.predict(a, b, p)
    expected = ["", "", "a/R,b/R", "a/pitch,b/R", "a/pitch", "a/R", "load"]
    assert q.extrapolation_of().tolist() == expected
    assert q.extrapolation().tolist() == [text != "" for text in expected]
    highest = int(fit.model.data.Q.max())
    load = float(fit.form.load(highest + 4, A, B, fit.draws.mean(axis=0)[:-1]))
    q = fit.predict(A, B, [1e-3, load])
    assert q.extrapolation().tolist() == [False, True]
    assert q.extrapolation_of().tolist() == ["", "Q,load"]


K_PRIORS = {
    "lognormal(auto, 5 %)": rb.LogNormal(2 * 1.382 / 0.045, 0.05),
    "lognormal(40, 1 %)": rb.LogNormal(40.0, 0.01),
}


def power_law(data, given):
    """Return a power law's posterior under priors of K."""
    priors = resolve_priors(
        {"power-law": given}, [rb.PowerLaw()], [model_of(data, rb.PowerLaw()).noise], data
    )["power-law"]
    model = model_of(data, rb.PowerLaw(), priors=priors)
    return drawn_posterior(model, n_draw=640)


@pytest.fixture(scope="module")
def two_textures(observed):
    data = observed([0, 0, 1, 1], [4, 6, 4, 6], [-6.9, -5.5, -7.0, -5.6])
    return replace(data, labels=("x", "y"))


@pytest.mark.parametrize("text", K_PRIORS)
def test_predict_q__power_law_draws_a_new_textures_K_from_the_prior_that_was_given(
    two_textures, tmp_path, text
):
    fit = power_law(two_textures, {"K": text})
    fit.to_netcdf(tmp_path / "p.nc")
    a, b = 0.02, 0.025
    prior = K_PRIORS[text]
    K = prior.value_at(np.linspace(-2.0, 2.0, 9))
    loads, exact = (4 / K) ** 2, stats.norm.sf(prior.score(K))  # Q >= 6 where K sqrt(p) >= 4
    share = 1 / len(fit.draws) + 1e-12  # one draw in each stratum; rounding
    for one in (fit, rb.Fit.from_netcdf(tmp_path / "p.nc")):
        q = one.predict(a, b, loads, kind="curve")
        assert np.all(np.abs(q.at_least(6) - exact) <= share)
        assert all("texture" in names for names in q.extrapolation_of())
    one = power_law(two_textures, {"K[x]": text}).predict(a, b, loads, kind="curve")
    default = stats.norm.cdf((np.log(2 * 1.382 / (a + b) * np.sqrt(loads) / 4)) / 0.3)
    assert np.all(np.abs(one.at_least(6) - default) <= share)


def test_loads_of_new_ones__go_with_the_pitch_only_if_the_prior_of_K_does(two_textures):
    for given in ({}, {"K": "lognormal(auto, 5 %)"}):
        PosteriorLoads(power_law(two_textures, given)).check_scaling(0.4)
    fit = power_law(two_textures, {"K": "lognormal(40, 1 %)"})
    with pytest.raises(rb.InputError, match="prior of K in proportion to the pitch"):
        PosteriorLoads(fit).check_scaling(0.4)


def cdf_at(load, loads):
    return np.array([float(load.cdf(p)) for p in loads])


@pytest.mark.parametrize("kind", ["simulation", "curve"])
def test_predict_load__and_predict_q_are_two_views_of_one_distribution(fits, kind):
    fit = fits["hybrid"]
    q = fit.predict(A, B, LOADS, kind=kind)
    for Q in (4, 8):
        load = fit.predict_load(A, B, Q, kind=kind)
        np.testing.assert_allclose(
            cdf_at(load, LOADS), q.at_least(Q), rtol=0, atol=1e-12
        )  # algebra


def test_predict_load__has_the_mean_of_brute_force_simulation(fits):
    fit = fits["hybrid"]
    load = fit.predict_load(A, B, 6, nu=0.3)
    rng = np.random.default_rng(1)
    theta, sigma = fit.draws[:, :2], fit.draws[:, 2]
    slope = theta[:, 0] / (A + B) + theta[:, 1] / A
    simulated = (
        (2 / slope) ** 2 * 0.75 / (1 - 0.09) * np.exp(sigma * rng.standard_normal(len(sigma)))
    )
    se = simulated.std() / np.sqrt(10_240)  # Monte Carlo: 4.5 standard errors of the noise
    assert abs(float(load.mean()) - simulated.mean()) < 4.5 * se
    quantiles = np.quantile(simulated, [0.05, 0.95])
    np.testing.assert_allclose(load.interval(0.9), quantiles, rtol=0.01)  # Monte Carlo: 5 se
    assert float(load.cdf(load.median())) == pytest.approx(0.5, abs=1e-8)


def test_predict_load__keeps_textures_and_counts_apart_and_flags_them(fits):
    fit = fits["hybrid"]
    a, b = np.array([[0.012], [0.012]]), np.array([[0.03], [0.09]])
    load = fit.predict_load(a, b, [4, 100])
    assert load.median().shape == (2, 2)
    # Classic mechanics: the load of Q = 100 is (49 L / 1.38)^2, far above 0.02.
    expected = [["", "Q,load"], ["a/pitch,b/R", "Q,load,a/pitch,b/R"]]
    assert load.extrapolation_of.tolist() == expected
    assert load.extrapolation.tolist() == [[False, True], [True, True]]
    one = fit.predict_load(0.012, 0.09, 4)
    assert float(one.median()) == pytest.approx(float(load.median()[1, 0]), rel=1e-9)


def test_mix_q__flags_what_a_part_that_counts_flags(fits):
    new = (0.02, 0.025)  # inside the ratios, but without a K
    parts = [fits[name].predict(*new, LOADS) for name in ("hybrid", "power-law")]
    assert {"texture" in names for names in mix_q(parts, [0.9, 0.1]).extrapolation_of()} == {True}
    # The last load alone is above every calibrated one.
    light = mix_q(parts, [0.999, 0.001]).extrapolation_of()
    assert light.tolist() == [*[""] * 24, "load"]


def test_mix_q__of_a_hundred_alike_flags_what_all_flag(fits):
    part = fits["hybrid"].predict(0.25, 0.25, LOADS[:3])
    assert mix_q([part] * 101, [1.0] * 101).extrapolation().all()  # none weighs 1 %


WIDTH, LOAD, COUNT = (
    f"expected {rule}, .*, got "
    for rule in ("finite and > 0", "finite and >= 0", "even and at least 4")
)


@pytest.mark.parametrize(
    ("where", "how", "expected"),
    [
        *(((bad, B, 0.01), {}, f"a_over_R: {WIDTH}{bad}") for bad in (0.0, -0.01, np.nan)),
        ((A, np.inf, 0.01), {}, f"b_over_R: {WIDTH}inf"),
        *(((A, B, bad), {}, f"p_over_E: {LOAD}{bad}") for bad in (-1e-3, np.nan, np.inf)),
        ((A, B, 0.01), {"kind": "band"}, "expected one of curve, simulation, got 'band'"),
        ((A, B, 0.01), {"nu": 0.6}, "nu: expected 0 <= nu <= 0.5, got 0.6"),
        ((A, B, 0.01), {"nu": "soft"}, "nu: expected numbers, got 'soft'"),
        (("wide", B, 0.01), {}, "a_over_R: expected numbers, got 'wide'"),
        ((A, B, True), {}, "p_over_E: expected numbers, got True"),
        ((A, B, np.ma.array([0.01, 0.02], mask=[0, 1])), {}, f"p_over_E: {LOAD}masked"),
        (([A, A], [B] * 3, 0.01), {}, r"broadcast, got a_over_R \(2,\), b_over_R \(3,\)"),
        ((A, B, [0.01] * 2), {"nu": [0.5] * 3}, r"broadcast, got nu \(3,\), p_over_E \(2,\)"),
    ],
)
def test_predict__refuses_bad_places(fits, where, how, expected):
    with pytest.raises(rb.InputError, match=expected):
        fits["modified"].predict(*where, **how)


@pytest.mark.parametrize(
    ("where", "how", "expected"),
    [
        ((0.0, B, 4), {}, f"a_over_R: {WIDTH}0.0"),
        *(((A, B, bad), {}, f"Q: {COUNT}{bad}") for bad in (2, 5, np.nan)),
        ((A, B, 4), {"kind": "band"}, "expected one of curve, simulation, got 'band'"),
        ((A, B, 4), {"nu": 0.6}, "nu: expected 0 <= nu <= 0.5, got 0.6"),
        ((A, [B] * 2, [4, 6, 8]), {}, r"broadcast, got b_over_R \(2,\), Q \(3,\)"),
    ],
)
def test_predict_load__refuses_bad_places(fits, where, how, expected):
    with pytest.raises(rb.InputError, match=expected):
        fits["modified"].predict_load(*where, **how)


def test_predictions__of_data_arrays_meet_by_name_and_come_back_named(fits):
    a = xr.DataArray([0.012, A], dims="texture", coords={"texture": ["narrow", "wide"]})
    p = xr.DataArray([[0.002, 0.003], [0.009, 0.01], [0.012, 0.02]], dims=("load", "texture"))
    q = fits["hybrid"].predict(a, B, p, nu=xr.DataArray(0.3))
    expected = fits["hybrid"].predict(a.values[:, None], B, p.values.T, nu=0.3)
    for named, values in (
        (q.mean(), expected.mean()),
        (q.at_least(6), expected.at_least(6)),
        (q.cdf(6), expected.cdf(6)),
        (q.interval(0.9)[1], expected.interval(0.9)[1]),
        (q.extrapolation_of(), expected.extrapolation_of()),
    ):
        assert named.dims == ("texture", "load")
        assert named.texture.values.tolist() == ["narrow", "wide"]
        assert named.values.tolist() == values.tolist()
    assert q.to_dataframe().equals(expected.to_dataframe())
    counts = xr.DataArray([4, 6, 8], dims="Q", coords={"Q": [4, 6, 8]})
    load, wide = fits["hybrid"].predict_load(a, B, counts), fits["hybrid"].predict_load(A, B, 8)
    for ask in ("median", "std"):
        here = getattr(load, ask)().sel(texture="wide", Q=8)
        assert float(here) == pytest.approx(float(getattr(wide, ask)()), rel=1e-9)
    assert load.extrapolation.dims == load.cdf(0.01).dims == ("texture", "Q")
    with pytest.raises(rb.InputError, match="b_over_R: expected a number or a DataArray beside"):
        fits["hybrid"].predict(a, [B, B], p)
    other = a.assign_coords(texture=["narrow", "far"])
    with pytest.raises(rb.InputError, match="expected DataArrays with equal coordinates"):
        fits["hybrid"].predict(a, other, p)


@pytest.mark.slow
def test_predict__of_smooth_offsets_is_what_direct_simulation_of_a_dense_process_shows(paper):
    """The README's texture: each draw's Gaussian process by hand, then loads of 400 errors."""
    fit = drawn_posterior(model_of(paper, rb.Hybrid(), "step-smooth"), n_draw=160)
    rows, rng = fit.model.data, np.random.default_rng(5)
    a, b = rows.a_over_R[rows.texture], rows.b_over_R[rows.texture]
    x = np.stack([np.log(rows.Q / 2 - 1), a / (a + b)], axis=1)
    new = np.array([[np.log(8 / 2 - 1), 0.015 / 0.06]])
    beyond = np.maximum(np.maximum(x.min(axis=0) - new, new - x.max(axis=0)), 0)
    is_same, share = (np.abs(x[:, None] - x) < 1e-9).all(axis=-1), []
    for c1, c2, sigma, tau, *lengths in fit.draws:
        near, across = (
            tau**2 * np.exp(-0.5 * (((u[:, None] - x) / lengths) ** 2).sum(axis=-1))
            for u in (x, new)
        )
        # Without the nugget of 1e-8 this misses by 0.004: sigma is smaller still.
        near += sigma**2 * np.eye(len(x)) + 1e-8 * tau**2 * is_same
        left = rows.log_load - 2 * np.log((rows.Q / 2 - 1) / (c1 / (a + b) + c2 / a))
        mean = 2 * np.log(3 / (c1 / 0.06 + c2 / 0.015)) + across @ np.linalg.solve(near, left)
        variance = tau**2 - across @ np.linalg.solve(near, across.T) + sigma**2
        variance += tau**2 * (1 - np.exp(-0.5 * ((beyond / lengths) ** 2).sum()))
        loads = mean + np.sqrt(variance) * rng.standard_normal(400)
        share.append((loads <= np.log(0.016)).mean())
    predicted = float(fit.predict(0.015, 0.045, 0.016).at_least(8))
    load = fit.predict_load(0.015, 0.045, 8)
    of_draws = stats.norm.cdf((np.log(0.016) - load.log_mean) / load.sd)
    # Monte Carlo: four standard errors; the package draws an offset where this integrates over it.
    se = np.hypot(*(np.std(x) / len(x) ** 0.5 for x in (of_draws, share)))
    assert predicted == pytest.approx(np.mean(share), abs=4 * se)


@pytest.mark.parametrize("ratio", [0.002, 0.01, 0.3, 0.88])
def test_ratio_loads__are_those_of_each_ratio_also_where_some_draws_have_none(fe_fits, ratio):
    loads = PosteriorLoads(fe_fits["hybrid"])
    counts = np.array([4, 12])
    interpolated = RatioLoads(loads, 0.002, 0.9)
    location, sd = interpolated.at(ratio, slice(None), counts.tolist())
    exact, exact_sd = loads.at_ratio(ratio, counts)
    spacing = np.diff(interpolated._axis.nodes).max()
    beyond, _ = loads.at_ratio(special.expit(special.logit(ratio) + spacing), counts)
    root, exact_root, root_beyond = (np.exp(-0.5 * y) for y in (location, exact, beyond))
    # Discretisation: the root has a kink where a draw's rate passes 0. A cubic spline misses a kink
    # by about a tenth of the change over one node spacing.
    np.testing.assert_allclose(root, exact_root, atol=0.1 * np.abs(root_beyond - exact_root).max())
    np.testing.assert_allclose(sd, exact_sd, rtol=1e-9)
