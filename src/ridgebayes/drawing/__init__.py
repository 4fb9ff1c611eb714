"""Figures from plain arrays and data frames, without the package's result classes.

`drawing.style` holds the shared colours, sizes and helpers. In the other modules each function
``plot_...`` draws one matplotlib `Figure` from arrays or data frames. Only this package and
`report.figures` import matplotlib. They do not use pyplot, so figures can be drawn on any thread
and without a display. Equal input gives equal bytes. The exception is `records`, which draws for
the ``.plot()`` methods: it asks pyplot for axes if the user passes none.

Modules and matplotlib are imported on first use, not by ``from ridgebayes import drawing``.

Examples
--------
>>> import numpy as np
>>> from ridgebayes.drawing.scenes import plot_counts
>>> from ridgebayes.drawing.style import as_bytes
>>> figure = plot_counts({"Hertz": (np.array([0.001, 0.004]), np.array([4, 6]))})
>>> as_bytes(figure, "png")[1:4]
b'PNG'
"""

from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING

# Defined here because this module imports no matplotlib.
KINDS = ("png", "svg")  # files of a figure
MOST_TEXTURES = 12  # panels in a figure
PROBS = (0.5, 0.8, 0.9, 0.95, 0.99)  # of bands whose coverage is measured, and contours of designs


def __getattr__(name: str) -> object:
    home = f"ridgebayes.drawing.{name}"
    if find_spec(home) is None:
        raise AttributeError(f"module 'ridgebayes.drawing' has no attribute {name!r}")
    return import_module(home)


if TYPE_CHECKING:  # "as" marks a name as re-exported for type checkers
    from ridgebayes.drawing import coverage as coverage
    from ridgebayes.drawing import designs as designs
    from ridgebayes.drawing import forms as forms
    from ridgebayes.drawing import posterior as posterior
    from ridgebayes.drawing import predictions as predictions
    from ridgebayes.drawing import records as records
    from ridgebayes.drawing import scenes as scenes
    from ridgebayes.drawing import style as style
