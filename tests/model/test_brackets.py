"""Loads known between two steps, and counts seen at loads: what the posterior makes of them.

Posteriors of Hybrid with independent errors are summed over a grid of whitened coordinates, without
Monte Carlo error: doubling its points changes no digit that is compared here.
"""

import functools
from typing import NamedTuple

import numpy as np
import pandas as pd
import pytest
from scipy import stats

import ridgebayes as rb
from ridgebayes.inference.importance_sampling import importance_posterior
from ridgebayes.inference.laplace import fit_laplace
from ridgebayes.model.model import Model
from ridgebayes.model.noise import Noise
from ridgebayes.model.observations import Observations

PHASES = np.arange(8) / 8
TRUTH = np.array([1.348, 0.01583, 0.03])


class Posterior(NamedTuple):
    """Moments of c1, c2 and sigma; log load by the form but for its shape, mean over the rows."""

    mean: np.ndarray
    sd: np.ndarray
    log_load: float


def posterior(table):
    model = Model(Observations.from_table(table), rb.Hybrid())
    laplace = fit_laplace(model)
    axis = np.arange(-7, 7.1, 0.7)
    z = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    u, log_jacobian = laplace.unwhiten(z)
    log_weight = model.log_density(u) + log_jacobian
    weight = np.exp(log_weight - log_weight.max())
    weight /= weight.sum()
    theta = model.to_theta(u)
    mean = weight @ theta
    log_rates = (weight @ model.log_rates(theta))[model.data.texture]
    return Posterior(mean, np.sqrt(weight @ (theta - mean) ** 2), float(-2 * log_rates.mean()))


def sweep():
    return rb.paper_sweep().calibration.frame


def stepped(increment, phase, *, bracket=True):
    """The sweep as a solver sees it that raises the load by `increment` at each step."""
    frame, step = sweep(), np.log1p(increment)
    k = np.ceil(np.log(frame["p_over_E"]) / step - phase)
    assert np.all(frame["p_over_E"] <= np.exp((k + phase) * step) * (1 + 1e-12))
    frame["p_over_E"] = np.exp((k + phase) * step)
    if bracket:
        frame["p_over_E_lower"] = np.exp((k - 1 + phase) * step)
    return rb.read_table(frame)


@functools.cache
def exact():
    return posterior(rb.paper_sweep())


@functools.cache
def over_phases(increment, bracket):
    return [posterior(stepped(increment, phase, bracket=bracket)) for phase in PHASES]


def average(found, field):
    return np.mean([getattr(each, field) for each in found], axis=0)


@pytest.mark.slow
@pytest.mark.parametrize("increment", [0.01, 0.05, 0.20])
def test_upper_ends_taken_as_loads_are_half_an_increment_too_high(increment):
    found = over_phases(increment, False)
    late = average(found, "log_load") - exact().log_load
    # Discretisation: eight phases leave a sixteenth of a step a row, either way.
    assert late == pytest.approx(np.log1p(increment) / 2, rel=0.05)
    # The rate goes as one over the root of the load, and both coefficients with it.
    c1 = average(found, "mean")[0] / exact().mean[0]
    assert np.log(c1) == pytest.approx(-np.log1p(increment) / 4, rel=0.15)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("increment", "on_average", "in_each"),
    # In posterior sds of the exact fit. The place within a bracket is lost, 0.29 increments each
    # way, sigma is 2.7 %: one phase moves means by 0.1, 0.5 and, at 20 %, by two sds as a typical
    # value; eight average most of it out. Upper ends are off by 0.3, 1.5 and 6 sds in every phase.
    [(0.01, 0.05, 0.4), (0.05, 0.1, 1.0), (0.20, 0.3, 3.5)],
)
def test_brackets_have_no_such_bias(increment, on_average, in_each):
    found = over_phases(increment, True)
    apart = np.array([(each.mean - exact().mean)[:2] / exact().sd[:2] for each in found])
    assert np.abs(apart.mean(axis=0)).max() < on_average
    assert np.abs(apart).max() < in_each
    late = average(found, "log_load") - exact().log_load
    assert abs(late) < 0.02 * np.log1p(increment) / 2


@pytest.mark.slow
@pytest.mark.parametrize("increment", [0.01, 0.05, 0.20])
def test_brackets_widen_the_posterior_by_what_they_leave_open(increment):
    wider = average(over_phases(increment, True), "sd")[0] / exact().sd[0]
    # Were the place within a bracket an error of its own, it would add width^2/12 to sigma^2; it
    # is told apart from it only so far, and sigma, less known, has the longer tail.
    added = np.log1p(increment) / np.sqrt(12) / exact().mean[2]
    assert wider == pytest.approx(np.sqrt(1 + added**2), rel=0.15)  # an approximation


