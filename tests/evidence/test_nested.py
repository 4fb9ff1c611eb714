import sys

import numpy as np
import pytest

from ridgebayes.errors import InputError
from ridgebayes.evidence import quadrature_evidence
from ridgebayes.evidence.nested import nested_evidence
from ridgebayes.forms import Hybrid, Modified
from ridgebayes.importance import importance_fit
from ridgebayes.laplace import fit_laplace
from ridgebayes.likelihood import Model
from ridgebayes.noise import Noise
from ridgebayes.priors import HalfNormal, LogNormal

TEXTURE = np.array([0, 0, 0, 1, 1, 1])
Q = np.array([4, 6, 8, 4, 6, 8])
WIDTH = 0.004  # of a bracket in log load: narrow beside the errors of 0.05 and more


def narrow(observed):
    """The same rows as brackets and as their middles; nothing is known to better than 5 %."""
    shift = np.array([0.05, 0.02, 0.04, -0.08, -0.02, -0.06])
    middle = 2 * np.log((Q / 2 - 1) * 0.042 / 1.38) + shift
    brackets = observed(TEXTURE, Q, middle + WIDTH / 2, rel_se=0.05, log_lower=middle - WIDTH / 2)
    return brackets, observed(TEXTURE, Q, middle, rel_se=0.05)


def quadrature(model):
    found = quadrature_evidence(model.log_density, fit_laplace(model), tol=1e-4)
    assert found.ok
    return found.value


def nested(model, seed=1, n_live=150, **options):
    return nested_evidence(model, rng=np.random.default_rng(seed), n_live=n_live, **options)


@pytest.mark.parametrize("form", [Modified(), Hybrid()], ids=lambda form: form.name)
def test_nested_evidence__of_plain_rows_is_the_quadrature(form, observed):
    model = Model(narrow(observed)[1], form)
    found = nested(model)
    assert found.ok
    assert found.method == "dynesty"
    assert 0.02 < found.se < 0.3
    assert found.value == pytest.approx(quadrature(model), abs=3 * found.se)  # Monte Carlo


def test_nested_evidence__of_offsets_integrated_out_is_the_quadrature(observed):
    model = Model(narrow(observed)[1], Modified(), Noise("texture"))
    assert not model.is_latent
    found = nested(model)
    assert found.value == pytest.approx(quadrature(model), abs=3 * found.se)  # Monte Carlo


@pytest.mark.parametrize("structure", ["texture", "step"])
def test_nested_evidence__of_sampled_offsets_is_the_quadrature_of_narrow_brackets(
    structure, observed
):
    # The probability of a narrow bracket is the density at its middle times the width; and with
    # exact rows the offsets have a closed form.
    brackets, middles = narrow(observed)
    model = Model(brackets, Modified(), Noise(structure))
    assert model.is_latent
    exact = quadrature(Model(middles, Modified(), Noise(structure)))
    found = nested(model)
    # Monte Carlo; the bracket's curvature, (width / 0.05)^2 / 24 a row, is 2e-3 in all.
    assert found.value == pytest.approx(exact + len(Q) * np.log(WIDTH), abs=3 * found.se)


def test_nested_evidence__of_sampled_offsets_with_student_errors_is_that_in_whitened_coordinates(
    observed,
):
    model = Model(narrow(observed)[1], Modified(), Noise("texture", "student"))
    assert model.is_latent
    found, importance = nested(model, n_live=100), importance_fit(model, seed=1)[1]
    assert importance.ok
    se = np.hypot(found.se, importance.se)
    assert found.value == pytest.approx(importance.value, abs=3 * se)  # Monte Carlo


def test_nested_evidence__of_counts_with_sampled_offsets_is_that_in_whitened_coordinates(observed):
    load = 2 * np.log((Q / 2 - 0.4) * 0.042 / 1.38)
    model = Model(observed(TEXTURE, Q, load, is_count=True), Modified(), Noise("step"))
    found, importance = nested(model, n_live=100), importance_fit(model, seed=1)[1]
    assert importance.ok
    se = np.hypot(found.se, importance.se)
    assert found.value == pytest.approx(importance.value, abs=3 * se)  # Monte Carlo


def test_nested_evidence__follows_replaced_priors(observed):
    priors = {"c": LogNormal(2.0, 0.05), "sigma": HalfNormal(0.2)}
    model = Model(narrow(observed)[1], Modified(), priors=priors)
    default = Model(narrow(observed)[1], Modified())
    found, expected = nested(model), quadrature(model)
    assert found.value == pytest.approx(expected, abs=3 * found.se)  # Monte Carlo
    assert abs(expected - quadrature(default)) > 10 * found.se


def test_nested_evidence__says_so_where_the_calls_were_not_enough(observed):
    found = nested(Model(narrow(observed)[1], Modified()), n_call_max=300)
    assert not found.ok
    assert np.isnan(found.value)
    assert np.isnan(found.se)
    assert found.status == "not finished after 300 likelihood calls"


def test_nested_evidence__is_the_same_for_the_same_seed(observed):
    model = Model(narrow(observed)[1], Modified())
    first, again, other = (nested(model, seed, n_live=50) for seed in (1, 1, 2))
    assert first == again
    assert first.value != other.value


def test_nested_evidence__names_the_extra_where_dynesty_is_missing(observed, monkeypatch):
    monkeypatch.setitem(sys.modules, "dynesty", None)
    with pytest.raises(InputError, match=r"needs dynesty: pip install 'ridgebayes\[dynesty\]'"):
        nested(Model(narrow(observed)[1], Modified()))
