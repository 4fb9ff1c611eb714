"""Maps of designs."""

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from ridgebayes.drawing.designs import draw_designs


@pytest.mark.parametrize(("a", "b"), [([0.01], [0.01, 0.02, 0.03]), ([0.02, 0.04], [0.03])])
def test_map__of_a_single_width_has_cells_that_can_be_seen(a, b):
    grid = pd.MultiIndex.from_product([a, b], names=["a_over_R", "b_over_R"]).to_frame(index=False)
    rows = grid.assign(probability=0.5, margin=0.1, extrapolation=False)
    axes = Figure().subplots()
    draw_designs(axes, rows, (a[0], b[0]), "probability", is_met=True)
    corners = axes.collections[0].get_coordinates()
    assert np.ptp(corners[..., 0]) > 0
    assert np.ptp(corners[..., 1]) > 0
