"""What must not change, whatever the numbers: scales, orders, doublings, inverses."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import ridgebayes as rb
from ridgebayes import Noise
from ridgebayes.comparison.bayes_factors import summed_bayes_factors
from ridgebayes.inference.latent import LatentIntegral
from ridgebayes.model.model import Model
from ridgebayes.model.observations import Observations
from ridgebayes.predict.q_distribution import mix_q
from tests.drawn import loads_of

TEXTURES = ((0.012, 0.03), (0.032, 0.01), (0.022, 0.02), (0.018, 0.045))
FORMS = (rb.Classic(), rb.Modified(), rb.Hybrid(), rb.HalfPlane(), rb.PowerLaw().bind(TEXTURES))
STRUCTURES = ("iid", "texture", "step", "texture+step", "step-smooth")

form = st.sampled_from(FORMS)
texture = st.sampled_from(TEXTURES)
poisson = st.floats(0, 0.5)
scale = st.floats(0.2, 3)
noise = st.sampled_from(STRUCTURES).map(Noise)


def coefficients(form, factor):
    """Coefficients near the printed ones."""
    printed = form.published or tuple(2.7 / (a + b) for a, b in TEXTURES)
    return factor * np.array(printed)


@st.composite
def rows(draw):
    """Rows of four textures, in any order, as loads near the Modified form's."""
    n = draw(st.integers(2, 12))

    def column(values):
        return np.array(draw(st.lists(values, min_size=n, max_size=n)))

    index, Q = column(st.integers(0, 3)), 2 * column(st.integers(2, 8))
    a, b = np.array(TEXTURES)[index].T
    log_load = np.log(rb.Modified().load(Q, a, b)) + 0.05 * column(st.floats(-1, 1))
    rel_se = column(st.sampled_from([0.0, 0.01, 0.05]))
    return made(index, Q, log_load, rel_se)


def scattered_rows(seed):
    """Twelve rows with errors that tell of a scale: of rows without there is no interior mode."""
    rng = np.random.default_rng(seed)
    index, Q = rng.integers(0, 4, 12), 2 * rng.integers(2, 9, 12)
    a, b = np.array(TEXTURES)[index].T
    log_load = np.log(rb.Modified().load(Q, a, b)) + 0.05 * rng.standard_normal(12)
    return made(index, Q, log_load, rng.choice([0.0, 0.01, 0.05], 12))


scattered = st.integers(0, 10_000).map(scattered_rows)


def made(index, Q, log_load, rel_se):
    """Observations, whose textures stand in the order of their first rows."""
    shown = list(dict.fromkeys(index.tolist()))
    place = np.array([shown.index(i) for i in index.tolist()])
    lower, is_count = np.full(len(Q), np.nan), np.zeros(len(Q), bool)
    textures = tuple(TEXTURES[i] for i in shown)
    return Observations(textures, place, Q, log_load, rel_se, lower, is_count)


def taken(data, order):
    """The rows in another order, or some of them more than once."""
    index = np.array([TEXTURES.index(texture) for texture in data.textures])[data.texture]
    return made(index[order], data.Q[order], data.log_load[order], data.rel_se[order])


def likelihood(data, noise, factor, form=None):
    model = Model(data, form or rb.Hybrid(), noise)
    scales = {"sigma": 0.03, "tau_texture": 0.02, "tau_step": 0.04, "df": 4.0}
    scales |= {"length_h": 0.8, "length_ratio": 0.2}
    eta = [scales[name] for name in model.noise.parameter_names]
    theta = np.concatenate([coefficients(form or rb.Hybrid(), factor), eta])
    u = model.to_scores(theta[None])[:, model.outer]
    found = LatentIntegral(model).estimated(u, np.random.default_rng(1), 8)
    return float(found.log_density[0] - model.log_outer_prior(u)[0])


