import numpy as np
import pytest

from ridgebayes.contact.halfplane import transition_loads
from ridgebayes.contact.many_textures import load_function


@pytest.mark.slow
@pytest.mark.parametrize(("low", "high", "rel_tol"), [(0.1, 10.0, 1e-7), (1e-3, 50.0, 1e-5)])
def test_load_function__is_the_solver_between_its_nodes(low, high, rel_tol):
    loads = load_function(low, high, 6, rel_tol=rel_tol)
    rng = np.random.default_rng(1)
    ratio = np.exp(rng.uniform(np.log(low), np.log(high), 40))
    ridge = rng.uniform(1e-3, 0.1, 40)
    F = loads(ridge, ratio * ridge)
    for i in range(40):
        exact = transition_loads(ridge[i], ratio[i] * ridge[i], 6, rel_tol=1e-10).F
        assert np.abs(F[i] / exact - 1).max() <= rel_tol  # discretisation: as asked


def test_load_function__reaches_its_own_ends():
    loads = load_function(0.5, 2.0, 3)
    np.testing.assert_allclose(
        loads([2.0, 1.0], [1.0, 2.0]),
        [transition_loads(2.0, 1.0, 3).F, transition_loads(1.0, 2.0, 3).F],
        rtol=1e-7,  # discretisation: as asked
    )


def test_load_function__of_one_ratio_is_that_of_its_textures():
    F = load_function(1.0, 1.0, 2)([0.01, 0.02], [0.01, 0.02])
    np.testing.assert_allclose(F, np.stack([transition_loads(1.0, 1.0, 2).F] * 2), rtol=1e-7)
