"""What rows share, against the definition: pair by pair of places."""

import math
import re

import numpy as np
import pytest

from ridgebayes import ComputationError, InputError, Modified, Noise, PowerLaw
from ridgebayes.model.model import Model
from ridgebayes.model.offsets import MAX_OTHER_LEVELS, Offsets
from tests import oracles

STRUCTURES = [noise.name for noise in Noise.candidates(2) if noise.tail == "normal"]
SHARED = [name for name in STRUCTURES if name != "iid"]
WIDTHS = ((0.012, 0.03), (0.032, 0.01), (0.022, 0.02), (0.018, 0.045))
RATIO = np.array([a / (a + b) for a, b in WIDTHS])
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


@pytest.fixture
def data(observed):
    """Rows, and one count, whose upper end is at a step that no row has."""
    return observed(TEXTURE, Q, -6.0, series=SERIES, is_count=np.arange(10) == 4)


def loading(offsets, eta):
    """Return each score's share of each predictor's offset, (n_level, n_predictor)."""
    root, k = offsets.root(eta), offsets.n_first
    scores = np.eye(offsets.n_level)
    return offsets.design.spread(*root.times(scores[:, :k], scores[:, k:]))


@pytest.mark.parametrize("form", [Modified(), PowerLaw()])
@pytest.mark.parametrize("structure", STRUCTURES)
def test_offsets__have_the_covariance_of_the_definition(structure, form, data):
    model = Model(data, form, Noise(structure))
    found, expected = np.zeros((11, 11)), oracles.covariance(model, eta_of(structure))
    if model.offsets.n_level:
        shares = loading(model.offsets, eta_of(structure)[None])
        found = shares.T @ shares
        variance = model.offsets.prior_variance(eta_of(structure))
        np.testing.assert_allclose(variance, np.diag(expected), rtol=1e-7, atol=1e-15)  # nugget
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)  # rounding


@pytest.mark.parametrize("structure", ["step", "step-smooth"])
def test_offsets__of_a_count_of_two_have_no_level_at_two(structure, observed):
    # Two at this load says that 4 was not reached; 4 and 6 say something of 6 and 8.
    data = observed([0] * 3, [2, 4, 6], -8.0, is_count=True)
    assert Offsets(Noise(structure), data).n_level == 3


def asked(structure, data, texture, steps, scores):
    offsets, eta = Offsets(Noise(structure), data), eta_of(structure)[None].repeat(len(scores), 0)
    return offsets.at(texture, np.array(steps), eta, scores, offsets.prepared(eta, scores))


def correlation(here, there, length_h=0.8, length_ratio=0.3):
    """The squared exponential, between (a/pitch, Q)."""
    (r, q), (s, p) = here, there
    d = math.log((q / 2 - 1) / (p / 2 - 1)) / length_h
    return math.exp(-0.5 * d**2 - 0.5 * ((r - s) / length_ratio) ** 2)


@pytest.mark.parametrize("axis", ["h", "ratio"])
def test_at__of_a_smooth_offset_widens_beyond_the_range_and_not_inside(axis, observed):
    data = observed(TEXTURE, Q, -6.0)
    scores = np.random.default_rng(3).standard_normal((1, 7))

    def widening(ratio, q):
        """What is beyond the Gaussian process's own variance, in tau^2."""
        _, variance = asked("step-smooth", data, (ratio, 1 - ratio), [q], scores)
        places = sorted(
            {(float(RATIO[t].round(9)), int(p)) for t, p in zip(TEXTURE, Q, strict=True)}
        )
        K = np.array([[correlation(p, r) for p in places] for r in places]) + 1e-8 * np.eye(7)
        cross = np.array([correlation(p, (ratio, q)) for p in places])
        return variance[0, 0] / 0.04**2 - (1 - cross @ np.linalg.solve(K, cross))

    low, high = RATIO.min(), RATIO.max()
    for ratio in np.linspace(low, high, 4):
        for q in (4, 6, 10, 12):
            assert widening(ratio, q) == pytest.approx(0, abs=1e-7)  # condition 1e8
    if axis == "h":
        distances = [math.log((q / 2 - 1) / 5) / 0.8 for q in range(12, 60, 4)]
        found = [widening(0.5, q) for q in range(12, 60, 4)]
    else:
        below = np.linspace(low, 0.001, 10)
        distances = ((low - below) / 0.3).tolist()
        found = [widening(ratio, 6) for ratio in below]
        above = (0.99 - high) / 0.3
        both = math.exp(-0.5 * above**2 - 0.5 * (math.log(9 / 5) / 0.8) ** 2)
        assert widening(0.99, 20) == pytest.approx(1 - both, abs=1e-6)
    expected = [1 - math.exp(-0.5 * d**2) for d in distances]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-6)
    assert np.all(np.diff(found) > 0)


@pytest.mark.parametrize("structure", [name for name in SHARED if "series" in name])
def test_offsets__refuse_series_where_the_rows_are_of_one(structure, observed, data):
    rule = f"noise '{structure}': expected rows of at least two series or sources, got one"
    with pytest.raises(InputError, match=re.escape(rule)):
        Offsets(Noise(structure), observed(TEXTURE, Q, -8.0))
    # The table's number of series counts, whatever rows are taken of it.
    assert Offsets(Noise(structure), data.take(data.series == 1)).n_level >= 3


@pytest.mark.parametrize("structure", ["step", "texture+step", "step-smooth"])
def test_offsets__refuse_more_levels_than_they_can_serve(structure, observed):
    steps = 2 * np.arange(2, MAX_OTHER_LEVELS + 3)
    rule = f"{MAX_OTHER_LEVELS + 1} offsets of steps, places and series; expected at most 600"
    with pytest.raises(ComputationError, match=rule):
        Offsets(Noise(structure), observed(np.zeros_like(steps), steps, -8.0))
    assert Offsets(Noise("step"), observed(np.zeros(600), steps[:600], -8.0)).n_level == 600
