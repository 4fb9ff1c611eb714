"""Offsets as unknowns: the density in whitened coordinates against brute force in plain ones."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

import ridgebayes as rb
from ridgebayes.errors import ComputationError
from ridgebayes.model.forms import Modified
from ridgebayes.model.likelihood_latent import MOST_OFFSETS, SampledOffsets
from ridgebayes.model.likelihood_marginal import IntegratedOffsets
from ridgebayes.model.model import Model
from ridgebayes.model.noise import Noise
from ridgebayes.model.observations import Observations
from ridgebayes.model.rows import Rows
from ridgebayes.model.shared_offsets import offsets_of
from ridgebayes.model.tails import NormalTail, StudentTail
from tests import tables_in_the_wild as wild

NORMAL, STUDENT = NormalTail(), StudentTail()
SIGMA, TAU_TEXTURE, TAU_STEP, DF = 0.06, 0.05, 0.04, 3.0
RATE = 0.3
WIDTHS = ((0.012, 0.03), (0.032, 0.01), (0.022, 0.02))
LOG_2PI = math.log(2 * math.pi)


def eta_of(structure, tail=STUDENT, df=DF):
    known = {"sigma": SIGMA, "tau_texture": TAU_TEXTURE, "tau_step": TAU_STEP, "df": df}
    known |= {"length_h": 0.8, "length_ratio": 0.3}
    return np.array([known[name] for name in Noise(structure, tail.name).parameter_names])


def sampled(structure, data, tail=STUDENT):
    offsets = offsets_of(Noise(structure, tail.name), data)
    return SampledOffsets(Rows.of(data, Modified()), offsets, tail)


def middle(Q):
    """log load of the modified form at the rate."""
    return 2 * np.log((np.asarray(Q) / 2 - 1) * 0.042) - 2 * RATE


ROWS = {
    "student": {"rel_se": [0.0, 0.0, 0.03, 0.0, 0.0, 0.0]},
    "brackets": {"log_lower": middle([4, 4, 4, 6, 6, 6]) - [0.1, 0.02, 9.0, 0.3, 0.08, np.inf]},
    "counts": {"is_count": [True, False, True, True, True, False]},
    "counts, one of two": {"is_count": [True, False, True, True, True, False]},
}


@pytest.fixture(params=["student", "brackets", "counts"])
def kind(request):
    return request.param


def six(observed, kind, texture=(0, 0, 0, 0, 0, 0)):
    """Three rows at each of two steps; an outlier among them."""
    Q, away = np.array([4, 4, 4, 6, 6, 6]), np.array([0.05, 0.1, -0.02, -0.06, 0.3, 0.01])
    load = middle(Q) + away
    if kind.startswith("counts"):  # seen near enough to the next ridge that its load matters
        load[[0, 2, 3, 4]] = middle([6, 6, 8, 8]) - [0.1, -0.02, 0.2, 0.05]
    if kind.endswith("two"):
        Q[2], load[2] = 2, middle(4) - 0.03
    return observed(texture, Q, load, **ROWS[kind])


def row_density(data, i, tail, b, b_next):
    """Density or probability of one row by scipy, given offsets of its step and the next one's."""
    scale = math.hypot(SIGMA, data.rel_se[i])
    oracle = stats.norm() if tail is NORMAL else stats.t(DF)
    load, Q = data.log_load[i], int(data.Q[i])
    if data.is_count[i]:
        reached = oracle.cdf((load - middle(Q) - b) / scale) if Q > 2 else 1.0
        return reached - oracle.cdf((load - middle(Q + 2) - b_next) / scale)
    z = (load - middle(Q) - b) / scale
    if np.isnan(data.log_lower[i]):
        return oracle.pdf(z) / scale
    return oracle.cdf(z) - oracle.cdf((data.log_lower[i] - middle(Q) - b) / scale)


def log_product(rows):
    with np.errstate(divide="ignore"):  # far out scipy's difference of probabilities is zero
        return np.log(rows).sum(axis=0)


def integral(log_density, n, half=10.0, step=0.2):
    """Log of the integral over the plane: the trapezoidal rule, exponentially exact here."""
    axis = np.arange(-half, half + step / 2, step)
    grid = np.stack(np.meshgrid(*[axis] * n, indexing="ij"), axis=-1).reshape(-1, n)
    values = log_density(grid)
    peak = values.max()
    return peak + math.log(np.exp(values - peak).sum()) + n * math.log(step)


