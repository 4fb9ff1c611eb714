"""What rows tell of offsets at many textures is what they tell at each."""

import tracemalloc

import numpy as np
import pytest

from ridgebayes.model.forms import Modified
from ridgebayes.model.model import Model
from ridgebayes.model.noise import Noise
from ridgebayes.model.offsets_given import TabulatedOffsets

TEXTURES = [(0.012, 0.03), (0.02, 0.02), (0.032, 0.01)]  # the second was not fitted
Q = np.array([4, 8, 20])


@pytest.fixture(params=[*Noise.structures[1:], "step-smooth:student"])
def given(request, observed):
    """Of any number of draws from the prior, a function."""
    texture, counts = np.array([0, 0, 0, 1, 1, 2]), [4, 6, 8, 4, 6, 4]
    rows = observed(texture, counts, [-6.3, -4.8, -4.1, -6.4, -5.1, -6.4])
    model = Model(rows, Modified(), Noise.named(request.param))
    u = np.random.default_rng(1).standard_normal((7, model.n_coordinate))
    return lambda here: model.offsets_given(u[here])


@pytest.mark.parametrize("at_once", [1, 2**20])
def test_at_all__is_at_of_each_texture(given, monkeypatch, at_once):
    monkeypatch.setattr("ridgebayes.model.offsets_given._AT_ONCE", at_once)
    one = given(slice(None)).inverted()
    mean, variance = one.at_all(TEXTURES, Q)
    assert mean.shape == variance.shape == (3, 7, 3)
    for j, texture in enumerate(TEXTURES):
        expected = one.at(texture, Q)
        # Rounding: systems solved together or alone, of a covariance of condition 1e8.
        np.testing.assert_allclose(mean[j], expected[0], rtol=1e-7, atol=1e-12)
        np.testing.assert_allclose(variance[j], expected[1], rtol=1e-7, atol=1e-12)


def test_tabulated__of_some_draws_at_a_time_is_that_of_all(given):
    asked = []

    def part(here):
        asked.append(here)
        return given(here)

    parts = [lambda: part(slice(0, 3)), lambda: part(slice(3, 7))]
    table, whole = TabulatedOffsets(parts, TEXTURES), given(slice(None))
    for texture in TEXTURES:
        for found, expected in zip(table.at(texture, Q), whole.at(texture, Q), strict=True):
            np.testing.assert_allclose(found, expected, rtol=1e-7, atol=1e-12)  # rounding
    assert len(asked) == 2  # each part was worked out once, for all textures


@pytest.mark.parametrize("name", ["texture+step", "step-smooth"])
def test_what_was_asked_for__is_not_kept_by_the_model(observed, name):
    texture, counts = np.repeat(np.arange(3), 8), np.tile(np.arange(4, 20, 2), 3)
    model = Model(observed(texture, counts, -6.3 + 0.1 * counts), Modified(), Noise.named(name))
    u = np.random.default_rng(1).standard_normal((256, model.n_coordinate))
    model.offsets_given(u[:2])  # what is the same for all draws
    tracemalloc.start()
    try:
        given = model.offsets_given(u)
        held = tracemalloc.get_traced_memory()[0]
        del given
        kept = tracemalloc.get_traced_memory()[0]
    finally:
        tracemalloc.stop()
    assert held > 100_000  # bytes; a root and a factor of 256 draws
    assert kept < held / 20
