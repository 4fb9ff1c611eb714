# ruff: noqa: RUF001  (Greek letters are intended)
"""Parts shared by all figures: colours and names of forms, safe labels, and files."""

import gc
import io
import re
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.backend_bases import FigureCanvasBase
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.font_manager import findfont, get_font
from matplotlib.style import context as style_context
from PIL import Image

from ridgebayes.drawing import KINDS
from ridgebayes.runtime.atomic import write_bytes
from ridgebayes.runtime.text import short_label, visible

# Okabe and Ito's palette can be told apart with every common colour blindness.
_FORMS = {
    "classic": ("Classic", "#D55E00", "^"),
    "power-law": ("Power law", "#009E73", "s"),
    "modified": ("Modified", "#0072B2", "o"),
    "hybrid": ("Hybrid", "#B2478F", "D"),
    "half-plane": ("Half-plane", "#6B4E00", "P"),
    "average": ("Average of forms", "#444444", "X"),
}
TITLES, COLOURS, MARKERS = (
    dict[str, str](zip(_FORMS, looks, strict=True)) for looks in zip(*_FORMS.values(), strict=True)
)
SYMBOLS = {  # of parameters, in text and on an axis
    "c": ("c", "$c$"),
    "c1": ("c₁", "$c_1$"),
    "c2": ("c₂", "$c_2$"),
    "sigma": ("σ", r"$\sigma$"),
    "tau_texture": ("τ texture", r"$\tau_\mathrm{texture}$"),
    "tau_step": ("τ step", r"$\tau_\mathrm{step}$"),
    "tau_series": ("τ series", r"$\tau_\mathrm{series}$"),
    "length_h": ("ℓ of log h", r"$\ell_h$"),
    "length_ratio": ("ℓ of a/pitch", r"$\ell_{a/\mathrm{pitch}}$"),
    "df": ("ν of Student's t", r"$\nu$ of $t$"),
}
OBSERVED = "#000000"
QUIET = "#8A8A8A"
WIDTH = 7.4  # inches; fits A4, so that a tick label of 9 pt is printed in this size
MOST_LEGEND = 4  # legend entries in a row, or on the axes
# Text that an SVG can do without: in paths digits beyond a hundredth of a point, which is far below
# a pixel, and ends of lines; elsewhere indentation.
_PATH, _SPARE = re.compile(rb'(?<= d=")[^"]*'), re.compile(rb"(?<=\.\d\d)\d+| \n")
_INDENTATION = re.compile(rb"(?<=\n) +")
_STYLE = Path(__file__).with_name("figures.mplstyle")