@pytest.mark.parametrize("tail", [NORMAL, STUDENT])
@pytest.mark.parametrize("kind", ROWS)
@pytest.mark.parametrize("structure", ["texture", "step", "texture+step"])
def test_joint__is_the_density_of_rows_moved_by_offsets_times_that_of_scores(
    structure, kind, tail, observed
):
    # A count looks at its step's offset and at the next one's.
    data = six(observed, kind)
    likelihood, eta = sampled(structure, data, tail), eta_of(structure, tail)
    scores = np.random.default_rng(1).standard_normal((20, likelihood.n_latent))
    n_texture = int("texture" in structure)
    of_texture = TAU_TEXTURE * scores[:, 0] if n_texture else np.zeros(20)
    steps = sorted({q + 2 * later for q in data.Q for later in (0, "counts" in kind)} - {2})
    of_step = dict.fromkeys(range(2, 12, 2), np.zeros(20))
    if "step" in structure:
        columns = TAU_STEP * scores[:, n_texture:].T
        of_step |= dict(zip(steps, columns, strict=True))
    expected = stats.norm.logpdf(scores).sum(axis=1)
    for i, q in enumerate(data.Q.tolist()):
        b, b_next = (of_texture + of_step[one] for one in (q, q + 2))
        expected += np.log(row_density(data, i, tail, b, b_next))
    found = likelihood.joint(np.full((1, 1), RATE), eta[None], scores)
    # Rounding, of scipy's differences of probabilities down to 1e-8.
    np.testing.assert_allclose(found, expected, rtol=1e-7)


