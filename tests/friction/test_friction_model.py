"""Terms, bands and shares of the worked friction model against closed forms."""

import math

import numpy as np
import pytest
import xarray as xr

import ridgebayes as rb
from ridgebayes.friction.bands import FrictionInputs

# With these known mu is tau0 E A/W alone.
ADHESION = dict.fromkeys(
    ("kappa", "beta", "tau_subject", "tau_session", "tau_rig", "sigma"), 0.0
) | {"area_factor": 1.0}


def contacts(quantities, n=4_000, p=0.01, **scene):
    """Draws of the contact at one load."""
    contact = np.broadcast_to(quantities, (n, 3)).reshape(n, 1, 3)
    values = {name: np.asarray(each, float) for name, each in scene.items()}
    at = {"p_over_E": np.full((n, 1), p), **values}
    return FrictionInputs(np.array([1.0]), contact, at, np.zeros((n, 1)))


def share(bands, name, kind="input"):
    rows = bands.shares[(bands.shares["kind"] == kind) & (bands.shares["name"] == name)]
    assert len(rows) == 1, (kind, name)
    return rows.iloc[0]


def dataset(edges=True):
    """One draw of two ridges at one load, W = 0.02 E R."""
    variables = {
        "p_over_E": 0.01,
        "contact_length_over_R": 0.1,
        "contact_fraction": 0.5,
        "extrapolation": False,
    }
    found = {name: (("draw", "load"), np.array([[v]])) for name, v in variables.items()}
    if edges:
        columns = {
            "edge_x": [-0.1, -0.05, 0.05, 0.1, np.nan],
            "edge_side": [-1, 1, -1, 1, 0],
            "edge_G": [1e-4, 3e-4, 5e-4, 2e-4, np.nan],
        }
        found |= {k: (("draw", "load", "edge"), np.array([[v]])) for k, v in columns.items()}
    return xr.Dataset(found, {"load": [1.0]})


def test_contact__asks_for_edges_with_forces():
    with pytest.raises(rb.InputError, match=r"got no edge_x|got no edge_G"):
        rb.FrictionModel().predict(dataset(edges=False))
    found = rb.FrictionModel(kappa=0).predict(dataset(edges=False))
    assert "interlocking" not in set(found.shares["name"])


def test_predict__refuses_interlocking_of_round_corners(fits):
    texture = {"ridge_width": 0.05, "groove_width": 0.0375, "corner_radius": 0.0125}
    scene = rb.Scene.from_dict({"texture": texture, "load": {"p_over_E": 0.0167}})
    drawn = rb.friction_inputs(fits["hybrid"], scene, 2, n=20, rng=1, edges=True)
    with pytest.raises(rb.InputError, match=r"needs sharp corners.*corner_radius.*kappa=0"):
        rb.FrictionModel().predict(drawn)
    assert len(rb.FrictionModel(kappa=0).predict(drawn, rng=1).bands) == 2


def test_predict__known_parameters_give_the_sum_of_terms():
    given = {**ADHESION, "tau0": 0.07, "alpha": 0.1, "area_factor": 0.8, "beta": 0.24, "kappa": 2}
    bands = rb.FrictionModel(**given).predict(dataset()).bands.iloc[0]
    expected = 0.07 * 0.8 * 5 + 0.1 + 2 / (3 * math.pi) * 0.24 * 0.1 + 2 * 0.02
    assert bands["mu_mean"] == pytest.approx(expected, rel=1e-12)
    assert bands["mu_lower"] == pytest.approx(expected, rel=1e-12)


