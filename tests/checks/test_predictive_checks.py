import numpy as np
import pytest
from scipy import stats

import ridgebayes as rb
from ridgebayes.checks.predictive_checks import QUANTITIES, posterior_checks, prior_bands
from ridgebayes.model.replicated import simulate_log_loads
from tests.drawn import model_of, points_of
from tests.simulated import simulated

TRUTH = {"sigma": 0.01, "tau_texture": 0.04, "tau_step": 0.04}


def known(rows, noise="iid", form=None):
    """Return a fit all of whose draws are one set of parameters: p-values are then exact."""
    model = model_of(rows, form or rb.Modified(), noise)
    theta = [1.4, *(TRUTH[name] for name in model.noise.parameter_names)]
    return points_of(model, [theta] * 2_560)


def rows_of(paper, noise, seed, form=None):
    """Simulate the paper's places under the known parameters and an error model."""
    fit = known(paper, noise, form)
    data, theta = fit.model.data, fit.draws[0]
    return simulated(data, simulate_log_loads(fit.model, theta, np.random.default_rng(seed))[0])


def p_values(data, noise="iid"):
    return posterior_checks(known(data, noise), rng=2, n_draw=500).p_values


def test_p_values__are_uniform_where_the_model_made_the_rows(paper):
    found = [p_values(rows_of(paper, "texture+step", seed), "texture+step") for seed in range(120)]
    for name in QUANTITIES:
        values = np.array([each[name] for each in found])
        # Monte Carlo: one seed in 1,000 for each of five quantities.
        assert stats.kstest(values, "uniform").pvalue > 1e-3


@pytest.mark.parametrize(
    ("noise", "name"), [("texture", "texture spread"), ("step", "step spread")]
)
def test_p_values__see_offsets_that_the_error_model_lacks(paper, noise, name):
    found = np.array([p_values(rows_of(paper, noise, seed))[name] for seed in range(10)])
    assert (found < 0.01).mean() > 0.7


def test_p_values__see_an_outlier_a_trend_and_neighbours_that_alternate(paper):
    data = rows_of(paper, "iid", 1)
    plain = p_values(data)
    assert all(0.005 < p < 0.995 for p in plain.values())
    far = data.log_load.copy()
    far[3] += 0.1
    assert p_values(simulated(data, far))["largest residual"] < 0.005
    log_h = np.log(data.Q / 2 - 1)
    falling = data.log_load - 0.03 * (log_h - log_h.mean())
    assert p_values(simulated(data, falling))["trend"] > 0.995
    zigzag = data.log_load + 0.02 * (-1.0) ** (data.Q / 2 + data.texture)
    assert p_values(simulated(data, zigzag))["lag-1 correlation"] > 0.995


def test_quantities__by_hand(observed):
    # Two textures of three steps; residuals of the log loads, in sorted order of texture and Q.
    residual = np.array([0.03, 0.01, -0.02, 0.05, 0.0, -0.10])
    data = observed([0, 0, 0, 1, 1, 1], [4, 6, 8, 4, 6, 8], 0.0)
    curve = np.log(
        rb.Modified().load(data.Q, data.a_over_R[data.texture], data.b_over_R[data.texture], [1.4])
    )
    shuffled = np.array([4, 2, 0, 5, 1, 3])
    rows = observed(
        data.texture[shuffled],
        data.Q[shuffled],
        (curve + residual)[shuffled],
        textures=data.textures,
    )
    found = posterior_checks(known(rows), n_draw=3)
    values = dict(zip(found.names, found.observed[0], strict=True))
    assert found.observed.shape == found.replicated.shape == (3, 5)
    expected = {
        "largest residual": 0.1,
        "trend": np.polyfit(np.log([1, 2, 3, 1, 2, 3]), residual, 1)[0],
        "texture spread": np.std([0.02 / 3, -0.05 / 3], ddof=1),
        "step spread": np.std([0.04, 0.005, -0.06], ddof=1),
    }
    centred = residual - residual.mean()
    products = centred[[0, 1, 3, 4]] * centred[[1, 2, 4, 5]]
    expected["lag-1 correlation"] = products.mean() / (centred**2).mean()
    for name, value in expected.items():
        assert values[name] == pytest.approx(value, rel=1e-9)  # rounding


def test_rows_that_allow_little_are_checked_for_little(observed):
    one = posterior_checks(known(observed([0], [4], -6.0)), n_draw=5)
    assert one.names == ("largest residual",)
    curve = posterior_checks(known(observed([0, 0, 0], [4, 6, 8], -6.0)), n_draw=5)
    assert curve.names == ("largest residual", "trend", "step spread", "lag-1 correlation")


def test_brackets_and_counts_are_left_out(observed):
    rows = observed(
        [0, 0, 0, 1],
        [4, 6, 8, 2],
        [-7, -6, -5, -6],
        log_lower=[np.nan, -6.1, np.nan, np.nan],
        is_count=[False, False, False, True],
    )
    fit = known(rows)
    found = posterior_checks(fit, n_draw=4)
    assert np.isfinite(found.replicated).all()
    none = rows.take(~rows.is_exact)
    with pytest.raises(rb.InputError, match="no row gives its load exactly"):
        posterior_checks(known(none))


def test_prior_bands__are_those_of_the_prior(observed):
    model = model_of(observed([1, 0, 0, 0], [6, 6, 4, 4], -6.0, rel_se=0.0), rb.Modified())
    bands = prior_bands(model, rng=5, n_draw=40_000, prob=0.9)
    assert bands[["texture", "Q"]].to_numpy().tolist() == [
        ["a0.012_b0.03", 4],
        ["a0.012_b0.03", 6],
        ["a0.032_b0.01", 6],
    ]
    for row in bands.itertuples():
        at = np.log(rb.Modified().load(row.Q, row.a_over_R, row.b_over_R, [1.382]))
        # log load: -2 log c, sd 0.2, and an error normal given a half-normal sigma.
        rng = np.random.default_rng(6)
        error = np.abs(0.05 * rng.standard_normal(400_000)) * rng.standard_normal(400_000)
        by_hand = at + 0.2 * rng.standard_normal(400_000) + error
        expected = np.quantile(by_hand, [0.05, 0.5, 0.95])
        # Monte Carlo: a quantile's standard error is about 2 sd/sqrt(40,000), 0.002; four of them.
        np.testing.assert_allclose([row.lower, row.median, row.upper], expected, atol=0.008)
