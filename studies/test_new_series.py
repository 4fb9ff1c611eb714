import numpy as np
import pytest
from scipy.stats import norm

from studies.new_series import _quantile


@pytest.mark.parametrize("p", [0.05, 0.3, 0.95])
def test_quantile__of_one_normal_and_of_two_that_mirror_each_other(p):
    one = _quantile(p, np.array([1.0, 0.0]), np.array([0.3, 9.0]), np.array([0.2, 1.0]))
    assert one == pytest.approx(0.3 + 0.2 * norm.ppf(p), abs=1e-9)  # bisection: 4 / 2^40
    both = np.array([0.5, 0.5]), np.array([-2.0, 2.0]), np.array([0.7, 0.7])
    assert _quantile(p, *both) == pytest.approx(-_quantile(1 - p, *both), abs=1e-9)
