"""Figures from plain arrays and frames: nothing here knows a record of the package.

`drawing.style` holds what all figures share. The other modules hold one function a figure, named
``plot_...``, from arrays or frames to a matplotlib `Figure`. Only this folder and `report.figures`
import matplotlib, and never pyplot's state: figures can be drawn on any thread and without a
display. Equal input gives equal bytes. Only `records`, behind the ``.plot()`` of records, asks
pyplot for axes where it is given none.

Modules load on first use, and matplotlib with them: ``from ridgebayes import drawing`` loads none.

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

MOST_TEXTURES = 12  # that one figure has panels for; here, where it loads nothing


def __getattr__(name: str) -> object:
    home = f"ridgebayes.drawing.{name}"
    if find_spec(home) is None:
        raise AttributeError(f"module 'ridgebayes.drawing' has no attribute {name!r}")
    return import_module(home)


if TYPE_CHECKING:  # "as": for type checkers that ask what is offered
    from ridgebayes.drawing import coverage as coverage
    from ridgebayes.drawing import designs as designs
    from ridgebayes.drawing import forms as forms
    from ridgebayes.drawing import posterior as posterior
    from ridgebayes.drawing import predictions as predictions
    from ridgebayes.drawing import records as records
    from ridgebayes.drawing import scenes as scenes
    from ridgebayes.drawing import style as style
