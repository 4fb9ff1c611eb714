import numpy as np
import pytest

from ridgebayes.errors import InputError
from ridgebayes.evidence import quadrature_evidence, savage_dickey


def test_savage_dickey__of_the_sweep_is_the_reference_value(fits):
    found = savage_dickey(fits["hybrid"])
    # Reference: ln BF of Hybrid over Modified of the 41 rows, independent code, printed to 1e-4.
    assert found.value == pytest.approx(4.5241, abs=0.02)
    assert found.ok
    assert found.method == "savage-dickey"
    assert 0 < found.se < 0.02
    assert abs(found.value - 4.5241) < 4 * found.se  # Monte Carlo


def test_savage_dickey__is_the_difference_of_evidences_on_other_rows(
    fe_fits, fe_models, fe_laplaces
):
    # Here zero is inside the posterior of c2 and Modified is the better form.
    found = savage_dickey(fe_fits["hybrid"])
    hybrid, modified = (
        quadrature_evidence(fe_models[name].log_density, fe_laplaces[name]).value
        for name in ("hybrid", "modified")
    )
    # Monte Carlo: four standard errors, and the grid's own discretisation.
    assert found.value == pytest.approx(hybrid - modified, abs=4 * found.se + 2e-3)
    assert np.sign(found.value) == -1


def test_savage_dickey__refuses_other_forms(fits):
    with pytest.raises(InputError, match="form 'modified' given; rule: hybrid"):
        savage_dickey(fits["modified"])
