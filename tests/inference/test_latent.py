"""The integral over offsets against dense algebra, and against integrals by brute force."""

import numpy as np
import pytest
from scipy import stats

import ridgebayes as rb
from ridgebayes import Noise
from ridgebayes.inference.latent import LatentIntegral
from ridgebayes.inference.posterior import SharedOffsets, completed
from ridgebayes.model.model import Model
from tests import oracles

NORMAL = [noise.name for noise in Noise.candidates(2) if noise.tail == "normal"]
SHARED = [name for name in NORMAL if name != "iid"]
FORMS = {form.name: form for form in (rb.Modified(), rb.Hybrid(), rb.PowerLaw())}


@pytest.fixture(scope="module")
def table(observed):
    """Replicates in some cells, several known errors, a texture of few rows, three series."""
    rng, n = np.random.default_rng(1), 18
    texture = np.concatenate([[0, 1, 2, 3], rng.integers(0, 3, n - 4)])
    Q = 2 * rng.integers(2, 6, n)
    pitch = np.array([0.042, 0.042, 0.042, 0.063])[texture]
    load = 2 * np.log((Q / 2 - 1) * pitch / 1.38) + 0.05 * rng.standard_normal(n)
    rel_se = rng.choice([0.0, 0.01, 0.05], n)
    return observed(texture, Q, load, rel_se=rel_se, series=np.arange(n) // 3 % 3)


def some_draws(model, n=3, seed=2):
    return np.random.default_rng(seed).standard_normal((n, model.n_outer))


def densities(model, u, n_point=4, seed=0):
    integral = LatentIntegral(model)
    return integral.estimated(u, np.random.default_rng(seed), n_point).log_density


# --- normal rows ----------------------------------------------------------------------------------


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("noise", NORMAL)
def test_normal_rows__have_the_density_of_the_dense_covariance(table, noise, form):
    model = Model(table, FORMS[form], Noise.named(noise))
    u = some_draws(model)
    expected = [oracles.normal_log_density(model, one) for one in u]
    # Rounding: the dense covariance's condition of up to 1e8 or so, in the oracle.
    np.testing.assert_allclose(densities(model, u), expected, rtol=1e-8, atol=1e-7)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("noise", NORMAL)
def test_normal_rows__with_tiny_errors_are_those_of_exact_elimination(observed, noise, form):
    # Without a known error of their own, and so near to the form that sigma of 1e-7 is no outlier.
    places = ([0, 0, 1, 1, 2, 2], [4, 6, 4, 8, 4, 4])
    near = observed(*places, 0.0, series=[0, 1] * 3)
    model = Model(near, FORMS[form], Noise.named(noise))
    u = some_draws(model, 1)
    u[:, model.outer_names.index("sigma")] = model.priors["sigma"].score(np.array(1e-7))
    loads = oracles.log_loads(model, oracles.split(model, u[0])[0])
    loads = loads + 1e-7 * np.random.default_rng(3).standard_normal(6)
    model = Model(observed(*places, loads, series=[0, 1] * 3), FORMS[form], Noise.named(noise))
    expected = oracles.exact_log_density(model, u[0])
    # Rounding: of normal equations, whose condition is offsets' variance over that of errors.
    condition = oracles.covariance(model, oracles.split(model, u[0])[1]).max() / 1e-14
    assert densities(model, u)[0] == pytest.approx(expected, abs=1e-6 + 1e-15 * condition)


@pytest.mark.parametrize("noise", NORMAL)
def test_rows_given_others__are_those_of_the_dense_precision(table, noise):
    for form in FORMS.values():
        model = Model(table, form, Noise.named(noise))
        u = some_draws(model)
        found = LatentIntegral(model).rows_given_others(u)
        for one, values in zip(u, found, strict=True):
            residual, _, whole = oracles.dense(model, one)
            precision = np.linalg.inv(whole)
            variance = 1 / np.diag(precision)
            expected = stats.norm.logpdf(precision @ residual * variance, scale=variance**0.5)
            np.testing.assert_allclose(values, expected, rtol=1e-6, atol=1e-6)  # condition 1e8


@pytest.mark.parametrize("form", ["modified", "power-law"])
@pytest.mark.parametrize("noise", SHARED)
def test_draw__has_the_conditional_mean_and_covariance(table, noise, form):
    model, n = Model(table, FORMS[form], Noise.named(noise)), 5_000
    u, integral = some_draws(model, 1), LatentIntegral(model)
    scores = integral.draw(np.repeat(u, n, axis=0), np.random.default_rng(3))
    eta = model.outer_theta(u)[:, model.n_outer_coefficient :]
    root, k = model.offsets.root(eta), model.offsets.n_first
    offset = model.offsets.design.spread(*root.times(scores[:, :k], scores[:, k:]))
    residual, shared, whole = oracles.dense(model, u[0])
    gain = shared @ np.linalg.inv(whole)
    mean, covariance = gain @ residual, shared - gain @ shared
    sd = np.sqrt(np.diag(covariance))
    centred = offset - mean
    # Monte Carlo: the largest of 18 and of 171 normal values.
    assert np.all(np.abs(centred.mean(axis=0)) < 4 * sd / np.sqrt(n))
    products = centred[:, :, None] * centred[:, None, :]
    error = products.std(axis=0) / np.sqrt(n)
    assert np.all(np.abs(products.mean(axis=0) - covariance) < 4.5 * error)


@pytest.mark.parametrize("noise", ["iid", "texture", "texture+step", "step-smooth"])
def test_power_law__shares_a_textures_offset_with_log_k(table, noise):
    """Given their sum t, log K has the share 0.36 t / (0.36 + tau^2) of it, and its variance."""
    model, n = Model(table, rb.PowerLaw(), Noise.named(noise)), 20_000
    u = np.repeat(some_draws(model, 1), n, axis=0)
    whole = completed(model, u, np.empty((n, 0)), np.random.default_rng(4))
    k = model.n_coefficient
    theta = model.to_theta(whole[:, : model.n_parameter])
    slope = -2 * np.log(theta[:, :k] / [2 * 1.382 / (a + b) for a, b in table.textures])
    residual, _, covariance = oracles.dense(model, u[0])
    tau = theta[0, model.parameter_names.index("tau_texture")] if "texture" in noise else 0.0
    # By conditioning on the rows: K of each texture covaries with the rows of its texture.
    cross = 0.36 * (np.arange(k)[:, None] == table.texture)
    gain = cross @ np.linalg.inv(covariance)
    mean, variance = gain @ residual, 0.36 - (gain * cross).sum(axis=1)
    # Monte Carlo: means, and variances to 1 % each.
    assert np.all(np.abs(slope.mean(axis=0) - mean) < 4 * np.sqrt(variance / n))
    np.testing.assert_allclose(slope.var(axis=0), variance, rtol=4 * np.sqrt(2 / n))
    if tau:
        own = tau * whole[:, model.n_parameter : model.n_parameter + k]
        both = slope + own
        share = [np.polyfit(x, y, 1) for x, y in zip(both.T, slope.T, strict=True)]
        left = np.sqrt(0.36 * tau**2 / (0.36 + tau**2))
        error = left / both.std(axis=0) / np.sqrt(n)
        assert np.all(np.abs(np.array(share)[:, 0] - 0.36 / (0.36 + tau**2)) < 4 * error)


@pytest.mark.parametrize("noise", SHARED)
def test_shared_offsets__at_known_and_new_places_are_those_of_dense_conditioning(observed, noise):
    """Textures and steps with rows and without, of a new series, inside the range of rows."""
    rng, n = np.random.default_rng(6), 10_000
    texture, Q = np.array([0, 1, 2, 0, 1, 2, 0]), np.array([4, 4, 6, 6, 8, 12, 12])
    load = 2 * np.log((Q / 2 - 1) * 0.042 / 1.38) + 0.05 * rng.standard_normal(7)
    rows = observed(texture, Q, load, series=[0, 1, 0, 1, 0, 1, 0])
    model = Model(rows, rb.Modified(), Noise.named(noise))
    u = some_draws(model, 1)
    scores = LatentIntegral(model).draw(np.repeat(u, n, axis=0), rng)
    eta = np.repeat(model.outer_theta(u)[:, 1:], n, axis=0)
    shared, steps = SharedOffsets(model, eta, scores), np.array([4, 8, 10, 12])
    residual, _, whole = oracles.dense(model, u[0])
    for j, widths in enumerate((*rows.textures, (0.018, 0.02))):
        mean, variance = shared.at(widths, steps)
        ends = oracles.Ends(
            np.append(texture, [j] * 4), np.append(Q, steps), np.append(rows.series, [9] * 4)
        )
        more = observed(
            *ends[:2], -6.0, textures=(*rows.textures, (0.018, 0.02)), series=ends[2] % 3
        )
        joint = oracles.covariance(Model(more, rb.Modified(), model.noise), eta[0], ends)
        gain = joint[7:, :7] @ np.linalg.inv(whole)
        left = np.diag(joint[7:, 7:] - gain @ joint[:7, 7:])
        # Monte Carlo; the nugget of 1e-8 is of rows alone.
        sd = np.sqrt(left) + 1e-4
        assert np.all(np.abs(mean.mean(axis=0) - gain @ residual) < 4.5 * sd / np.sqrt(n))
        found = mean.var(axis=0) + variance.mean(axis=0)
        np.testing.assert_allclose(found, left, rtol=4.5 * np.sqrt(2 / n), atol=1e-8)


# --- Student errors, brackets and counts ----------------------------------------------------------

LOADS = {4: -6.98, 6: -5.6, 8: -4.79}  # of Modified at c = 1.38


@pytest.fixture(scope="module")
def tiny(observed):
    """Rows of each kind that share one or two offsets."""

    def rows(places, kinds, *, off=0.0, width=0.2):
        texture, Q = np.array(places).T
        load = np.array([LOADS[q] for q in Q.tolist()]) + off
        low = np.where(np.array(kinds) == "bracket", load - width, np.nan)
        is_count = np.array(kinds) == "count"
        return observed(texture, Q, load + 0.5 * is_count, log_lower=low, is_count=is_count)

    return rows


E, B, C = "exact", "bracket", "count"
TINY = {
    "texture:student": ([(0, 4), (0, 6), (0, 8)], [E] * 3, [0.0, 0.3, 0.0]),
    "texture:student, outliers": ([(0, 4), (0, 6), (0, 8)], [E] * 3, [0.6, 0.61, 0.59]),
    "texture": ([(0, 4), (0, 6), (0, 8)], [E, B, C], 0.0),
    "texture, two": ([(0, 4), (0, 6), (1, 8), (1, 4)], [B, C, B, E], 0.0),
    "step:student": ([(0, 4), (1, 4), (2, 4), (0, 6)], [E] * 4, [0.0, 0.3, 0.0, 0.1]),
    "step:student, outliers": ([(0, 4), (1, 4), (2, 4)], [E] * 3, [0.6, 0.61, 0.59]),
    "step": ([(0, 4), (1, 4), (2, 6)], [C, C, B], 0.0),
    "texture+step": ([(0, 4), (0, 4), (0, 4)], [B, E, E], [0.0, 0.05, 0.0]),
    "texture+step:student": ([(0, 4), (0, 4), (0, 4)], [B, E, E], [0.0, 0.3, 0.0]),
    "step-smooth": ([(0, 4), (0, 4), (0, 6)], [B, E, E], 0.0),
    "step-smooth:student": ([(0, 4), (0, 6), (0, 4)], [E, E, E], [0.0, 0.0, 0.2]),
}


BY_GRID = [(name, "modified") for name in TINY] + [
    (name, "power-law")
    for name in TINY
    if name not in ("step", "step:student") and "outliers" not in name
]  # the power law has more than two offsets, and a small sigma is below its grid's spacing


@pytest.mark.slow
@pytest.mark.parametrize(("name", "form"), BY_GRID)
def test_estimates__have_the_mean_that_brute_force_gives(tiny, name, form):
    places, kinds, off = TINY[name]
    noise = Noise.named(name.partition(",")[0])
    model = Model(tiny(places, kinds, off=np.array(off)), FORMS[form], noise)
    n = 4_000
    draws = some_draws(model, 2, seed=5)
    # Loads within the grid's reach, and the power law's sigma not below the grid's spacing.
    draws[:, : max(model.n_outer_coefficient, 1)] *= 0.2
    # Rows that agree far from the prior: a mode near them, and the mass where all are outliers.
    are_outliers = "outliers" in name
    draws[:, [model.n_outer_coefficient, -1]] -= 2 * are_outliers  # sigma and df
    for u in draws:
        expected = oracles.log_density_by_grid(model, u)
        ratio = np.exp(densities(model, np.repeat(u[None], n, axis=0), 16) - expected)
        # Monte Carlo: the largest of 32.
        assert abs(ratio.mean() - 1) < 4 * ratio.std() / np.sqrt(n) + 1e-9
        assert ratio.std() < (1.0 if are_outliers else 0.5)  # of 16 points
