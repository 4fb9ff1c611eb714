"""Evidences that are known to the printed digits: of the embedded sweep, and of `tests/data`.

Those of normal errors are by quadrature and by other samplers, which agree in the digits given;
those of Student errors by long runs of several samplers.
"""

import functools
from pathlib import Path

import numpy as np
import pytest

import ridgebayes as rb
from ridgebayes import Noise
from ridgebayes.evidence.pairs import weigh_pairs
from ridgebayes.inference.posterior import posterior_of
from ridgebayes.model.observations import Observations
from tests import oracles

DATA = Path(__file__).parents[1] / "data" / "engine"
FORMS = {form.name: form for form in (rb.Hybrid(), rb.Modified(), rb.Classic(), rb.PowerLaw())}
SWEEP = [
    ("hybrid", "iid", 83.387),
    ("hybrid", "texture", 81.952),
    ("hybrid", "texture+step", 128.890),
    ("hybrid", "step-smooth", 261.890),
    ("modified", "iid", 78.863),
    ("modified", "step-smooth", 241.576),
    ("classic", "iid", 19.199),
    ("classic", "step-smooth", 193.969),
    ("power-law", "iid", 57.158),
    ("power-law", "step-smooth", 203.40),
]
LONG = pytest.mark.long
STUDENT = [
    ("hybrid", "iid:student", 83.956),
    ("hybrid", "texture:student", 82.416),
    pytest.param("hybrid", "texture+step:student", 132.00, marks=LONG),
    ("modified", "texture+step:student", 122.82),
    ("power-law", "step-smooth:student", 203.27),
]
TABLES = [
    ("labs", "hybrid", "step-smooth+series", 241.670),
    ("labs", "modified", "step-smooth+series", 237.353),
    ("single-row", "power-law", "iid", 14.478),
    ("two-groups", "modified", "iid:student", -7.166),
    ("one-sided-outliers", "hybrid", "iid:student", 78.02),
    ("outlier", "hybrid", "iid:student", 59.487),
    ("outlier", "hybrid", "step:student", 73.91),
    ("outlier", "power-law", "step:student", 46.686),
]


@functools.cache
def rows_of(name):
    table = rb.paper_sweep() if name == "sweep" else rb.read_table(DATA / f"{name}.csv")
    return Observations.from_table(table)


def weighed(table, form, noise):
    found = weigh_pairs(rows_of(table), [FORMS[form]], [Noise.named(noise)], seed=0)
    return next(iter(found.weighed.values()))


@pytest.mark.parametrize(("form", "noise", "known"), SWEEP)
def test_evidence__of_the_sweep_under_normal_errors(form, noise, known):
    found = weighed("sweep", form, noise).evidence
    assert found.status == "ok"
    assert found.se < 0.02
    # Monte Carlo, and printed digits: three, or two where only so many are known.
    assert abs(found.value - known) < 4 * found.se + 1e-3


@pytest.mark.slow
@pytest.mark.parametrize(("form", "noise", "known"), STUDENT)
def test_evidence__of_the_sweep_under_student_errors(form, noise, known):
    found = weighed("sweep", form, noise).evidence
    assert found.status == "ok"
    assert found.se < 0.05
    assert abs(found.value - known) < 4 * found.se + 5e-3  # Monte Carlo, and printed digits


@pytest.mark.slow
@pytest.mark.parametrize(("table", "form", "noise", "known"), TABLES)
def test_evidence__of_tables_with_a_known_law(table, form, noise, known):
    found = weighed(table, form, noise).evidence
    assert found.se < 0.05
    assert abs(found.value - known) < 4 * found.se + 5e-3  # Monte Carlo, and printed digits
    assert found.status == "ok"


@pytest.mark.slow
def test_posterior__of_two_groups_has_its_share_in_the_narrow_modes():
    """Two narrow modes hold 14.6 % of the posterior; grids of four kinds agree."""
    drawn = weighed("two-groups", "modified", "iid:student").drawn
    c = np.exp(np.log(1.382) + 0.1 * drawn.u[..., 0].ravel())  # log-normal(1.382, 10 %)
    n = c.size * drawn.share
    for centre, share in ((1.30, 0.110), (1.62, 0.036)):
        found = np.mean(np.abs(c / centre - 1) < 0.006)
        # Monte Carlo: of draws that count; resampling adds up to as much again.
        assert abs(found - share) < 4 * np.sqrt(2 * share / n) + 5e-4