def test_brackets_tend_to_the_exact_loads_as_steps_shrink():
    apart = [
        np.abs(posterior(stepped(increment, 0.3)).mean - exact().mean) / exact().sd
        for increment in (1e-2, 1e-3, 1e-4)
    ]
    assert apart[0].max() < 0.2
    assert apart[1].max() < 0.02
    assert apart[2].max() < 0.01


@pytest.mark.slow
def test_brackets_centred_at_the_loads_err_by_the_square_of_their_width():
    def apart(width):
        frame = sweep()
        frame["p_over_E_lower"] = frame["p_over_E"] * np.exp(-width / 2)
        frame["p_over_E"] *= np.exp(width / 2)
        return posterior(rb.read_table(frame)).mean - exact().mean

    # The density within a bracket is that of a sigma^2 larger by width^2/12: sigma makes room.
    assert apart(0.005)[2] == pytest.approx(-(0.005**2) / 24 / exact().mean[2], rel=0.1)
    # Truncation: the next term is (width / sigma)^2, some per cent, beside this one.
    assert apart(0.01)[2] / apart(0.005)[2] == pytest.approx(4, rel=0.02)
    assert np.abs(apart(0.01) / exact().sd)[:2].max() < 1e-3


def test_brackets_of_no_width_are_exact_rows():
    frame = sweep()
    frame["p_over_E_lower"] = frame["p_over_E"]
    for found, expected in zip(posterior(rb.read_table(frame)), exact(), strict=True):
        np.testing.assert_array_equal(found, expected)


def test_brackets_beside_exact_rows_are_each_taken_for_what_they_are():
    frame, whole = stepped(0.05, 0.3).frame, sweep()
    known = np.arange(len(frame)) % 3 == 0
    frame.loc[known, "p_over_E"] = whole.loc[known, "p_over_E"]
    frame.loc[known, "p_over_E_lower"] = np.nan
    table = rb.read_table(frame)
    model = Model(Observations.from_table(table), rb.Hybrid())
    c1, c2, sigma = theta = np.array([1.33, 0.02, 0.028])
    rate = c1 / (frame["a_over_R"] + frame["b_over_R"]) + c2 / frame["a_over_R"]
    predicted = 2 * np.log((frame["Q"] / 2 - 1) / rate)
    upper, lower = np.log(frame["p_over_E"]), np.log(frame["p_over_E_lower"])
    error = stats.norm(predicted, sigma)
    rows = np.where(known, error.logpdf(upper), np.log(error.cdf(upper) - error.cdf(lower)))
    assert model.log_likelihood(theta) == pytest.approx(rows.sum(), rel=1e-9)  # rounding of cdfs
    assert np.abs((posterior(table).mean - exact().mean) / exact().sd).max() < 1


@pytest.mark.slow
def test_brackets_with_offsets_per_step_agree_with_the_exact_loads():
    def fitted(table):
        model = Model(Observations.from_table(table), rb.Hybrid(), Noise("step"))
        fit, _ = importance_posterior(model, seed=1, n_draw=512, n_round=3, n_per_round=300)
        assert fit.converged
        return model.is_latent, fit.summary.set_index("parameter").loc[["c1", "c2"]]

    (_, whole), (is_latent, found) = fitted(rb.paper_sweep()), fitted(stepped(0.01, 0.3))
    assert is_latent
    # With an offset per step sigma is 0.5 %, beside 0.29 % from the place within a bracket.
    assert (abs(found["mean"] - whole["mean"]) / whole["sd"]).max() < 0.7


def counted(rng):
    """Counts at 24 loads of each texture, each load with an error of its own."""
    loads = np.geomspace(5e-4, 0.02, 24)
    tables = []
    for a, b in rb.paper_sweep().calibration.textures:
        noisy = loads * np.exp(-TRUTH[2] * rng.standard_normal(len(loads)))
        Q = rb.Hybrid().count(noisy, a, b, theta=TRUTH[:2])
        tables.append(pd.DataFrame({"a_over_R": a, "b_over_R": b, "Q": Q, "p_over_E": loads}))
    return rb.read_table(pd.concat(tables, ignore_index=True).assign(kind="count"))


@pytest.mark.slow
def test_counts_alone_recover_the_coefficients():
    found = [posterior(counted(np.random.default_rng(seed))) for seed in range(4)]
    apart = np.array([(each.mean - TRUTH) / each.sd for each in found])
    # Monte Carlo: twelve standardised errors, rms 1 with a spread of 0.25 (c1 and c2 go together).
    assert 0.4 < np.sqrt((apart**2).mean()) < 1.6
    assert np.abs(apart).max() < 3.5
    assert np.abs(apart.mean(axis=0)).max() < 3 / np.sqrt(4)
    assert average(found, "sd")[0] < 0.02 * TRUTH[0]