@given(form, texture, scale, poisson, st.integers(-12, 2), st.floats(0.1, 10))
def test_forms__know_widths_and_loads_by_the_root_of_the_load_over_the_pitch_alone(
    form, texture, factor, nu, power, stretch
):
    (a, b), size = texture, stretch * 10.0**power
    theta = coefficients(form, factor)
    Q = np.array([4, 6, 20])
    here = form.load(Q, a, b, theta, nu)
    if form.name == "power-law":  # its K is 1/pitch: that of the texture at another size
        form, theta = (
            rb.PowerLaw().bind(((size * a, size * b),)),
            theta[TEXTURES.index(texture)] / size,
        )
        theta = np.array([theta])
    there = form.load(Q, size * a, size * b, theta, nu)
    # Algebra: some ten roundings; of the half-plane's loads the tolerance they are solved to.
    tolerance = 1e-8 if form.name == "half-plane" else 1e-13
    np.testing.assert_allclose(there / here, size**2, rtol=tolerance)


@given(form, texture, scale, poisson, st.lists(st.floats(0, 0.05), min_size=2, max_size=8))
def test_load_and_count__are_adjoint(form, texture, factor, nu, loads):
    theta, p = coefficients(form, factor), np.array(loads)
    Q = form.count(p, *texture, theta, nu)
    assert np.all((form.load(Q, *texture, theta, nu) <= p) | (Q == 2))
    assert np.all(p < form.load(Q + 2, *texture, theta, nu))


@pytest.mark.slow
@given(rows(), st.sampled_from(["normal", "student"]), st.floats(0.9, 1.1), st.integers(2, 5))
def test_likelihood__of_a_table_several_times_is_so_many_times_that_of_independent_rows(
    data, tail, factor, times
):
    noise = Noise("iid", tail)
    again = taken(data, np.tile(np.arange(len(data.Q)), times))
    one = likelihood(data, noise, factor)
    assert likelihood(again, noise, factor) == pytest.approx(times * one, rel=1e-11, abs=1e-9)


@pytest.mark.slow
@given(rows(), noise, poisson, st.floats(0.9, 1.1))
@settings(max_examples=25)
def test_likelihood__of_loads_at_any_poissons_ratio_is_that_of_loads_reduced(
    data, noise, nu, factor
):
    keep = np.unique(np.stack([data.texture, data.Q]), axis=1, return_index=True)[1]
    a, b = np.array(data.textures)[data.texture[keep]].T
    Q = data.Q[keep]
    p = rb.Modified().load(Q, a, b)
    frame = pd.DataFrame({"a_over_R": a, "b_over_R": b, "Q": Q})
    tables = [rb.read_table(frame.assign(p_over_E=p * 0.75 / (1 - n**2), nu=n)) for n in (nu, 0.5)]
    one, other = (likelihood(Observations.from_table(table), noise, factor) for table in tables)
    assert one == pytest.approx(other, rel=1e-9, abs=1e-9)


def density(data, u, **priors):
    """The log posterior density of Modified under independent rows, scores integrated out."""
    integral = LatentIntegral(Model(data, rb.Modified(), priors=priors))
    return integral.estimated(u, np.random.default_rng(1), 8).log_density


SCORES = np.random.default_rng(4).standard_normal((40, 2))


@pytest.mark.slow
@given(scattered, st.floats(0.5, 2))
@settings(max_examples=10)
def test_posterior__does_not_depend_on_the_unit_of_a_coefficient(data, unit):
    # c counts in other units if loads do: ln p + 2 ln u is fitted by c/u, its prior moved along.
    moved = replace(data, log_load=data.log_load + 2 * np.log(unit))
    one = density(data, SCORES, c=rb.LogNormal(1.4, 0.3))
    other = density(moved, SCORES, c=rb.LogNormal(1.4 / unit, 0.3))
    np.testing.assert_allclose(one, other, rtol=1e-10, atol=1e-8)