@pytest.mark.parametrize("tail", [NORMAL, STUDENT])
def test_joint__of_smooth_offsets_is_the_density_over_correlated_ones(tail, observed):
    data = six(observed, "brackets")
    likelihood, eta = sampled("step-smooth", data, tail), eta_of("step-smooth", tail)
    correlation = math.exp(-0.5 * (math.log(2) / 0.8) ** 2)
    factor = TAU_STEP * np.linalg.cholesky([[1 + 1e-8, correlation], [correlation, 1 + 1e-8]])
    scores = np.random.default_rng(1).standard_normal((20, 2))
    b = scores @ factor.T
    rows = [row_density(data, i, tail, b[:, i // 3], None) for i in range(6)]
    expected = np.log(rows).sum(axis=0) + stats.norm.logpdf(scores).sum(axis=1)
    found = likelihood.joint(np.full((1, 1), RATE), eta[None], scores)
    np.testing.assert_allclose(found, expected, rtol=1e-7)  # rounding


def crossed(observed):
    """Three textures at three steps, twice, an outlier, a bracket, a count."""
    rng = np.random.default_rng(1)
    texture, Q = np.tile(np.repeat([0, 1, 2], 3), 2), np.tile([4, 6, 8], 6)
    load = middle(Q) + 0.05 * rng.standard_normal(18)
    load[4] += 0.4
    return observed(texture, Q, load)


@pytest.mark.parametrize("structure", ["texture", "step", "step-smooth"])
def test_marginal__is_near_the_integral(structure, kind, observed):
    data = six(observed, kind)
    likelihood, eta = sampled(structure, data), eta_of(structure)
    n = likelihood.n_latent
    grid = {"half": 6.0} if n == 3 else {"step": 0.05}
    rates = np.full((1, 1), RATE)
    exact = integral(lambda scores: likelihood.joint(rates, eta[None], scores), n, **grid)
    rough = likelihood.marginal(rates, eta[None])[0]
    # Laplace's approximation of six rows, an outlier among them: a quarter of a nat.
    assert rough == pytest.approx(exact, abs=0.25)


@pytest.mark.parametrize("structure", Noise.structures[1:])
def test_marginal__of_a_student_of_very_many_degrees_is_the_normals_closed_form(
    structure, observed
):
    data = crossed(observed)
    closed = IntegratedOffsets(Rows.of(data, Modified()), offsets_of(Noise(structure), data))
    likelihood, rates = sampled(structure, data), np.full((1, 3), RATE)
    eta = eta_of(structure, df=1e7)[None]
    expected = closed.marginal(rates, eta[:, :-1])
    # What 1 / df leaves: eighteen rows, of which one is 7 sigma out, z^4 / 4 df.
    atol = (7**4 / 4 + 18) / 1e7
    np.testing.assert_allclose(likelihood.marginal(rates, eta), expected, rtol=0, atol=atol)


@pytest.mark.parametrize("structure", ["iid", *Noise.structures[1:]])
def test_marginal__with_series_too_is_the_normals_closed_form(structure, observed):
    noise, data = Noise(f"{structure}+series"), crossed(observed)
    series = np.arange(18) // 2 % 3
    data = replace(data, series=series, series_labels=("a", "b", "c"))
    closed = IntegratedOffsets(Rows.of(data, Modified()), offsets_of(noise, data))
    known = {"sigma": SIGMA, "tau_texture": TAU_TEXTURE, "tau_step": TAU_STEP, "tau_series": 0.07}
    known |= {"length_h": 0.8, "length_ratio": 0.3, "df": 1e7}
    rates = np.full((1, 3), RATE)
    for tail, atol in ((NORMAL, 1e-9), (STUDENT, (7**4 / 4 + 18) / 1e7)):
        both = Noise(noise.structure, tail.name)
        eta = np.array([[known[name] for name in both.parameter_names]])
        likelihood = SampledOffsets(Rows.of(data, Modified()), offsets_of(both, data), tail)
        expected = closed.marginal(rates, eta[:, : len(noise.parameter_names)])
        np.testing.assert_allclose(likelihood.marginal(rates, eta), expected, rtol=0, atol=atol)


@pytest.mark.parametrize("structure", Noise.structures[1:])
def test_pointwise__and_given_are_of_the_offsets_of_the_scores(structure, observed):
    data, rng = crossed(observed), np.random.default_rng(5)
    likelihood = sampled(structure, data)
    rates = RATE + 0.05 * rng.standard_normal((4, 3))
    eta = eta_of(structure) * np.exp(0.3 * rng.standard_normal((4, len(eta_of(structure)))))
    latent = rng.standard_normal((4, likelihood.n_latent))
    given = likelihood.given(rates, eta, latent)
    rows = likelihood.pointwise(rates, eta, latent)
    for i in range(0, 18, 2):
        j = data.texture[i]
        offset, variance = given.at(WIDTHS[j], data.Q[i : i + 1])
        z = data.log_load[i] - middle(data.Q[i]) - 2 * RATE + 2 * rates[:, j] - offset[:, 0]
        expected = stats.t(eta[:, -1]).logpdf(z / eta[:, 0]) - np.log(eta[:, 0])
        # A smooth offset is its place's but for the nugget: 1e-4 tau of scores of order 1.
        atol = 1e-2 if structure == "step-smooth" else 1e-10
        np.testing.assert_allclose(rows[:, i], expected, rtol=0, atol=atol)
        assert np.all(variance[:, 0] <= 2e-8 * TAU_STEP**2 * np.exp(4 * 0.3))
    # Latents differ by their density alone between the rows' sum and the joint one.
    joint = likelihood.joint(rates, eta, latent)
    other = likelihood.joint(rates, eta, 0 * latent)
    difference = rows.sum(axis=1) - likelihood.pointwise(rates, eta, 0 * latent).sum(axis=1)
    scores = given.mean, likelihood.given(rates, eta, 0 * latent).mean
    prior = [-0.5 * (each**2).sum(axis=1) for each in scores]
    np.testing.assert_allclose(joint - other, difference + prior[0] - prior[1], atol=1e-9)


@pytest.mark.parametrize("structure", Noise.structures[1:])
def test_joint__does_not_mind_the_order_of_rows(structure, observed):
    data, rng = crossed(observed), np.random.default_rng(6)
    order = rng.permutation(18)
    columns = {"log_lower": np.where(np.arange(18) % 4 == 1, data.log_load - 0.1, np.nan)}
    columns["is_count"] = np.arange(18) % 4 == 3
    rates, eta = np.full((3, 3), RATE), eta_of(structure) * np.ones((3, 1))
    found = []
    for rows in (np.arange(18), order):
        mine = {name: column[rows] for name, column in columns.items()}
        mine = observed(data.texture[rows], data.Q[rows], data.log_load[rows] + 0.1, **mine)
        likelihood = sampled(structure, mine)
        latent = np.random.default_rng(7).standard_normal((3, likelihood.n_latent))
        found.append(likelihood.joint(rates, eta, latent))
    np.testing.assert_allclose(found[1], found[0], rtol=1e-9)  # rounding: order of summation


def test_sampled__refuses_more_offsets_than_points_can_serve_but_not_of_one_factor(observed):
    texture = np.arange(MOST_OFFSETS)
    widths = tuple((0.01 + 1e-5 * j, 0.02) for j in range(MOST_OFFSETS))
    many = observed(texture, np.full_like(texture, 4), -8.0, textures=widths)
    assert sampled("texture", many).is_product
    rule = f"{MOST_OFFSETS + 1} offsets of rows with Student errors, brackets or counts; expected"
    with pytest.raises(ComputationError, match=rule):
        sampled("texture+step", many)


def brute_force_line(data, tail, scale):
    """Scores of one level, and their log joint density with all rows, by scipy."""
    z = np.arange(-10, 10, 0.01)
    rows = [row_density(data, i, tail, scale * z, scale * z) for i in range(6)]
    return z, log_product(rows) + stats.norm.logpdf(z)


@pytest.mark.parametrize("tail", [NORMAL, STUDENT])
@pytest.mark.parametrize("kind", ROWS)
def test_marginal__of_one_factor_is_the_integral_over_plain_offsets(kind, tail, observed):
    data = six(observed, kind)
    likelihood, eta = sampled("texture", data, tail), eta_of("texture", tail)
    found = likelihood.marginal(np.full((1, 1), RATE), eta[None])[0]
    _, log_density = brute_force_line(data, tail, TAU_TEXTURE)
    peak = log_density.max()
    expected = peak + math.log(np.exp(log_density - peak).sum() * 0.01)
    # Quadrature: 49 nodes of the trapezoidal rule, at edges and outliers.
    assert found == pytest.approx(expected, abs=1e-4)


@pytest.mark.parametrize("kind", ["student", "brackets", "counts"])
def test_estimated__offsets_of_one_factor_have_the_posteriors_mean_and_spread(kind, observed):
    data, n = six(observed, kind), 3_000
    likelihood, eta = sampled("texture", data), eta_of("texture")
    rates, etas = np.full((n, 1), RATE), np.repeat(eta[None], n, axis=0)
    found = likelihood.estimated(rates, etas, np.random.default_rng(1), 1)
    exact = likelihood.marginal(rates[:1], eta[None])[0]
    np.testing.assert_allclose(found.log_density, exact, atol=1e-3)  # quadrature, nodes shifted
    z, log_density = brute_force_line(data, STUDENT, TAU_TEXTURE)
    weight = np.exp(log_density - log_density.max())
    weight /= weight.sum()
    mean, sd = weight @ z, math.sqrt(weight @ z**2 - (weight @ z) ** 2)
    scores = likelihood.given(rates, etas, found.latent).mean[:, 0]
    for value, expected in ((scores, mean), ((scores - mean) ** 2, sd**2)):
        assert abs(value.mean() - expected) < 4 * value.std() / math.sqrt(n)  # Monte Carlo


def crossed_grid(data):
    """Log likelihood of `crossed` under texture+step, and the mean of the first texture's score."""
    axis, line = np.arange(-6, 6.01, 0.4), np.arange(-7, 7.01, 0.2)
    each = np.empty((3, 3, len(axis), len(line)))  # texture, step
    for j in range(3):
        for k in range(3):
            rows = np.flatnonzero((data.texture == j) & (4 + 2 * k == data.Q))
            b = TAU_TEXTURE * axis[:, None] + TAU_STEP * line
            each[j, k] = np.prod([row_density(data, i, STUDENT, b, b) for i in rows], axis=0)
    weights, prior = stats.norm.pdf(line) * 0.2, stats.norm.pdf(axis) * 0.4
    steps = np.einsum("kal,kbl,kcl,l->kabc", *each, weights).prod(axis=0)
    total = np.einsum("abc,a,b,c->", steps, prior, prior, prior)
    first = np.einsum("abc,a,b,c->", steps, prior * axis, prior, prior)
    return math.log(total), first / total


def test_estimated__of_two_factors_is_unbiased_and_keeps_offsets_by_their_weight(observed):
    data, n = crossed(observed), 4_000
    likelihood, eta = sampled("texture+step", data), eta_of("texture+step")
    rates, etas = np.full((n, 3), RATE), np.repeat(eta[None], n, axis=0)
    found = likelihood.estimated(rates, etas, np.random.default_rng(2), 3)
    exact, mean = crossed_grid(data)
    weight = np.exp(found.log_density - exact)
    assert weight.std() < 3
    assert abs(weight.mean() - 1) < 4 * weight.std() / math.sqrt(n)  # Monte Carlo
    off = likelihood.given(rates, etas, found.latent).mean[:, 0] - mean
    # Monte Carlo: a ratio of means.
    assert abs((weight * off).mean()) < 4 * (weight * off).std() / math.sqrt(n)
    assert off.std() > 0.3


@pytest.mark.parametrize("structure", Noise.structures[1:])
@pytest.mark.parametrize("tail", [NORMAL, STUDENT])
def test_estimated__log_joint_is_the_joint_density_at_the_latents(structure, tail, kind, observed):
    data, rng = six(observed, kind), np.random.default_rng(8)
    likelihood, eta = sampled(structure, data, tail), eta_of(structure, tail)
    rates, etas = RATE + 0.02 * rng.standard_normal((7, 1)), np.repeat(eta[None], 7, axis=0)
    found = likelihood.estimated(rates, etas, rng, 5)
    joint = likelihood.joint(rates, etas, found.latent)
    np.testing.assert_allclose(found.log_joint, joint, atol=1e-8)  # rounding
    again = [
        likelihood.estimated(rates, etas, np.random.default_rng(9), 5).latent for _ in range(2)
    ]
    np.testing.assert_array_equal(*again)


def test_estimated__of_normal_exact_rows_is_the_closed_form_whatever_the_points(observed):
    data = crossed(observed)
    for structure in ("texture+step", "step-smooth"):
        likelihood, eta = sampled(structure, data, NORMAL), eta_of(structure, NORMAL)
        rates, etas = np.full((400, 3), RATE), np.repeat(eta[None], 400, axis=0)
        found = likelihood.estimated(rates, etas, np.random.default_rng(3), 16).log_density
        closed = IntegratedOffsets(Rows.of(data, Modified()), offsets_of(Noise(structure), data))
        weight = np.exp(found - closed.marginal(rates[:1], eta[None])[0])
        assert weight.std() < 0.3  # tails longer than the normal's cost little
        assert abs(weight.mean() - 1) < 4 * weight.std() / 20  # Monte Carlo


def test_estimated__varies_little_where_small_errors_and_heavy_tails_meet_outliers():
    # Three outliers, which a start from equal weights would let pull at their neighbours.
    frame = wild.Rows.of("hybrid", wild.nine()).iid(np.random.default_rng(21), 0.01).frame
    factor = np.ones(len(frame))
    factor[np.flatnonzero(frame["Q"] == 4)[[0, 4, 7]]] = 0.8, 1.25, 1.3
    table = rb.ContactTable.from_frame(frame.assign(p_over_E=frame["p_over_E"] * factor))
    model = Model(Observations.from_table(table), Modified(), Noise("step-smooth", "student"))
    theta = np.tile([1.4047, 0.0041, 0.0388, 1.7857, 0.9137, 0.6602], (30, 1))
    found = model.estimated(model.to_unconstrained(theta), np.random.default_rng(0), 64)
    assert found.log_density.std() < 0.25  # three passes from equal weights: 0.47


def test_estimated__varies_little_where_few_degrees_let_two_factors_go_far():
    (table,) = (one.table for one in wild.tables() if one.name == "outliers")
    model = Model(Observations.from_table(table), rb.Hybrid(), Noise("texture+step", "student"))
    theta = np.tile([1.353, 0.0142, 0.0053, 0.0041, 0.0092, 0.86], (400, 1))
    found = model.estimated(model.to_unconstrained(theta), np.random.default_rng(1), 32)
    weight = np.exp(found.log_density - found.log_density.max())
    assert weight.std() / weight.mean() < 0.65  # 0.41 to 0.50; no wider than normal: 0.8 to 1.7


def test_estimated__varies_little_where_offsets_take_up_all_but_tiny_errors():
    model = Model(
        Observations.from_table(rb.paper_sweep()), rb.Hybrid(), Noise("step-smooth", "student")
    )
    theta = np.tile([1.345, 0.0145, 2.2e-6, 0.062, 1.21, 0.4245, 2.0], (30, 1))
    found = model.estimated(model.to_unconstrained(theta), np.random.default_rng(0), 64)
    # From rows that all begin as far off as a priori, six passes end at 168 +- 9.
    assert found.log_density.std() < 1.5
    assert abs(found.log_density.mean() - 263.5) < 1.5  # some standard errors of 30 draws


@pytest.mark.parametrize("structure", ["texture+step", "step-smooth"])
def test_estimated__varies_little_where_intervals_are_far_wider_than_errors(structure):
    frame = wild.Rows.of("modified", wild.nine()).iid(np.random.default_rng(21), 0.05).frame
    load = frame["p_over_E"]
    table = rb.ContactTable.from_frame(frame.assign(p_over_E=2 * load, p_over_E_lower=load / 2))
    model = Model(Observations.from_table(table), Modified(), Noise(structure))
    rest = [0.1, 0.1] if structure == "texture+step" else [0.1, 1.0, 0.5]
    theta = np.tile([1.38, 0.05, *rest], (200, 1))
    found = model.estimated(model.to_unconstrained(theta), np.random.default_rng(1), 8)
    # 2e-6 and 0.003; with a uniform error's variance instead 1.0 and 1.2.
    assert found.log_density.std() < 0.01
