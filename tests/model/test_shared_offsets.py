"""What rows share, against the definition: pair by pair of places."""

import math
import re

import numpy as np
import pytest

from ridgebayes.errors import ComputationError, InputError
from ridgebayes.model.conditional_offsets import Design
from ridgebayes.model.forms import Modified
from ridgebayes.model.likelihood_marginal import IntegratedOffsets
from ridgebayes.model.noise import NUGGET, Noise
from ridgebayes.model.rows import Rows
from ridgebayes.model.shared_offsets import LARGEST_CROSSED, LARGEST_SMOOTH, offsets_of

STRUCTURES = tuple(
    noise.structure for noise in Noise.candidates(2) if noise.factors and noise.tail == "normal"
)
RATIO = np.array([0.012 / 0.042, 0.032 / 0.042, 0.022 / 0.042, 0.018 / 0.063])
WIDTHS = ((0.012, 0.03), (0.032, 0.01), (0.022, 0.02), (0.018, 0.045))
TEXTURE = np.array([0, 1, 2, 3, 0, 1, 2, 3, 0, 0])
Q = np.array([4, 4, 6, 6, 8, 12, 12, 4, 4, 6])
SERIES = np.array([0, 1, 2, 0, 1, 2, 0, 1, 2, 0])
USUAL = {
    "sigma": 0.03,
    "tau_texture": 0.05,
    "tau_step": 0.04,
    "length_h": 0.8,
    "length_ratio": 0.3,
    "tau_series": 0.07,
}


def eta_of(structure):
    return np.array([USUAL[name] for name in Noise(structure).parameter_names])


def correlation(here, there, length_h=0.8, length_ratio=0.3):
    """The squared exponential of the class's formula, between (a/pitch, Q)."""
    (r, q), (s, p) = here, there
    d = math.log((q / 2 - 1) / (p / 2 - 1)) / length_h
    return math.exp(-0.5 * d**2 - 0.5 * ((r - s) / length_ratio) ** 2)


def covariance(structure, i, j):
    shared = {
        "texture": TEXTURE[i] == TEXTURE[j],
        "step": Q[i] == Q[j],
        "series": SERIES[i] == SERIES[j],
    }
    factors = structure.split("+")
    value = sum(
        USUAL[f"tau_{name}"] ** 2 * shared.get(name, 0) for name in factors if name in shared
    )
    if "step-smooth" in factors:
        value += 0.04**2 * correlation((RATIO[TEXTURE[i]], Q[i]), (RATIO[TEXTURE[j]], Q[j]))
    return value


@pytest.fixture
def data(observed):
    return observed(TEXTURE, Q, -8.0, series=SERIES)


@pytest.mark.parametrize("structure", STRUCTURES)
def test_root__spread_over_rows_has_the_covariance_of_the_definition(structure, data):
    offsets = offsets_of(Noise(structure), data)
    eta = eta_of(structure) * np.array([[1.0], [1.0]])
    design = Design(offsets.codes, offsets.n_level)
    loading = offsets.root(eta).loading(design)
    found = np.swapaxes(loading, -1, -2) @ loading
    expected = [[covariance(structure, i, j) for j in range(10)] for i in range(10)]
    # The nugget where places agree, and rounding.
    for each in found:
        np.testing.assert_allclose(each, expected, rtol=0, atol=1.01 * NUGGET * 0.04**2)
    np.testing.assert_array_equal(offsets.codes_next, offsets.codes)


def test_offsets_of__independent_rows_are_none(data):
    assert offsets_of(Noise("iid"), data) is None


@pytest.mark.parametrize(
    ("structure", "n_level"),
    [
        ("texture", 4),
        ("step", 4),
        ("texture+step", 8),
        ("step-smooth", 7),
        ("series", 3),
        ("texture+series", 7),
        ("texture+step+series", 11),
        ("step-smooth+series", 10),
    ],
)
def test_offsets__have_a_level_for_each_thing_that_is_shared(structure, n_level, data):
    # Smooth: textures 0 and 3 have one a/pitch, so that they share the places of Q = 4 and 6.
    offsets = offsets_of(Noise(structure), data)
    assert offsets.n_level == n_level
    assert np.unique(offsets.codes).tolist() == list(range(n_level))


@pytest.mark.parametrize(("structure", "n_level"), [("step", 3), ("step-smooth", 3)])
def test_offsets__of_a_count_of_two_have_no_level_at_two(structure, n_level, observed):
    # Two at this load says that 4 was not reached; 4 and 6 say something of 6 and 8.
    data = observed([0] * 3, [2, 4, 6], -8.0, is_count=True)
    assert offsets_of(Noise(structure), data).n_level == n_level