@pytest.mark.slow
@given(st.lists(st.floats(-500, 500), min_size=6, max_size=6), st.permutations(range(3)))
def test_bayes_factors__are_antisymmetric_and_transitive(values, order):
    """Of three forms under two error models, listed in one order and in another."""

    def factors(forms):
        rows = [
            {"form": f"form{i}", "noise": noise, "method": "importance", "used": True}
            | {"log_evidence": values[2 * i + k], "log_evidence_se": 0.01}
            for i in forms
            for k, noise in enumerate(("iid", "step"))
        ]
        table = summed_bayes_factors(pd.DataFrame(rows))
        return {(row.form_a, row.form_b): (row.ln_bf, row.reading) for row in table.itertuples()}

    one, other = factors(range(3)), factors(order)
    for (a, b), (ln_bf, reading) in one.items():
        swapped, same = other.get((b, a)), other.get((a, b))
        found, text = same if same is not None else (-swapped[0], swapped[1])
        assert found == pytest.approx(ln_bf, abs=1e-12)
        assert text == reading
    total = one["form0", "form1"][0] + one["form1", "form2"][0]
    assert total == pytest.approx(one["form0", "form2"][0], abs=1e-12)


@st.composite
def counted(draw):
    """A distribution of counts whose probabilities may be zero, equal or tiny."""
    steps = draw(
        st.lists(st.sampled_from([0.0, 1e-13, 0.1, 0.3, 0.5, 1.0]), min_size=1, max_size=9)
    )
    return rb.QDistribution(np.cumprod([1.0, *steps]), np.array(False), 10, "simulation")


probability = st.sampled_from([0.0, 1e-15, 0.05, 0.5, 0.95, 1.0]) | st.floats(0, 1)


@pytest.mark.slow
@given(counted(), probability, st.integers(0, 9), st.booleans())
def test_count_distribution__quantile_and_cdf_are_adjoint(q, prob, step, at_a_step):
    if at_a_step:  # just above P(Q <= n), where the next count begins
        prob = min(float(q.cdf[min(step, len(q.q) - 1)]) * (1 + 1e-9), 1.0)
    assert q.pmf.sum() == pytest.approx(1, abs=1e-14)
    assert np.all(q.pmf >= 0)
    place = int(np.searchsorted(q.q, q.quantile(prob)))
    # quantile(prob) <= n just where prob <= cdf(n), but for rounding of the sums.
    assert q.cdf[place] >= prob * (1 - 1e-12) - 1e-15
    assert np.all(q.cdf[:place] < prob)


@given(counted(), counted(), st.floats(0, 1))
def test_mixed_counts__are_between_their_parts(one, other, weight):
    mixed = mix_q([one, other], [weight, 1 - weight])
    for n in range(2, 24, 2):
        ends = sorted([float(one.at_least(n)), float(other.at_least(n))])
        assert ends[0] - 1e-15 <= mixed.at_least(n) <= ends[1] + 1e-15


@st.composite
def loaded(draw):
    """A distribution of loads: few draws of any spread, some of which reach nothing."""
    n = draw(st.integers(1, 6))
    numbers = st.floats(-12, 2) | st.just(np.inf)
    mean = np.array(draw(st.lists(numbers, min_size=n, max_size=n)))
    sd = np.array(draw(st.lists(st.floats(1e-9, 3), min_size=n, max_size=n)))
    weight = np.array(draw(st.lists(st.floats(0.01, 1), min_size=n, max_size=n)))
    return loads_of(mean, sd, weight / weight.sum())


inner = st.floats(-200, -1).map(lambda power: 10**power) | st.floats(0.01, 0.99)


@pytest.mark.slow
@given(loaded(), inner)
def test_load_distribution__cdf_inverts_quantile(load, prob):
    at = float(load.quantile(prob))
    finite = float(load.weight[np.isfinite(load.log_mean)].sum())
    if at == np.inf:
        assert prob >= finite - 1e-9 or float(load.cdf(1e300)) < prob
        return
    if at > 1e-300:
        # The search stops at 1e-10 of log load or rounding of it; sd is 1e-9 at least.
        low, high = (float(load.cdf(at * (1 + step))) for step in (-1e-9, 1e-9))
        assert low <= prob * (1 + 1e-9)
        assert high >= prob * (1 - 1e-9)
