import numpy as np
import pytest

from ridgebayes import read_table
from ridgebayes.contact import halfplane
from ridgebayes.contact.cylinder.small_strain import small_strain_transitions
from ridgebayes.table.datafiles import data_path

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(("a", "b"), [(0.032, 0.01), (0.022, 0.02)])
def test_transitions__are_those_of_another_finite_element_code(a, b):
    frame = read_table(data_path("fea/small_strain.csv")).frame
    half_disk = (frame["solver"] == "small-strain half disk") & (frame["nu"] == 0.49)
    frame = frame[half_disk & (frame["a_over_R"] == a) & (frame["p_over_E"] <= 0.02)]
    Q, loads = small_strain_transitions(a, b, nu=0.49, p_max=0.02)
    assert Q.tolist() == frame["Q"].tolist() == [4, 6, 8, 10]
    # Reference: 0.05 %; discretisation: 0.1 % with 24 edges a ridge.
    np.testing.assert_allclose(loads, frame["p_over_E"], rtol=1.5e-3)


@pytest.mark.long
def test_transitions__come_nearer_to_the_half_plane_with_finer_edges():
    """A texture so small that the body is a half-plane to it."""
    a, b, nu = 0.008, 0.0025, 0.3
    exact = halfplane.transition_loads(a, b, 2).p_over_E(a + b, nu=nu)
    errors = []
    for edges in (6, 24):
        found = small_strain_transitions(a, b, nu=nu, p_max=1.01 * exact[1], edges=edges)[1]
        errors.append(np.abs(found / exact - 1).max())
    assert errors[1] < 1e-3 < errors[0] < 0.02  # discretisation, first order at sharp corners


@pytest.mark.long
def test_transitions__depend_on_nu_by_the_reduced_load():
    reduced = [
        small_strain_transitions(0.032, 0.01, nu=nu, p_max=0.008)[1][:2] * (1 - nu**2)
        for nu in (0.49, 0.2)
    ]
    # Small strain on a body much larger than the contact: not exact, for the body is finite.
    np.testing.assert_allclose(*reduced, rtol=2e-3)


def test_small_strain_transitions__go_on_where_the_contact_is_as_wide_as_the_body():
    Q, loads = small_strain_transitions(0.1, 0.05, nu=0.3, p_max=0.2, edges=8)
    assert Q.tolist() == list(range(4, 4 + 2 * len(Q), 2))
    assert len(Q) >= 3
    assert loads[-1] > 0.1
    assert (np.diff(loads, 2) > 0).all()