@pytest.mark.parametrize("structure", STRUCTURES)
@pytest.mark.parametrize("lead", [(), (2, 3)])
def test_loading__of_any_axes_of_draws_is_that_of_each(structure, lead, data):
    offsets, one = offsets_of(Noise(structure), data), eta_of(structure)
    eta, at = np.broadcast_to(one, (*lead, len(one))), np.array([4, 14])
    loading, rest = offsets.loading(eta, (0.02, 0.02), at, offsets.root(eta))
    assert loading.shape == (*lead, len(offsets.levels_of((0.02, 0.02))), 2)
    assert rest.shape == (*lead, 2)
    expected = offsets.loading(one[None], (0.02, 0.02), at, offsets.root(one[None]))
    for i in np.ndindex(lead):
        # Rounding: systems solved together or alone.
        np.testing.assert_allclose(loading[i], expected[0][0], rtol=1e-7, atol=1e-12)
        np.testing.assert_allclose(rest[i], expected[1][0], rtol=1e-7, atol=1e-12)


@pytest.mark.parametrize("structure", STRUCTURES)
def test_codes_next__of_a_count_are_those_of_the_next_step(structure, observed):
    is_count = [True, True, False, False]
    seen = observed([0, 1, 0, 1], [4, 6, 6, 4], -8.0, is_count=is_count, series=[0, 1, 1, 0])
    reached = observed([0, 1, 0, 1, 0, 1], [4, 6, 6, 4, 6, 8], -8.0, series=[0, 1, 1, 0, 0, 1])
    counts, plain = (offsets_of(Noise(structure), rows) for rows in (seen, reached))
    assert counts.n_level == plain.n_level
    np.testing.assert_array_equal(counts.codes, plain.codes[:, :4])
    np.testing.assert_array_equal(counts.codes_next, plain.codes[:, [4, 5, 2, 3]])


@pytest.mark.parametrize("structure", STRUCTURES)
def test_loading__of_a_calibrated_place_is_its_own_level_and_of_a_new_one_the_prior(
    structure, data
):
    offsets, eta = offsets_of(Noise(structure), data), eta_of(structure)[None]
    root = offsets.root(eta)
    at_rows = root.loading(Design(offsets.codes, offsets.n_level))[0]
    # What is predicted is a new series, whatever the place.
    new_series = 0.07**2 if "series" in structure else 0.0
    if new_series:
        at_rows[-3:] = 0
    for i in range(10):
        loading, rest = offsets.loading(eta, WIDTHS[TEXTURE[i]], Q[i : i + 1], root)
        # A smooth place is known but for its nugget, tau x 1e-4; the others exactly.
        atol = 1e-4 * 0.04 if "step-smooth" in structure else 0
        levels = offsets.levels_of(WIDTHS[TEXTURE[i]])
        np.testing.assert_allclose(loading[0, :, 0], at_rows[levels, i], rtol=0, atol=1.01 * atol)
        others = np.setdiff1d(np.arange(offsets.n_level), levels)
        assert not at_rows[others, i].any()  # of other textures
        assert new_series <= rest[0, 0] <= new_series + 1.01 * atol**2
    if "step-smooth" not in structure:
        loading, rest = offsets.loading(eta, (0.02, 0.02), np.array([4, 14]), root)
        new = {"texture": [0.05**2] * 2, "step": [0.0, 0.04**2], "series": [0.07**2] * 2}
        expected = sum(np.array(new[name]) for name in structure.split("+"))
        np.testing.assert_allclose(rest[0], expected, rtol=1e-14)
        assert not loading[0, :, 1].any()


def test_loading__of_a_smooth_offset_is_the_gaussian_processs_interpolation(data):
    offsets, eta = offsets_of(Noise("step-smooth"), data), eta_of("step-smooth")[None]
    root = offsets.root(eta)
    at, widths = np.array([4, 10, 12]), (0.02, 0.02)
    loading, rest = offsets.loading(eta, widths, at, root)
    places = sorted({(float(RATIO[t].round(9)), int(q)) for t, q in zip(TEXTURE, Q, strict=True)})
    K = np.array([[correlation(p, q) for q in places] for p in places])
    K += NUGGET * np.eye(len(places))
    cross = np.array([[correlation(p, (0.5, q)) for q in at.tolist()] for p in places])
    gain = np.linalg.solve(K, cross)
    # What the scores stand for, place by place: b = L s, whose regression is K^-1 cross.
    scores = np.random.default_rng(1).standard_normal(offsets.n_level)
    b = root.times(scores[None])[0]
    order = [
        next(
            offsets.codes[0, i]
            for i in range(10)
            if (float(RATIO[TEXTURE[i]].round(9)), int(Q[i])) == place
        )
        for place in places
    ]
    # Rounding in condition 1e8 or less, and places rounded to 1e-9.
    np.testing.assert_allclose(scores @ loading[0], b[order] @ gain, rtol=0, atol=1e-8)
    expected = 0.04**2 * (1 - (cross * gain).sum(axis=0))
    np.testing.assert_allclose(rest[0], expected, rtol=1e-5, atol=1e-12)