def test_predict__band_of_a_lognormal_is_its_quantiles():
    model = rb.FrictionModel(**(ADHESION | {"tau0": "lognormal(0.07, 0.4)", "tau_subject": 0.3}))
    found = model.predict(contacts([10.0, 0.0, 0.0]), rng=1)
    spread, band = 1.645 * math.hypot(0.4, 0.3), found.bands.iloc[0]
    # Monte Carlo: the standard error of a 5 % quantile of 16,384 draws is 0.008 sd of ln mu.
    assert abs(math.log(band["mu_lower"] / 0.7) + spread) < 3 * 0.02 * 0.5
    assert abs(math.log(band["mu_upper"] / 0.7) - spread) < 3 * 0.02 * 0.5
    assert abs(math.log(band["mu_median"] / 0.7)) < 3 * 0.01 * 0.5
    assert found.mu.shape == (4_096, 1)


def test_shares__of_a_product_of_lognormals_are_the_closed_form():
    """First order (exp(s_i^2) - 1)/(exp(S) - 1), total (1 - exp(-s_i^2))/(1 - exp(-S))."""
    rng = np.random.default_rng(2)
    x = np.stack([np.exp(0.3 * rng.standard_normal(4_000)), *np.zeros((2, 4_000))], axis=1)
    model = rb.FrictionModel(
        **(ADHESION | {"tau0": "lognormal(0.07, 0.4)", "tau_subject": 0.2, "sigma": 0.1})
    )
    found = model.predict(contacts(x), rng=3)
    # The contact's draws are a sample: their own moments count.
    spreads = {"tau0": 0.4, "subject": 0.2, "repeat": 0.1}
    growth = {name: math.exp(s * s) for name, s in spreads.items()}
    growth["contact"] = (x[:, 0] ** 2).mean() / x[:, 0].mean() ** 2
    everything = math.prod(growth.values())
    for name, one in growth.items():
        row = share(found, name)
        assert abs(row["share"] - (one - 1) / (everything - 1)) < 3 * row["share_se"]
        assert abs(row["total"] - (1 - 1 / one) / (1 - 1 / everything)) < 3 * row["total_se"]
        assert 0 < row["share_se"] < 0.03
    assert {"session", "rig", "kappa"}.isdisjoint(found.shares["name"])
    assert share(found, "adhesion", "term")["share"] == pytest.approx(1, abs=1e-12)


def test_shares__of_a_scenes_values_are_those_of_an_additive_contact():
    """E A/W = 5 + u + 2 v, u and v uniform: shares 1/5 and 4/5, and none of w."""
    u, v, w = np.random.default_rng(5).uniform(-1, 1, (3, 20_000))
    x = np.stack([5 + u + 2 * v, 0 * u, 0 * u], axis=1)
    model = rb.FrictionModel(**(ADHESION | {"tau0": 0.1, "sigma": "halfnormal(1e-6)"}))
    found = model.predict(contacts(x, len(u), nu=u, a_over_R=v, b_over_R=w), rng=6)
    # Bins: 16 of them lose 1/16^2 of a variance.
    for name, exact in (("nu", 0.2), ("a_over_R", 0.8), ("b_over_R", 0.0)):
        row = share(found, name, "scene")
        assert abs(row["share"] - exact) < 3 * row["share_se"] + exact / 256 + 0.02 * exact


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"tau0": "normal(0.07, 0.01)"}, "tau0: expected a distribution of positive values"),
        ({"beta": -0.1}, "beta: expected .* got -0.1"),
        ({"kappa": float("nan")}, "kappa: expected .* got nan"),
        ({"sigma": None}, "sigma: expected .* got None"),
        ({"sigma": "narrow"}, "sigma: expected one of"),
        ({"tau0": 0, "beta": 0, "kappa": 0}, "expected one of tau0, alpha, beta, kappa above 0"),
    ],
)
def test_model__refuses_what_is_no_prior(given, words):
    with pytest.raises(rb.InputError, match=words):
        rb.FrictionModel(**given)


def test_predict__refuses_a_probability_of_one():
    with pytest.raises(rb.InputError, match="prob: expected above 0 and below 1, got 1"):
        rb.FrictionModel().predict(dataset(), prob=1)
