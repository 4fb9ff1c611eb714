"""All figures of a comparison, under stable names."""

import os
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from weakref import WeakKeyDictionary

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from ridgebayes.accuracies import QUICK
from ridgebayes.accuracy import has_slopes, percent_errors, slopes_table
from ridgebayes.atomic import replacing
from ridgebayes.bands import AVERAGE, bands_table
from ridgebayes.comparison import Comparison
from ridgebayes.errors import InputError
from ridgebayes.figures.bands import MOST_TEXTURES, bands_figure, held_out_figure
from ridgebayes.figures.coverage import plot_coverage
from ridgebayes.figures.evidence import forest_figure, sensitivity_figure
from ridgebayes.figures.forms import percent_error_figure, slope_figure, smooth_figure
from ridgebayes.figures.posterior import corner_figure, trace_figure
from ridgebayes.figures.predictive_checks import plot_posterior_checks, plot_prior_bands
from ridgebayes.figures.style import as_bytes, styled
from ridgebayes.fit import Fit
from ridgebayes.held_out import held_out_loads
from ridgebayes.predictive_checks import posterior_checks, prior_bands
from ridgebayes.ranking import best_form, factors_by_method, ranked, sensitivity_factors
from ridgebayes.smooth import smooth_cylinder


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


_N_LOAD = 300  # of one panel's band: steps as sharp as a pixel
_BEYOND = 1.6  # how far beyond a texture's own highest load its panel goes

# A run draws each figure for its folder and again for its reports: the second time is for free.
_drawn: "WeakKeyDictionary[Comparison, dict[str, Plate]]" = WeakKeyDictionary()


def gallery(comparison: Comparison) -> dict[str, Plate]:
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
        best form's corner. Kept as long as the comparison is.
    """
    if comparison not in _drawn:
        _drawn[comparison] = {plate.name: plate for plate in _plates(comparison)}
    return _drawn[comparison]


def _plates(comparison: Comparison) -> Iterator[Plate]:
    best, is_quick = best_form(comparison), comparison.accuracy == QUICK.name
    shown = best or next(iter(comparison.fits))
    with styled():
        if best is not None and len(comparison.fits) > 1:
            factors = factors_by_method(comparison, best)
            if len(factors):
                yield Plate("evidence", forest_figure(factors, best))
            factors = sensitivity_factors(comparison, best)
            if len(factors) and not is_quick:
                yield Plate("prior-sensitivity", sensitivity_figure(factors, best))
        yield from _predictions(comparison, shown)
        errors = percent_errors(comparison)
        if len(errors):
            yield Plate("percent-error", percent_error_figure(errors))
        if is_quick:
            yield Plate(f"corner-{shown}", corner_figure(comparison.fits[shown]))
            return
        if has_slopes(comparison):
            slopes = slopes_table(comparison)
            yield Plate("slopes", slope_figure(slopes[slopes["form"] != "classic"]))
        yield Plate("smooth-cylinder", smooth_figure(smooth_cylinder()))
        if len(comparison.coverage):
            yield Plate("coverage", plot_coverage(comparison.coverage))
        yield from _checks(comparison.fits[shown])
        for name in ranked(comparison):
            yield Plate(f"corner-{name}", corner_figure(comparison.fits[name]))
            yield Plate(f"traces-{name}", trace_figure(comparison.fits[name]))


def _checks(fit: Fit) -> Iterator[Plate]:
    data = fit.model.data
    if data.is_exact.any():
        yield Plate("posterior-checks", plot_posterior_checks(posterior_checks(fit, rng=fit.seed)))
    bands = prior_bands(fit.model, rng=fit.seed)
    if len(bands):
        yield Plate("prior-bands", plot_prior_bands(bands, data, fit.form.name))


def _predictions(comparison: Comparison, form: str) -> Iterator[Plate]:
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
    yield Plate("bands", bands_figure(bands, rows, form, n_texture=len(comparison.table.textures)))
    loads = held_out_loads(comparison)
    if len(loads):
        # A texture that the power law has no K for is a draw from its prior: a bar across the page.
        loads = loads[~loads["prior_alone"]]
        if len(comparison.fits) == 1:
            loads = loads[loads["form"] != AVERAGE]
    if len(loads):
        yield Plate("held-out", held_out_figure(loads))


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
        If the folder cannot be written to.
    """
    target = Path(folder)
    written = []
    try:
        target.mkdir(parents=True, exist_ok=True)
        for plate in gallery(comparison).values():
            for name, content in (
                (f"{plate.name}.png", plate.png),
                (f"{plate.name}.svg", plate.svg),
            ):
                with replacing(target / name) as partial:
                    partial.write_bytes(content)
                written.append(name)
    except OSError as error:
        raise InputError(f"{target}: cannot write figures ({error.strerror})") from None
    return tuple(written)
