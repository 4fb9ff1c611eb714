"""Every plot: records in, a matplotlib Figure out.

The only package that imports matplotlib and corner, and never pyplot's state: figures can be drawn
on any thread and without a display. Equal records give equal bytes.
"""

from ridgebayes.report.figures.gallery import Plate, begin_gallery, gallery, save_figures

__all__ = ["Plate", "begin_gallery", "gallery", "save_figures"]
