"""A tail that CONTRIBUTING.md adds works with every structure, and is what it says."""

import re
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

import ridgebayes as rb
from ridgebayes import Noise
from ridgebayes.evidence.pairs import weigh_pairs
from ridgebayes.inference.latent import LatentIntegral
from ridgebayes.model import tails
from ridgebayes.model.model import Model
from tests import oracles

PAGE = Path(__file__).parents[2] / "CONTRIBUTING.md"


@pytest.fixture
def named(monkeypatch):
    (code,) = re.findall(
        r"```python\n([^`]*class Student4.*?)```", PAGE.read_text("utf-8"), re.DOTALL
    )
    assert len([line for line in code.splitlines() if line.strip()]) < 10
    space = {"StudentTail": tails.StudentTail}
    exec(compile(code, PAGE.name, "exec"), space)
    monkeypatch.setitem(tails.TAILS, "student4", space["Student4"]())
    monkeypatch.setattr(Noise, "tails", tuple(tails.TAILS))
    return Noise.named


@pytest.mark.parametrize("structure", ["iid", "texture", "texture+step"])
def test_new_tail__has_the_density_that_brute_force_gives(named, observed, structure):
    low = [np.nan, np.nan, np.nan, -7.1]
    data = observed([0] * 4, 4, [-6.98, -6.9, -6.6, -6.8], log_lower=low)
    model, n = Model(data, rb.Modified(), named(f"{structure}:student4")), 4_000
    u = np.array([[0.1, 0.3, 0.5, -0.2]])[:, : model.n_outer]
    if structure == "iid":
        coefficients, eta = oracles.split(model, u[0])
        rows = oracles.rows_log_density(model, coefficients, eta, np.zeros(4), stats.t(4))
        expected = rows.sum() + oracles.log_prior(u[0])
    else:
        expected = oracles.log_density_by_grid(model, u[0], error=stats.t(4))
    integral = LatentIntegral(model)
    found = integral.estimated(np.repeat(u, n, axis=0), np.random.default_rng(1), 16).log_density
    ratio = np.exp(found - expected)
    assert abs(ratio.mean() - 1) < 4 * ratio.std() / np.sqrt(n) + 1e-9  # Monte Carlo
    weighed = weigh_pairs(data, [rb.Modified()], [model.noise], seed=1)
    assert weighed.weighed["modified", model.noise.name].evidence.ok
