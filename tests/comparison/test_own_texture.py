"""The table that predicts textures that were not fitted: against predictions of their own."""

import json
import math
from dataclasses import dataclass, replace

import numpy as np
import pytest

import ridgebayes as rb
from ridgebayes.comparison.own_texture import own_texture


def quantiles(table):
    """The table's quantiles of ln(p/E), shape (n_ratio, n_Q, n_prob); infinite where None."""
    shape = [len(table[name]) for name in ("ratio", "Q", "prob")]
    values = [math.inf if one is None else one for one in table["g"]]
    return table["unit"] * np.reshape(values, shape)


@pytest.fixture(scope="module")
def made(comparison):
    return own_texture(comparison).table


def test_table__is_small_and_plain(made):
    assert len(json.dumps(made, allow_nan=False)) < 200_000
    assert made["ratio"] == sorted(set(made["ratio"]))
    low, high = made["calibrated"]["a_over_pitch"]
    assert {round(low, 9), round(high, 9)} <= {round(one, 9) for one in made["ratio"]}
    assert made["prob"] == pytest.approx(sorted(1 - p for p in made["prob"]), rel=1e-12)
    assert made["knows"] is made["power_law"] is False


@pytest.mark.parametrize(("pitch", "nu"), [(0.042, 0.5), (0.3, 0.3)])
def test_table__is_what_predict_load_gives_at_any_pitch_and_poissons_ratio(
    comparison, made, pitch, nu
):
    found = quantiles(made)
    shift = 2 * math.log(pitch) - math.log((1 - nu**2) / 0.75)
    for i in (0, 9, len(found) - 1):
        a = made["ratio"][i] * pitch
        loads = comparison.predict_load(a, pitch - a, made["Q"], nu=nu)
        expected = np.log([loads.quantile(p) for p in made["prob"]]).T
        apart, middle = np.abs(found[i] + shift - expected), slice(3, -3)
        # Discretisation of the distribution function; beyond, a second form of 1 % has its own.
        assert apart[:, middle].max() < 1e-3
        assert apart.max() < 0.05


@pytest.mark.parametrize(
    "noise",
    [
        "iid:student",
        *(
            pytest.param(name, marks=pytest.mark.long)
            for name in ("step-smooth", "texture+step", "texture:student")
        ),
    ],
)
def test_table__scales_under_every_error_model(paper, noise):
    forms = [rb.Modified(), rb.Hybrid()]
    compared = rb.compare(paper, forms, noise=noise, rng=1, accuracy="quick")
    table = own_texture(compared).table
    assert table["knows"] is ("texture" in noise)
    i, pitch, Q = 12, 0.037, [4, 8, 14]
    a = table["ratio"][i] * pitch
    loads, columns = compared.predict_load(a, pitch - a, Q), [table["Q"].index(one) for one in Q]
    sd = np.log(loads.quantile(0.75) / loads.quantile(0.25)) / 1.35
    for p in (0.05, 0.5, 0.95):
        got = quantiles(table)[i, columns, table["prob"].index(p)] + 2 * math.log(pitch)
        # Monte Carlo: offsets of Student errors are drawn, anew for each texture, at 640 draws.
        most = 2e-4 if ":student" not in noise else 0.25 * sd
        assert np.all(np.abs(got - np.log(loads.quantile(p))) < most)


def test_table__has_no_load_where_draws_reach_no_further_ridge(paper):
    wide = {"hybrid": {"c2": "normal(-0.3, 0.01)"}}  # its rate is below 0 on narrow ridges
    compared = rb.compare(paper, rb.Hybrid(), noise="iid", priors=wide, rng=1, accuracy="quick")
    table = own_texture(compared).table
    ratio, share = table["ratio"][0], np.array(table["prob"])
    reached = float(compared.predict_load(ratio, 1 - ratio, 8).cdf(1e9))
    found = quantiles(table)[0, table["Q"].index(8)]
    assert np.isinf(found[share > reached + 0.01]).all()
    assert np.isfinite(found[share < reached - 0.01]).all()


@dataclass(frozen=True)
class Fixed(rb.Modified):
    """A form that knows a length of its own."""

    name = "fixed"

    def shape(self, Q, a_over_R, b_over_R):
        return super().shape(Q, a_over_R, b_over_R) + 0.01

    def pairs(self, shape, a_over_R, b_over_R):
        return super().pairs(shape - 0.01, a_over_R, b_over_R)


def test_table__is_left_out_and_says_why(paper, comparison):
    found = own_texture(rb.compare(paper, Fixed(), noise="iid", rng=1, accuracy="quick"))
    assert found.table is None
    assert "fixed: expected loads in proportion to the squared pitch" in found.why
    own = {"power-law": {"K": "lognormal(60, 0.3)"}}
    found = own_texture(rb.compare(paper, "power-law", noise="iid", priors=own, accuracy="quick"))
    assert found.table is None
    assert "expected a prior of K in proportion to the pitch" in found.why
    none = comparison.evidence.assign(used=False)
    assert "no form has an evidence" in own_texture(replace(comparison, evidence=none)).why
