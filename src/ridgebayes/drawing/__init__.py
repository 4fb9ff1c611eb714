"""Figures from plain arrays and frames: nothing here knows a record of the package.

`drawing.style` holds what all figures share. The other modules hold one function a figure, named
``plot_...``, from arrays or frames to a matplotlib `Figure`. Only this folder and `report.figures`
import matplotlib, and never pyplot's state: figures can be drawn on any thread and without a
display. Equal input gives equal bytes. Only `records`, behind the ``.plot()`` of records, asks
pyplot for axes where it is given none.

Examples
--------
>>> import numpy as np
>>> from ridgebayes.drawing.scenes import plot_counts
>>> from ridgebayes.drawing.style import as_bytes
>>> figure = plot_counts({"Hertz": (np.array([0.001, 0.004]), np.array([4, 6]))})
>>> as_bytes(figure, "png")[1:4]
b'PNG'
"""

MOST_TEXTURES = 12  # that one figure has panels for; here, where it loads nothing