@pytest.mark.parametrize("axis", ["h", "ratio"])
def test_loading__of_a_smooth_offset_widens_beyond_the_range_and_not_inside(axis, data):
    offsets, eta = offsets_of(Noise("step-smooth"), data), eta_of("step-smooth")[None]
    root = offsets.root(eta)

    def widening(ratio, q):
        """What is beyond the Gaussian process's own variance, in tau^2."""
        loading, rest = offsets.loading(eta, (ratio, 1 - ratio), np.array([q]), root)
        return float(rest[0, 0] + (loading[0] ** 2).sum()) / 0.04**2 - 1

    low, high = RATIO.min(), RATIO.max()
    for ratio in np.linspace(low, high, 7):
        for q in (4, 6, 10, 12):
            assert widening(ratio, q) == pytest.approx(0, abs=1e-12)  # rounding
    if axis == "h":
        distances = [math.log((q / 2 - 1) / 5) / 0.8 for q in range(12, 60, 2)]
        found = [widening(0.5, q) for q in range(12, 60, 2)]
    else:
        below = np.linspace(low, 0.001, 20)
        distances = ((low - below) / 0.3).tolist()
        found = [widening(ratio, 6) for ratio in below]
        above = (0.99 - high) / 0.3
        assert widening(0.99, 6) == pytest.approx(1 - math.exp(-0.5 * above**2), abs=1e-8)
        both = math.exp(-0.5 * above**2 - 0.5 * (math.log(9 / 5) / 0.8) ** 2)
        assert widening(0.99, 20) == pytest.approx(1 - both, abs=1e-8)
    # Places are taken to agree within 1e-9: that much of a distance.
    expected = [1 - math.exp(-0.5 * d**2) for d in distances]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-8)
    assert np.all(np.diff(found) > 0)


def test_given__textures_of_one_ratio_share_the_smooth_offset(data, observed):
    rng = np.random.default_rng(2)
    rows = observed(TEXTURE[:-1], Q[:-1], -8 + 0.1 * rng.standard_normal(9), textures=WIDTHS)
    likelihood = IntegratedOffsets(
        Rows.of(rows, Modified()), offsets_of(Noise("step-smooth"), rows)
    )
    given = likelihood.given(np.full((1, 4), 0.3), eta_of("step-smooth")[None], np.empty((1, 0)))
    steps = np.array([4, 6, 8, 12, 20])
    alike = [given.at(widths, steps) for widths in (WIDTHS[0], WIDTHS[3], (0.002, 0.005))]
    for mean, variance in alike[1:]:
        # Rounding: a/pitch to 1e-16 through condition 1e8.
        np.testing.assert_allclose(mean, alike[0][0], rtol=1e-6, atol=1e-10)
        np.testing.assert_allclose(variance, alike[0][1], rtol=1e-6, atol=1e-12)
    other, _ = given.at(WIDTHS[1], steps)
    assert np.abs(other - alike[0][0]).max() > 1e-3


@pytest.mark.parametrize("structure", [name for name in STRUCTURES if "series" in name])
def test_offsets_of__refuses_series_where_the_rows_are_of_one(structure, observed):
    rule = f"noise '{structure}': expected rows of at least two series or sources, got one"
    with pytest.raises(InputError, match=re.escape(rule)):
        offsets_of(Noise(structure), observed(TEXTURE, Q, -8.0))


def test_offsets_of__a_table_of_two_series_does_not_mind_rows_taken_of_one(data):
    assert offsets_of(Noise("series"), data.take(data.series == 1)).n_level == 3


def test_root__of_smooth_offsets_has_the_nugget_that_the_error_model_says(data):
    for nugget in (1e-9, 1e-5):
        offsets = offsets_of(Noise("step-smooth", nugget=nugget), data)
        loading = offsets.root(eta_of("step-smooth")).loading(Design(offsets.codes, 7))
        found = (loading**2).sum(axis=0) / 0.04**2 - 1
        np.testing.assert_allclose(found, nugget, rtol=0, atol=1e-14)  # rounding


def test_offsets_of__refuses_more_offsets_of_two_factors_than_it_can_serve(observed):
    steps = 2 * np.arange(2, LARGEST_CROSSED + 3)
    many = observed(np.zeros_like(steps), steps, -8.0)
    assert offsets_of(Noise("step"), many).n_level == LARGEST_CROSSED + 1
    rule = f"texture\\+step: {LARGEST_CROSSED + 1} offsets of steps; expected at most"
    with pytest.raises(ComputationError, match=rule):
        offsets_of(Noise("texture+step"), many)


def test_offsets_of__refuses_more_smooth_places_than_it_can_serve(observed):
    steps = 2 * np.arange(2, LARGEST_SMOOTH + 3)
    rule = f"step-smooth: {LARGEST_SMOOTH + 1} places of Q and a/pitch; expected at most"
    with pytest.raises(ComputationError, match=rule):
        offsets_of(Noise("step-smooth"), observed(np.zeros_like(steps), steps, -8.0))
