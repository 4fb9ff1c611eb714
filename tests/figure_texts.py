"""Texts of a figure: which are cut, and which lie on each other."""

import itertools

from matplotlib.backends.backend_agg import FigureCanvasAgg

from ridgebayes.drawing.style import lay_out, styled


def drawn_texts(figure):
    """Return (text, bounding box) of every text that is drawn, ticks outside the axes left out."""
    with styled():
        lay_out(figure)
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        renderer = canvas.get_renderer()
        found = []
        for axes in figure.axes:
            if not axes.get_visible():
                continue
            texts = [axes.title, axes.xaxis.label, axes.yaxis.label, *axes.texts]
            for axis in (axes.xaxis, axes.yaxis):
                for tick in axis._update_ticks():
                    texts += [tick.label1] if tick.label1.get_visible() else []
            found += texts
        for legend in figure.legends:
            found += legend.get_texts()
        found += [figure._suptitle] if figure._suptitle is not None else []
        return [
            (text, text.get_window_extent(renderer))
            for text in found
            if text.get_visible() and text.get_text().strip()
        ]


def clipped_and_overlapping(figure, texts=None):
    texts = drawn_texts(figure) if texts is None else texts
    width, height = figure.bbox.width, figure.bbox.height
    clipped = [
        text.get_text()
        for text, box in texts
        if box.x0 < -1 or box.y0 < -1 or box.x1 > width + 1 or box.y1 > height + 1
    ]
    # The box of slanted text is mostly empty: only straight text is compared.
    straight = [(text, box) for text, box in texts if text.get_rotation() % 90 == 0]
    overlapping = [
        (one.get_text(), other.get_text())
        for (one, a), (other, b) in itertools.combinations(straight, 2)
        if min(a.x1, b.x1) - max(a.x0, b.x0) > 1 and min(a.y1, b.y1) - max(a.y0, b.y0) > 1
    ]
    return clipped, overlapping
