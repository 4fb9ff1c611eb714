"""Draws given all rows, weighted for the rows that stay: densities by hand, and what is enough."""

import numpy as np
import pytest

from ridgebayes.checks.all_rows import AllRows, Told
from ridgebayes.model.forms import Modified, PowerLaw
from ridgebayes.model.model import Model
from ridgebayes.model.noise import Noise


@pytest.fixture
def data(observed):
    return observed([0, 0, 1, 1], [4, 6, 4, 6], [-6.3, -4.8, -6.4, -5.1])


def known(data, form=None):
    """Two hundred draws of the prior."""
    model = Model(data, form or Modified(), Noise())
    u = np.random.default_rng(1).standard_normal((200, model.n_parameter))
    log_likelihood = model.log_likelihood(model.to_theta(u))
    return AllRows(u, log_likelihood, (), names=model.parameter_names), model.to_theta(u)


def test_told__weighs_by_one_over_the_density_of_the_rows_left_out(data):
    draws, theta = known(data)
    one = Model(data.take(np.arange(4) == 3), Modified(), Noise()).log_likelihood(theta)
    told = draws.told(Model(data.take(np.arange(4) < 3), Modified(), Noise()))
    np.testing.assert_allclose(told.joint, one, rtol=1e-12)  # rows are independent: rounding
    assert told.weight.sum() == pytest.approx(1, rel=1e-12)
    # All but the tail, which is smoothed, are in proportion: rounding.
    low = np.argsort(-one)[:100]
    ratio = told.weight[low] * np.exp(one[low])
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-10)
    assert told.share == pytest.approx(1 / (200 * (told.weight**2).sum()), rel=1e-12)


def test_told__is_none_of_other_parameters(data):
    draws, _ = known(data, PowerLaw())
    assert draws.told(Model(data.take(data.texture == 0), PowerLaw(), Noise())) is None


@pytest.mark.parametrize(
    ("n", "shape", "share", "is_enough"),
    [
        (2_048, 0.3, 0.34, False),
        (2_048, 0.3, 0.36, True),
        (2_048, 0.71, 0.36, False),
        (2_048, np.inf, 0.36, False),
        (200, 0.3, 0.49, False),  # under a hundred draws
        (200, 0.3, 0.51, True),
    ],
)
def test_told__is_enough_where_many_draws_count(n, shape, share, is_enough):
    assert Told(np.ones(n) / n, np.zeros(n), shape, share).is_enough == is_enough
