"""Rows left out, against quadrature over every parameter with the likelihood typed out."""

from dataclasses import replace

import numpy as np
import pytest

from ridgebayes import ComputationError, Fit, HalfNormal, LogNormal, Modified, PowerLaw
from ridgebayes.inference import left_out
from ridgebayes.inference.importance import Effort
from ridgebayes.inference.left_out import AllRows
from tests.drawn import drawn_posterior, model_of
from tests.exact_evidence import modified_evidence, power_law_evidence

C, SIGMA = LogNormal(1.38, 0.1), HalfNormal(0.05)


def known(model):
    return AllRows.drawn(model, Effort(), 2)


@pytest.fixture(scope="module")
def rows(observed):
    """Modified's loads of four textures and six steps, with errors of 3 %."""
    texture, Q = np.repeat(np.arange(4), 6), np.tile(np.arange(4, 16, 2), 4)
    flat = observed(texture, Q, np.zeros(24))
    a, b = flat.a_over_R[texture], flat.b_over_R[texture]
    error = 0.03 * np.random.default_rng(1).standard_normal(24)
    return observed(texture, Q, np.log(Modified().load(Q, a, b, [1.38])) + error)


@pytest.fixture(scope="module")
def curved(rows, observed):
    """The same, but all first steps 0.3 too low: the rest does not tell of such errors."""
    return observed(rows.texture, rows.Q, rows.log_load - 0.3 * (rows.Q == 4))


@pytest.mark.parametrize(
    ("table", "by", "method"),
    [("rows", "texture", "weights"), ("rows", "Q", "weights"), ("curved", "Q", "evidences")],
)
def test_without__scores_rows_as_quadrature_does(request, table, by, method):
    data = request.getfixturevalue(table)
    all_rows = known(model_of(data, Modified(), priors={"c": C, "sigma": SIGMA}))
    order = np.argsort(all_rows.u[:, 0])  # resampling that loses one end of c then shows
    u, log_density = all_rows.u[order], all_rows.log_density[order]
    log_density[len(u) // 2] += 2000.0  # a draw of wrong density, beside which others would be 0
    all_rows = replace(all_rows, u=u, log_density=log_density)
    left = getattr(data, by) == {"texture": 2, "Q": 4}[by]
    found = all_rows.without(left, 3)
    everything, _ = modified_evidence(data)
    rest, mean = modified_evidence(data.take(~left))
    assert (found.method, found.status) == (method, "ok")
    assert found.log_score_se < 0.05
    # Monte Carlo: four standard errors; the mean has those of the fewest effective draws that
    # weights are accepted with, or of a hundred new draws.
    assert abs(found.log_score - (everything - rest)) < 4 * found.log_score_se
    log_c = np.log(found.posterior(1).draws[:, 0])
    n_effective = left_out._MIN_EFFECTIVE_SHARE * len(u) if method == "weights" else 100
    assert abs(log_c.mean() - mean) < 4 * log_c.std() / np.sqrt(n_effective)


@pytest.mark.parametrize(("most_k", "method"), [(0.7, "weights"), (-np.inf, "evidences")])
def test_without__a_texture_of_the_power_law_needs_no_draws_of_its_slope(
    rows, most_k, method, monkeypatch
):
    monkeypatch.setattr(left_out, "MAX_FINITE_VARIANCE_K", most_k)
    model = model_of(rows, PowerLaw())
    medians = [model.priors[name].median for name in model.form.parameter_names]
    all_rows = known(model)
    found = all_rows.without(rows.texture == 1, 2)
    kept = [medians[j] for j in (0, 2, 3)]
    exact = power_law_evidence(rows, medians)
    assert all_rows.evidence.value == pytest.approx(exact, abs=4 * all_rows.evidence.se)
    exact -= power_law_evidence(rows.take(rows.texture != 1), kept)
    assert found.method == method
    # Monte Carlo: four standard errors.
    assert abs(found.log_score - exact) < 4 * found.log_score_se
    names = found.posterior(1).model.parameter_names
    assert names == tuple(name for name in model.parameter_names if "a0.032" not in name)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("noise", "is_bracket"), [("step", True), ("texture:student", False), ("step-smooth", False)]
)
def test_without__two_ways_agree_where_offsets_are_shared(rows, noise, is_bracket, monkeypatch):
    if is_bracket:  # of steps that are off as a whole, which coefficients and offsets share
        load = rows.log_load + 0.2 * np.sin(rows.Q)
        rows = replace(rows, log_load=load, log_lower=load - 0.02)
    all_rows = AllRows.drawn(model_of(rows, Modified(), noise), Effort().doubled, 1)
    left = rows.texture == 1
    monkeypatch.setattr(left_out, "MAX_FINITE_VARIANCE_K", 0.7)
    found = all_rows.without(left, 3)
    monkeypatch.setattr(left_out, "MAX_FINITE_VARIANCE_K", -np.inf)
    other = all_rows.without(left, 4)
    assert (found.method, other.method) == ("weights", "evidences")
    assert other.status == "ok"
    # Monte Carlo: four standard errors, and of means those of a hundred effective draws.
    error = np.hypot(found.log_score_se, other.log_score_se)
    assert abs(found.log_score - other.log_score) < 4 * error
    own, its = (one.posterior(1).coordinates for one in (found, other))
    assert own.shape[1] == its.shape[1]
    away = np.abs(own.mean(axis=0) - its.mean(axis=0)) / its.std(axis=0)
    assert away.max() < 4 * np.hypot(0.1, 0.1)
    # Loads vary far less than coefficients and offsets do by themselves.
    a, b = np.array(rows.textures[0])
    low, high = zip(
        *(
            Fit.of(one.posterior(1)).predict_load(a, b, [4, 8]).interval(0.5)
            for one in (found, other)
        ),
        strict=True,
    )
    widths = np.log(np.array(high) / low)
    np.testing.assert_allclose(widths[0], widths[1], rtol=0.3)  # Monte Carlo, of a hundred draws


def test_without__takes_a_posteriors_own_draws_and_evidence(rows):
    model = model_of(rows, Modified(), priors={"c": C, "sigma": SIGMA})
    posterior = drawn_posterior(model, seed=2)
    found = AllRows.of(posterior, Effort(), 2)
    assert found.evidence == posterior.evidence
    assert len(found.u) == len(found.log_density) > 1_000
    assert set(found.log_density) <= set(posterior.chains.log_density.ravel())
    left = rows.texture == 2
    exact = modified_evidence(rows)[0] - modified_evidence(rows.take(~left))[0]
    score = found.without(left, 3)
    assert score.method == "weights"  # the way that looks at the draws
    assert abs(score.log_score - exact) < 4 * score.log_score_se  # Monte Carlo
    filed = AllRows.of(replace(posterior, evidence=None), Effort(), 2)
    # Monte Carlo: four standard errors of two independent sets of draws.
    assert abs(filed.evidence.value - posterior.evidence.value) < 4 * 1.5 * posterior.evidence.se


def test_without__of_posteriors_that_are_not_known_says_so(rows):
    all_rows = known(model_of(rows, Modified()))
    nothing = replace(
        all_rows,
        u=all_rows.u[:0],
        evidence=replace(all_rows.evidence, value=np.nan, status="no draws"),
    )
    found = nothing.without(rows.texture == 0, 1)
    assert (found.method, found.status) == ("evidences", "all rows: no draws")
    assert np.isnan(found.log_score)
    with pytest.raises(ComputationError, match="no row is left to fit"):
        all_rows.without(np.ones(24, bool), 1)
