"""All figures of a comparison, under stable names."""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from weakref import WeakKeyDictionary

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from ridgebayes.checks.held_out import held_out_loads
from ridgebayes.checks.load_errors import has_slopes, percent_errors, slopes_table
from ridgebayes.checks.predictive_checks import posterior_checks, prior_bands
from ridgebayes.checks.smooth import smooth_cylinder
from ridgebayes.comparison.bands import AVERAGE, bands_table
from ridgebayes.comparison.comparison import Comparison
from ridgebayes.comparison.ranking import (
    best_form,
    factors_by_method,
    forms_by_probability,
    sensitivity_factors,
)
from ridgebayes.drawing.style import as_bytes, styled
from ridgebayes.errors import InputError
from ridgebayes.inference.presets import QUICK
from ridgebayes.report.figures.bands import MOST_TEXTURES, bands_figure, held_out_figure
from ridgebayes.report.figures.coverage import plot_coverage
from ridgebayes.report.figures.evidence import forest_figure, sensitivity_figure
from ridgebayes.report.figures.forms import percent_error_figure, slope_figure, smooth_figure
from ridgebayes.report.figures.posterior import corner_figure, trace_figure
from ridgebayes.report.figures.predictive_checks import plot_posterior_checks, plot_prior_bands
from ridgebayes.results import Fit
from ridgebayes.runtime.atomic import cannot_write, replacing
from ridgebayes.runtime.pool import submit_or_defer


@dataclass(frozen=True, eq=False)
class Plate:
    """A figure with its name.

    Parameters
    ----------
    name : str
        File name without suffix, such as ``corner-hybrid``.
    figure : matplotlib.figure.Figure
        The figure.
    """

    name: str
    figure: Figure

    @cached_property
    def png(self) -> bytes:
        """The figure as PNG."""
        return as_bytes(self.figure, "png")

    @cached_property
    def svg(self) -> bytes:
        """The figure as SVG."""
        return as_bytes(self.figure, "svg")


@dataclass(frozen=True)
class Print:
    """A figure that a worker drew: its name and its files' content."""

    name: str
    png: bytes
    svg: bytes


_N_LOAD = 300  # of one panel's band: steps as sharp as a pixel
_BEYOND = 1.6  # how far beyond a texture's own highest load its panel goes

# A run draws each figure for its folder and again for its reports: the second time is for free.
_drawn: "WeakKeyDictionary[Comparison, dict[str, Plate | Print]]" = WeakKeyDictionary()

_under_way: "WeakKeyDictionary[Comparison, list[Callable[[], list[Print]]]]" = WeakKeyDictionary()


def gallery(comparison: Comparison) -> dict[str, Plate | Print]:
    """Draw every figure that applies to a comparison.

    Parameters
    ----------
    comparison : Comparison
        As computed, or read back from a run folder: the figures are the same.

    Returns
    -------
    dict of str to Plate
        By name, in this order: ``evidence``, ``prior-sensitivity`` where there are two forms;
        ``bands``; ``held-out`` where rows were; ``percent-error``, ``slopes``,
        ``smooth-cylinder``; ``coverage`` where it was counted; ``posterior-checks`` and
        ``prior-bands`` of the best form; ``corner-<form>`` and ``traces-<form>`` of each fit.
        Of a quick comparison only ``evidence``, ``bands``, ``held-out``, ``percent-error`` and the
        best form's corner. Kept as long as the comparison is; figures that workers drew, see
        `begin_gallery`, are there as their files' content alone.
    """
    if comparison in _under_way:
        prints = {one.name: one for result in _under_way.pop(comparison) for one in result()}
        _drawn[comparison] = {n: prints[n] for n in _recipes(comparison) if n in prints}
    if comparison not in _drawn:
        with styled():
            figures = {name: recipe() for name, recipe in _recipes(comparison).items()}
        _drawn[comparison] = {n: Plate(n, figure) for n, figure in figures.items() if figure}
    return _drawn[comparison]


def begin_gallery(comparison: Comparison, executor: Executor) -> None:
    """Have workers begin to draw a comparison's figures; `gallery` waits for them.

    Parameters
    ----------
    comparison : Comparison
        What to draw.
    executor : concurrent.futures.Executor
        Processes with the same libraries and fonts as this one: those of this machine.
    """
    # What rows tell of shared offsets is worked out once for those that predict.
    tasks = [["bands", "held-out"]]
    tasks += [[name] for name in _recipes(comparison) if name not in tasks[0]]
    _under_way[comparison] = [
        submit_or_defer(executor, _prints, comparison, names) for names in tasks
    ]


def _prints(comparison: Comparison, names: Sequence[str]) -> list[Print]:
    recipes, found = _recipes(comparison), []
    for name in names:
        with styled():
            figure = recipes[name]()
        if figure is not None:
            found.append(Print(name, as_bytes(figure, "png"), as_bytes(figure, "svg")))
    return found


