"""What the tests of figures share: which text of a figure cannot be read."""

import itertools

import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from ridgebayes.drawing.style import lay_out, styled


def clipped_and_overlapping(figure):
    with styled():
        lay_out(figure)
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        renderer = canvas.get_renderer()
        texts = [text for legend in figure.legends for text in legend.get_texts()]
        for axes in filter(lambda axes: axes.get_visible(), figure.axes):
            texts += [axes.title, axes.xaxis.label, axes.yaxis.label]
            for axis in (axes.xaxis, axes.yaxis):
                texts += [tick.label1 for tick in axis._update_ticks()]
        boxes = [
            (text.get_text(), text.get_window_extent(renderer))
            for text in texts
            if text.get_visible() and text.get_text().strip()
        ]
    clipped = [
        text
        for text, box in boxes
        if box.x0 < 0
        or box.y0 < 0
        or box.x1 > figure.bbox.width + 1
        or box.y1 > figure.bbox.height + 1
    ]
    overlapping = [
        (one, other)
        for (one, a), (other, b) in itertools.combinations(boxes, 2)
        if min(a.x1, b.x1) - max(a.x0, b.x0) > 1 and min(a.y1, b.y1) - max(a.y0, b.y0) > 1
    ]
    return clipped, overlapping


@pytest.fixture(scope="session")
def faults():
    """Return the function from a figure to its clipped texts and its pairs of overlapping ones."""
    return clipped_and_overlapping
