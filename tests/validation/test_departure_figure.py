"""The figure of the smooth cylinder's departure from Hertz shows its numbers."""

import numpy as np
import pytest

from tests.validation.cylinder import plot_departure

LOADS, RATIOS = np.array([1e-3, 1e-2, 0.1]), np.array([1.0003, 1.004, 1.04])


@pytest.mark.parametrize("nu", [0.5, 0.3])
def test_plot_departure__is_the_curve_and_names_its_ratio(nu, faults):
    figure = plot_departure(LOADS, RATIOS, nu=nu)
    assert faults(figure) == ([], [])
    (axes,) = figure.axes
    curve, hertz = axes.lines
    np.testing.assert_array_equal(curve.get_data(), [LOADS, RATIOS])
    assert set(hertz.get_ydata()) == {1.0}
    (legend,) = figure.legends
    assert str(nu) in legend.get_texts()[0].get_text()
