"""Forms that no row can tell apart: by the loads that their coefficients reach."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

import ridgebayes as rb
from ridgebayes.comparison.same_loads import same_loads
from tests.drawn import model_of, points_of

FORMS = (rb.Classic(), rb.Modified(), rb.Hybrid(), rb.PowerLaw(), rb.HalfPlane())
ONE, EQUAL, TWO, FOUR = (
    ((0.022, 0.02),),
    # Ridges of a third of the pitch, as decimals hold them.
    ((0.012, 0.024), (0.021, 0.042), (0.009, 0.018)),
    ((0.012, 0.03), (0.032, 0.01)),
    ((0.012, 0.03), (0.032, 0.01), (0.022, 0.02), (0.018, 0.045)),
)


class Root(rb.Modified):
    """Modified by the root of its coefficient: the same loads by other numbers."""

    name = "root"

    def rate(self, theta, a_over_R, b_over_R):
        return super().rate(theta, a_over_R, b_over_R) ** 2

    def log_rate_gradient(self, theta, a_over_R, b_over_R):
        return 2 * super().log_rate_gradient(theta, a_over_R, b_over_R)


@pytest.fixture(scope="module")
def rows(observed):
    """Make rows of textures at counts; what their loads are does not matter."""

    def made(textures, counts, **kinds):
        texture = np.repeat(np.arange(len(textures)), len(counts))
        log_load = np.linspace(-8.0, -4.0, len(texture))
        return observed(
            texture, np.tile(counts, len(textures)), log_load, textures=textures, **kinds
        )

    return made


def fit(data, form, score=0.0, priors=None):
    """Return a posterior of one draw, at scores of the prior."""
    model = model_of(data, form, priors=priors)
    return points_of(model, u=np.full((1, model.n_parameter), score))


def alike(data, forms=FORMS):
    """Return the pairs of forms that reach the same loads; each asked both ways."""
    fits = {form.name: fit(data, form) for form in forms}
    found = {pair: same_loads(*(fits[name] for name in pair)) for pair in combinations(fits, 2)}
    for (one, other), answer in found.items():
        assert same_loads(fits[other], fits[one]) == answer
    return {frozenset(pair) for pair, answer in found.items() if answer}


def pairs(*groups):
    return {frozenset(pair) for group in groups for pair in combinations(group, 2)}


FREE = ("modified", "hybrid", "power-law")


@pytest.mark.parametrize(
    ("textures", "counts", "expected"),
    [
        (ONE, [4], pairs([form.name for form in FORMS])),  # a factor for the one load
        (ONE, [4, 6, 8], pairs(FREE)),
        (EQUAL, [4, 6], pairs(["modified", "hybrid"])),  # c1 + c2 pitch/a is one number
        (EQUAL, [6], pairs(["classic", "modified", "hybrid", "half-plane"])),
        (TWO, [4, 6], pairs(["hybrid", "power-law"])),  # two rates by two coefficients
        (FOUR, [4], set()),
        (FOUR, [4, 6], set()),
        (FOUR[:1] + FOUR[3:], [4, 6], pairs(["modified", "hybrid"])),  # of one a/pitch again
    ],
)
def test_pairs__are_those_whose_coefficients_reach_each_others_loads(
    rows, textures, counts, expected
):
    assert alike(rows(textures, counts)) == expected


def test_pairs__count_the_load_of_the_next_count_where_counts_were_seen(rows):
    forms = (rb.Classic(), rb.Modified())
    assert alike(rows(ONE, [2], is_count=True), forms) == pairs(["classic", "modified"])
    assert alike(rows(ONE, [4], is_count=True), forms) == set()
    assert alike(rows(ONE, [4], log_lower=-9.0), forms) == pairs(["classic", "modified"])
    assert alike(rows(ONE, [4], log_lower=-np.inf), forms) == pairs(["classic", "modified"])


@pytest.mark.parametrize("scores", [(-1.0, -1.0), (1.5, 1.5), (20.0, 0.0), (-20.0, 0.0)])
def test_pairs__do_not_hang_on_the_draws(rows, scores):
    for textures, expected in ((EQUAL, True), (FOUR, False)):
        data = rows(textures, [4, 6])
        fits = [
            fit(data, form, u) for form, u in zip((rb.Modified(), rb.Hybrid()), scores, strict=True)
        ]
        assert same_loads(*fits) == expected


def test_pairs__of_a_users_own_form(rows):
    forms = (rb.Modified(), rb.Hybrid(), Root())
    assert alike(rows(ONE, [4, 6]), forms) == pairs([form.name for form in forms])
    assert alike(rows(FOUR, [4, 6]), forms) == pairs(["modified", "root"])


def test_pairs__of_nearly_one_a_over_pitch_are_not_the_same(rows):
    near = (EQUAL[0], (0.021, 0.04201))
    assert alike(rows(near, [4, 6]), (rb.Modified(), rb.Hybrid())) == set()


@pytest.mark.parametrize("sd", [1e-3, 5.0])
def test_points__are_moved_until_they_have_loads(rows, sd):
    # Where 0 is the draw of c2, Modified has its loads; half a wide prior's sd off no load is left.
    data = rows(FOUR, [4, 6])
    hybrid = fit(data, rb.Hybrid(), priors={"c2": rb.Normal(0.0, sd)})
    assert not same_loads(hybrid, fit(data, rb.Modified()))


def test_pairs__of_thousands_of_textures_take_a_moment(rows):
    rng = np.random.default_rng(1)
    textures = tuple((float(a), 2 * float(a)) for a in rng.uniform(0.01, 0.03, 3_000))
    data = rows(textures, [4])
    assert alike(data, (rb.Classic(), rb.Modified(), rb.Hybrid(), rb.PowerLaw())) == pairs(
        ["classic", "modified", "hybrid"]
    )
    last = replace(data, textures=(*textures[:-1], (0.02, 0.03)))
    assert alike(last, (rb.Modified(), rb.Hybrid())) == set()