@pytest.mark.long
def test_evidence__of_independent_student_rows_is_that_of_a_grid(observed):
    texture, Q = np.repeat(np.arange(3), 2), np.tile([4, 6], 3)
    off = np.array([0.0, 0.01, -0.02, 0.3, 0.02, 0.0])
    data = observed(texture, Q, 2 * np.log((Q / 2 - 1) * 0.042 / 1.4) + off)
    found = weigh_pairs(data, [rb.Modified()], [Noise("iid", "student")], seed=1)
    one = found.weighed["modified", "iid:student"]
    model = found.pairs["modified", "iid:student"].target().model
    c, sigma = np.linspace(1.0, 1.9, 601), np.geomspace(1e-4, 0.3, 100)
    df = np.geomspace(0.05, 120, 60)
    value, mass = oracles.iid_posterior(model, [c, sigma, df])
    # Discretisation: doubling the points moves it by 1e-3.
    assert abs(one.evidence.value - value) < 4 * one.evidence.se + 2e-3
    draws = posterior_of(model, one.drawn, 1).draws
    error = 4 / np.sqrt(len(draws) * one.drawn.share)
    for i, grid in enumerate((c, sigma, df)):
        cdf = np.cumsum(mass.sum(axis=tuple({0, 1, 2} - {i})))
        below = np.searchsorted(np.sort(draws[:, i]), grid, side="right") / len(draws)
        assert np.abs(below - cdf).max() < 0.5 * error + 0.01  # half a step of the grid


@pytest.mark.parametrize(
    "noise",
    ["iid", "texture", *(pytest.param(n, marks=LONG) for n in ("iid:student", "step:student"))],
)
def test_evidence__of_a_bracket_and_a_count_that_contradict_each_other(observed, noise):
    # 4 was reached below exp(-7.0), and at exp(-7.3) 6 was seen.
    data = observed(
        [0, 0, 0],
        [4, 6, 6],
        [-7.0, -7.3, -5.6],
        log_lower=[-7.1, np.nan, np.nan],
        is_count=[False, True, False],
    )
    pair = weigh_pairs(data, [rb.Modified()], [Noise.named(noise)], seed=2)
    found = pair.weighed["modified", noise].evidence
    model = pair.pairs["modified", noise].target().model
    value, se = oracles.log_evidence_by_prior_draws(model)
    assert found.ok
    assert abs(found.value - value) < 4 * np.hypot(found.se, se)  # Monte Carlo of both


@pytest.mark.parametrize("apart", [0.06, 0.2])
def test_evidence__under_a_sample_of_two_clusters_as_prior_is_that_of_a_grid(observed, apart):
    rng = np.random.default_rng(1)
    clusters = np.concatenate([rng.normal(m, 0.01, 500) for m in (1.4 - apart, 1.4 + apart)])
    prior = rb.Empirical.of(clusters)
    texture, Q = np.repeat([0, 1], 2), np.tile([4, 6], 2)
    a, b = np.array([(0.012, 0.03), (0.032, 0.01)])[texture].T
    load = rb.Hybrid().load(Q, a, b, np.array([1.4, 0.0]))
    data = observed(texture, Q, np.log(load) + np.array([0.0, 0.05, -0.05, 0.02]))
    found = weigh_pairs(data, [rb.Hybrid()], [Noise()], priors={"hybrid": {"c1": prior}}, seed=3)
    evidence = found.weighed["hybrid", "iid"].evidence
    model = found.pairs["hybrid", "iid"].target().model
    # Scores of c1, so that the prior's own narrow shape is in no integrand; c2 evenly.
    u, c2 = np.linspace(-6, 6, 481), np.linspace(-0.2, 0.2, 321)
    sigma = np.geomspace(1e-4, 0.3, 160)
    c1 = prior.value_at(u)
    rate = c1[:, None, None] / (a + b) + c2[:, None] / a
    residual = data.log_load - 2 * np.log(Q / 2 - 1) + 2 * np.log(np.maximum(rate, 1e-9))
    square, total = (residual**2).sum(axis=-1), 0.0
    weight = np.exp(-0.5 * u**2) / np.sqrt(2 * np.pi)
    for s, width in zip(sigma, np.gradient(sigma), strict=True):
        rows = np.exp(-0.5 * square / s**2) * (2 * np.pi * s**2) ** -2
        over = weight @ rows @ np.exp(model.priors["c2"].log_pdf(c2))
        total += over * np.exp(model.priors["sigma"].log_pdf(s)) * width
    expected = np.log(total * (u[1] - u[0]) * (c2[1] - c2[0]))
    assert evidence.ok
    assert abs(evidence.value - expected) < 4 * evidence.se + 2e-3  # and discretisation


def test_loads_in_another_unit__are_fitted_far_from_the_prior():
    """Loads 60 times too high: c1 is sqrt(60) times too low."""
    frame = rb.paper_sweep().calibration.frame
    table = rb.read_table(frame.assign(p_over_E=60 * frame["p_over_E"]))
    fit = rb.calibrate(table, rb.Hybrid(), noise="iid", rng=1)
    assert fit.converged
    mean = fit.summary.set_index("parameter")["mean"]
    assert mean["c1"] == pytest.approx(0.174, abs=0.002)  # printed digits
    assert mean["sigma"] == pytest.approx(0.027, abs=0.003)