@contextmanager
def styled() -> Iterator[None]:
    """Use matplotlib's defaults and this package's style instead of the user's settings.

    Garbage is collected afterwards: during a drawing, which makes objects by the thousand,
    collection takes a tenth of the time and finds hardly any.
    """
    collects = gc.isenabled()
    gc.disable()
    try:
        with style_context(_STYLE, after_reset=True):
            yield
    finally:
        if collects:
            gc.enable()


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure, with sizes in inches, whose layout makes room for labels."""
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def panel_grid(
    n: int,
    row_height: float,
    margin: float,
    *,
    labels: tuple[str, str] = ("", ""),
    width: float = WIDTH,
    **shared: Any,
) -> tuple[Figure, list[Axes]]:
    """Return a figure with n panels in rows as wide as the figure, and the panels.

    Parameters
    ----------
    n : int
        Number of panels.
    row_height, margin : float, inches
        Height of a row of panels, and total height outside the panels.
    labels : tuple of str, optional
        Labels of the horizontal axes of the lowest panels and the vertical axes of the leftmost.
    width : float, inches, optional
        Width of the figure; the default width holds three panels in a row.
    **shared
        `sharex` and `sharey` of matplotlib.

    Returns
    -------
    matplotlib.figure.Figure
        Figure whose unused panels are hidden.
    list of matplotlib.axes.Axes
        The n panels.
    """
    n_column = min(max(round(3 * width / WIDTH), 1), n)
    n_row = -(-n // n_column)
    figure = new_figure(width, margin + row_height * n_row)
    panels = list(figure.subplots(n_row, n_column, squeeze=False, **shared).flat)
    for axes in panels[n:]:
        axes.set_visible(False)
    for axes in panels[max(n - n_column, 0) : n]:
        axes.set_xlabel(labels[0])
        axes.tick_params(labelbottom=True)
    for axes in panels[:n:n_column]:
        axes.set_ylabel(labels[1])
    return figure, panels[:n]


def shared_legend(figure: Figure, axes: Axes, *, at: Literal["lower", "upper"] = "lower") -> None:
    """Add the legend of one panel below or above all panels."""
    handles, labels = axes.get_legend_handles_labels()
    loc: Any = f"outside {at} center"
    figure.legend(handles, labels, loc=loc, ncols=min(len(labels), MOST_LEGEND))


def draw_intervals(axes: Axes, x: Any, loads: pd.DataFrame, over: Any = None, **look: Any) -> None:
    """Draw median loads with their bands at x, or their deviation from observed loads in per cent.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
        Axes to draw on.
    x : array_like of float, shape (n_row,)
        Horizontal positions.
    loads : pandas.DataFrame
        Columns p_over_E_median, p_over_E_lower, p_over_E_upper.
    over : array_like of float, shape (n_row,), optional
        Observed loads; if given, deviations from them are drawn.
    **look
        Keyword arguments of matplotlib's `errorbar`.
    """
    columns = (loads[f"p_over_E_{name}"] for name in ("median", "lower", "upper"))
    middle, lower, upper = (y if over is None else 100 * (y / over - 1) for y in columns)
    axes.errorbar(x, middle, yerr=[middle - lower, upper - middle], linestyle="none", **look)


def colour_of(form: str) -> str:
    """Return the colour of a form."""
    return COLOURS.get(form, QUIET)


def look_of(form: str) -> dict[str, Any]:
    """Return marker, colour and label of a form as keyword arguments of matplotlib."""
    return {
        "marker": MARKERS.get(form, "o"),
        "color": colour_of(form),
        "label": title_of(form),
    }


def title_of(form: str) -> str:
    """Return the displayed name of a form."""
    return TITLES.get(form, plain(form))


def plain(text: str, most: int = 24) -> str:
    r"""Return foreign text shortened, and escaped so that matplotlib shows it literally.

    Examples
    --------
    >>> print(plain("a$b$"))
    a\$b\$
    """
    kept = text if len(text) <= most else text[: most - 1] + "…"
    lost = "\N{REPLACEMENT CHARACTER}"
    shown = "".join(c if c.isascii() or _has_glyph(c) else lost for c in kept)
    return " ".join(visible(shown).split()).replace("$", r"\$")


@cache
def _has_glyph(character: str) -> bool:
    """Return whether the font has a glyph for a character; matplotlib warns if it does not."""
    font = get_font(findfont("DejaVu Sans"))  # installed with matplotlib, which keeps it loaded
    return bool(font.get_char_index(ord(character))) and visible(character) == character


def symbol(parameter: str) -> str:
    """Return a parameter's symbol for an axis.

    Examples
    --------
    >>> symbol("c1"), symbol("K[a0.012_b0.01]")
    ('$c_1$', '$K$ a0.012_b0.01')
    """
    if parameter.startswith("K["):
        return f"$K$ {plain(short_label(parameter[2:-1]))}"
    return SYMBOLS[parameter][1] if parameter in SYMBOLS else plain(parameter)


def texture_title(texture: tuple[float, float], rows: pd.DataFrame | None = None) -> str:
    """Return the heading of a texture's panel; it says if all rows are held out."""
    held_out = rows is not None and len(rows) and (rows["role"] == "held-out").all()
    return "$a/R$ = {:.4g}, $b/R$ = {:.4g}".format(*texture) + ("\n(held out)" if held_out else "")


def rows_by_texture(frame: pd.DataFrame) -> dict[tuple[float, float], pd.DataFrame]:
    """Return the rows of each (a/R, b/R), in order of appearance."""
    by_texture: Any = frame.groupby(["a_over_R", "b_over_R"], sort=False)
    return dict(iter(by_texture))


def as_bytes(figure: Figure, kind: str) -> bytes:
    """Return a figure as a ``png`` (180 dpi), ``svg`` or ``pdf`` file; output is deterministic."""
    file = io.BytesIO()
    with styled():
        lay_out(figure)
        # Drawn by the canvas, because `savefig` would draw everything twice.
        dpi = figure.dpi
        if kind == "png":
            agg: Any = FigureCanvasAgg(figure)
            agg.draw()
            # A palette of 256 colours takes a third of the bytes.
            pixels = Image.fromarray(np.asarray(agg.buffer_rgba())).convert("RGB")
            colours = pixels.quantize(256, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
            colours.save(file, "png", dpi=(dpi, dpi))
        elif kind == "pdf":
            from matplotlib.backends.backend_pdf import FigureCanvasPdf  # loads fontTools

            pdf: Any = FigureCanvasPdf(figure)
            pdf.print_pdf(file, metadata={"CreationDate": None, "Creator": None})
        else:
            svg: Any = FigureCanvasSVG(figure)
            svg.print_svg(file, metadata={"Date": None, "Creator": None})
        figure.dpi = dpi  # the svg and pdf canvases leave it at 72
    FigureCanvasBase(figure)  # frees the pixels
    content = file.getvalue()
    if kind == "svg":
        content = _INDENTATION.sub(b"", _PATH.sub(lambda path: _SPARE.sub(b"", path[0]), content))
    return content


def save(figure: Figure, path: Path) -> list[Path]:
    """Write a figure as PNG and SVG, each file atomically; return the files.

    `path` has no suffix.
    """
    files = [path.with_name(f"{path.name}.{kind}") for kind in KINDS]
    for file, kind in zip(files, KINDS, strict=True):
        write_bytes(as_bytes(figure, kind), file)
    return files


def lay_out(figure: Figure) -> None:
    """Lay out a figure once, so that later drawings do not repeat it."""
    if (engine := figure.get_layout_engine()) is not None:
        engine.execute(figure)
        figure.set_layout_engine("none")
