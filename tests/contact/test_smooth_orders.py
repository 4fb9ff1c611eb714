"""The smooth cylinder's contact width by two element orders: docs/two-scale/smooth_orders.py."""

import runpy
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from ridgebayes.contact.two_scale import width_ratio

SCRIPT = Path(__file__).parents[2] / "docs" / "two-scale" / "smooth_orders.py"
ORDERS = SimpleNamespace(**runpy.run_path(str(SCRIPT)))
WIDTHS = ["root_over_hertz", "moment_over_hertz", "gap_over_hertz"]


@pytest.fixture(scope="module")
def stored():
    """Rows of the table, by all that tells them apart."""
    table = pd.read_csv(SCRIPT.with_suffix(".csv"))
    return table.set_index(["elements", "edges", "nu", "p_over_E"]).sort_index()


def apart(stored, edges):
    """Bilinear widths over quadratic ones, less 1."""
    return stored.loc["bilinear", edges][WIDTHS] / stored.loc["quadratic", edges][WIDTHS] - 1


@pytest.fixture(scope="module")
def coarsest():
    """Rows of the coarsest mesh at nu = 0.5, computed."""
    rows = [row for kind in ORDERS.REPLACED for row in ORDERS.rows_of(kind, 0.5, 0)]
    return pd.DataFrame(rows).set_index(["elements", "edges", "nu", "p_over_E"])


def test_pressures__ripple_only_where_the_rim_is_not_that_of_the_elements(coarsest):
    # Two thirds of an even pressure on middle nodes that bear half: some percent on any mesh.
    ripple = coarsest["ripple"]
    assert ripple.loc[["quadratic", "bilinear"]].max() < 1e-3
    assert ripple.loc["bilinear, bent rim"].min() > 0.01


def test_stored_rows__are_those_of_the_script(stored, coarsest):
    same = [*WIDTHS[1:], "ripple"]
    there = stored.loc[coarsest.index, same]
    # Rounding to six digits, and what Newton's tolerance leaves of a pressure.
    np.testing.assert_allclose(coarsest[same], there, rtol=1e-5, atol=1e-5)


def test_two_orders__are_apart_by_the_square_of_the_edges(stored):
    first, second, third = (
        apart(stored, edges)["moment_over_hertz"].abs() for edges in (8.0, 16.0, 32.0)
    )
    # Order: each mesh has edges of half the length.
    assert (first / second).between(2.5, 6.0).all()
    assert (second / third).between(2.5, 6.0).all()


def test_two_orders__agree_within_a_fifth_of_a_percent_in_every_measure(stored):
    assert len(apart(stored, 32.0)) == 12
    # Discretisation: 0.2 % is asked for, the page says 0.01 % and 0.04 %.
    assert apart(stored, 32.0).abs().to_numpy().max() < 1e-4
    assert apart(stored, 16.0).abs().to_numpy().max() < 4e-4


def test_stored_ripple__stays_on_finer_meshes_where_the_rim_is_bent(stored):
    bent = stored.loc["bilinear, bent rim"]["ripple"]
    assert bent.loc[32.0].min() > 0.02
    assert (bent.loc[32.0] / bent.loc[8.0]).min() > 1.0
    assert stored.loc[["quadratic", "bilinear"]]["ripple"].xs(32.0, level="edges").max() < 2e-4


def test_both_orders__have_the_width_of_the_embedded_table(stored):
    fine = stored.loc[["quadratic", "bilinear"]].xs(32.0, level="edges")
    nu, p = (fine.index.get_level_values(name).to_numpy() for name in ("nu", "p_over_E"))
    known = np.array([float(width_ratio(*one)) for one in zip(p, nu, strict=True)])
    # Discretisation, and of the gap what a cubic leaves.
    assert np.abs(fine["root_over_hertz"] / known - 1).max() < 2e-4
    assert np.abs(fine["gap_over_hertz"] / known - 1).max() < 5e-4
