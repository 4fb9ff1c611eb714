import numpy as np
import pytest

from ridgebayes.contact import halfplane
from ridgebayes.contact.cylinder.compliance import rim_compliance, small_strain_transitions
from ridgebayes.errors import InputError
from ridgebayes.table.datafiles import data_path
from ridgebayes.table.table import read_table

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def rim():
    return rim_compliance(0.49, reach=0.24, edge=1e-3)


@pytest.mark.parametrize(("a", "b"), [(0.032, 0.01), (0.022, 0.02)])
def test_transitions__are_those_of_another_finite_element_code(rim, a, b):
    frame = read_table(data_path("fea/small_strain.csv")).frame
    half_disk = (frame["solver"] == "small-strain half disk") & (frame["nu"] == 0.49)
    frame = frame[half_disk & (frame["a_over_R"] == a) & (frame["p_over_E"] <= 0.02)]
    Q, loads = rim.transitions(a, b, p_max=0.02)
    assert Q.tolist() == frame["Q"].tolist() == [4, 6, 8, 10]
    # Reference: 0.05 %; discretisation: 0.2 % with edges of a/22 and more.
    np.testing.assert_allclose(loads, frame["p_over_E"], rtol=2.5e-3)


@pytest.mark.long
def test_transitions__come_nearer_to_the_half_plane_with_finer_edges():
    """A texture so small that the body is a half-plane to it."""
    a, b, nu = 0.008, 0.0025, 0.3
    exact = halfplane.transition_loads(a, b, 2).p_over_E(a + b, nu=nu)
    errors = []
    for edge in (8e-4, 2e-4):
        rim = rim_compliance(nu, reach=0.06, edge=edge)
        errors.append(np.abs(rim.transitions(a, b, p_max=1.01 * exact[1])[1] / exact - 1).max())
    assert errors[1] < 1e-3 < errors[0] < 0.02  # discretisation, first order at sharp corners


@pytest.mark.long
def test_transitions__depend_on_nu_by_the_reduced_load(rim):
    other = rim_compliance(0.2, reach=0.24, edge=1e-3)
    reduced = [
        one.transitions(0.032, 0.01, p_max=0.008)[1] * (1 - one.nu**2) for one in (rim, other)
    ]
    # Small strain on a body much larger than the contact: not exact, for the body is finite.
    np.testing.assert_allclose(reduced[0][:2], reduced[1][:2], rtol=2e-3)


def test_compliance__is_symmetric_and_positive(rim):
    np.testing.assert_array_equal(rim.compliance, rim.compliance.T)
    assert np.linalg.eigvalsh(rim.compliance).min() > 0


def test_rim_compliance__is_computed_once(rim):
    assert rim_compliance(0.49, reach=0.24, edge=1e-3) is rim


def test_small_strain_transitions__serve_the_incompressible_body():
    Q, loads = small_strain_transitions(0.032, 0.03, p_max=0.006)
    half_plane = halfplane.transition_loads(0.032, 0.03, 1).p_over_E(0.062)
    assert Q.tolist() == [4]
    assert loads[0] / half_plane[0] == pytest.approx(1.0, abs=0.01)  # the body is finite


def test_transitions__refuse_ridges_the_mesh_does_not_resolve(rim):
    with pytest.raises(InputError, match=r"a = 0.004, b = 0.02; expected eight edges of 0.001"):
        rim.transitions(0.004, 0.02, p_max=0.01)


def test_transitions__refuse_loads_beyond_the_rim(rim):
    with pytest.raises(InputError, match=r"p_max = 0.2; expected contact within 0.24\d* R"):
        rim.transitions(0.032, 0.01, p_max=0.2)