def _recipes(comparison: Comparison) -> dict[str, Callable[[], Figure | None]]:
    """Return how to draw each figure that may apply; None comes of those that do not after all."""
    best, is_quick = best_form(comparison), comparison.accuracy == QUICK.name
    shown = best or next(iter(comparison.fits))
    found: dict[str, Callable[[], Figure | None]] = {}
    if best is not None and len(comparison.fits) > 1:
        found["evidence"] = partial(_evidence, comparison, best)
        if not is_quick:
            found["prior-sensitivity"] = partial(_sensitivity, comparison, best)
    found["bands"] = partial(_bands, comparison, shown)
    found["held-out"] = partial(_held_out, comparison)
    found["percent-error"] = partial(_percent_error, comparison)
    if is_quick:
        return found | {f"corner-{shown}": partial(corner_figure, comparison.fits[shown])}
    found["slopes"] = partial(_slopes, comparison)
    found["smooth-cylinder"] = lambda: smooth_figure(smooth_cylinder())
    found["coverage"] = partial(_coverage, comparison)
    found["posterior-checks"] = partial(_posterior_checks, comparison.fits[shown])
    found["prior-bands"] = partial(_prior_bands, comparison.fits[shown])
    for name in forms_by_probability(comparison):
        found[f"corner-{name}"] = partial(corner_figure, comparison.fits[name])
        found[f"traces-{name}"] = partial(trace_figure, comparison.fits[name])
    return found


def _evidence(comparison: Comparison, best: str) -> Figure | None:
    factors = factors_by_method(comparison, best)
    return forest_figure(factors, best) if len(factors) else None


def _sensitivity(comparison: Comparison, best: str) -> Figure | None:
    factors = sensitivity_factors(comparison, best)
    return sensitivity_figure(factors, best) if len(factors) else None


def _percent_error(comparison: Comparison) -> Figure | None:
    errors = percent_errors(comparison)
    return percent_error_figure(errors) if len(errors) else None


def _slopes(comparison: Comparison) -> Figure | None:
    if not has_slopes(comparison):
        return None
    slopes = slopes_table(comparison)
    return slope_figure(slopes[slopes["form"] != "classic"])


def _coverage(comparison: Comparison) -> Figure | None:
    return plot_coverage(comparison.coverage) if len(comparison.coverage) else None


def _posterior_checks(fit: Fit) -> Figure | None:
    if not fit.model.data.is_exact.any():
        return None
    return plot_posterior_checks(posterior_checks(fit, rng=fit.seed))


def _prior_bands(fit: Fit) -> Figure | None:
    bands = prior_bands(fit.model, rng=fit.seed)
    return plot_prior_bands(bands, fit.model.data, fit.form.name) if len(bands) else None


def _bands(comparison: Comparison, form: str) -> Figure:
    frame = comparison.table.frame
    rows = frame[(frame["status"] == "ok") & (frame["kind"] == "transition")]
    # One figure holds so many panels: textures beyond are in the run folder's bands.csv.
    textures = comparison.table.textures[:MOST_TEXTURES]
    parts = []
    for a, b in textures:
        own = rows[(rows["a_over_R"] == a) & (rows["b_over_R"] == b)]["p_over_E"]
        top = float(own.max() if len(own) else rows["p_over_E"].max())
        shown = (np.linspace(0.0, np.sqrt(_BEYOND * top), _N_LOAD) ** 2)[1:]
        parts.append(
            bands_table(comparison, textures=[(a, b)], forms=[form], loads=shown, compressed=True)
        )
    bands = pd.concat(parts, ignore_index=True)
    return bands_figure(bands, rows, form, n_texture=len(comparison.table.textures))


def _held_out(comparison: Comparison) -> Figure | None:
    loads = held_out_loads(comparison)
    if len(loads):
        # A texture that the power law has no K for is a draw from its prior: a bar across the page.
        loads = loads[~loads["prior_alone"]]
        if len(comparison.fits) == 1:
            loads = loads[loads["form"] != AVERAGE]
    return held_out_figure(loads) if len(loads) else None


def save_figures(comparison: Comparison, folder: str | os.PathLike[str]) -> tuple[str, ...]:
    """Write every figure as PNG (150 dpi) and SVG.

    Parameters
    ----------
    comparison : Comparison
        What to draw.
    folder : str or path
        Made if it does not exist. Each file is written whole or not at all.

    Returns
    -------
    tuple of str
        File names written.

    Raises
    ------
    InputError
        If the folder cannot be made where it is to be.
    OutputError
        If it cannot be written to, such as on a full disk.
    """
    target = Path(folder)
    written = []
    try:
        target.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError) as error:
        raise InputError(f"{target}: cannot write figures ({error.strerror})") from None
    except OSError as error:
        raise cannot_write(target, error) from None
    for plate in gallery(comparison).values():
        for name, content in (
            (f"{plate.name}.png", plate.png),
            (f"{plate.name}.svg", plate.svg),
        ):
            with replacing(target / name) as file:
                file.write_bytes(content)
            written.append(name)
    return tuple(written)
