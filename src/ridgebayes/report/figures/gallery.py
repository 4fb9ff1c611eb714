"""Gallery of the figures of a report under stable names."""

import os
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from ridgebayes import drawing
from ridgebayes._types import FloatArray
from ridgebayes.checks.predictive_checks import QUANTITIES, PredictiveChecks
from ridgebayes.checks.report_data import ReportData
from ridgebayes.comparison.bands import AVERAGE
from ridgebayes.drawing import KINDS
from ridgebayes.errors import InputError
from ridgebayes.model.observations import Observations
from ridgebayes.results import Fit
from ridgebayes.runtime.atomic import cannot_write, write_bytes
from ridgebayes.runtime.pool import submit_or_defer
from ridgebayes.runtime.progress import tell_count

if TYPE_CHECKING:  # slow to import
    from matplotlib.figure import Figure

_QUICK_FIGURES = ("evidence", "bands-first", "bands", "held-out")
MOST_PARAMETERS = 6  # a corner plot of more parameters is unreadable


class Gallery(Mapping[str, "Figure"]):
    """Mapping of names to the figures of a report, each drawn once, by workers or on first use.

    Parameters
    ----------
    data : ReportData
        Data to draw.
    executor : concurrent.futures.Executor, optional
        Pool of workers on this machine, with the same libraries and fonts. Drawing starts at once.
    """

    def __init__(self, data: ReportData, executor: Executor | None = None) -> None:
        self.data = data
        self._recipes = figures_of(data)
        self._figures: dict[str, Figure] = {}
        self._files: dict[tuple[str, str], bytes] = {}
        self._pending: dict[str, Callable[[], list[bytes]]] = {}
        if executor is not None:
            for name, recipe in self._recipes.items():
                self._pending[name] = submit_or_defer(executor, _files, recipe)

    def __getitem__(self, name: str) -> "Figure":
        if name not in self._figures:
            self._figures[name] = self._recipes[name]()
        return self._figures[name]

    def __contains__(self, name: object) -> bool:
        return name in self._recipes  # the method of `Mapping` would draw the figure

    def __iter__(self) -> Iterator[str]:
        return iter(self._recipes)

    def __len__(self) -> int:
        return len(self._recipes)

    def file(self, name: str, kind: str) -> bytes:
        """Return a figure as ``png`` or ``svg``."""
        if name in self._pending:
            drawn = self._pending.pop(name)()
            self._files |= {(name, kind): file for kind, file in zip(KINDS, drawn, strict=True)}
        if (name, kind) not in self._files:
            self._files[name, kind] = drawing.style.as_bytes(self[name], kind)
        return self._files[name, kind]

    def save(self, folder: str | os.PathLike[str]) -> tuple[str, ...]:
        """Write every figure as PNG (180 dpi) and SVG, each file atomically.

        Parameters
        ----------
        folder : str or path
            Created if it does not exist.

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
        try:
            target.mkdir(parents=True, exist_ok=True)
        except (FileExistsError, NotADirectoryError) as error:
            raise InputError(f"{target}: cannot write figures ({error.strerror})") from None
        except OSError as error:
            raise cannot_write(target, error) from None
        for n_done, name in enumerate(self, start=1):
            for kind in KINDS:
                write_bytes(self.file(name, kind), target / f"{name}.{kind}")
            tell_count(n_done, len(self))
        return tuple(f"{name}.{kind}" for name in self for kind in KINDS)


def _files(recipe: Callable[[], "Figure"]) -> list[bytes]:
    figure = recipe()
    return [drawing.style.as_bytes(figure, kind) for kind in KINDS]


def figures_of(data: ReportData) -> dict[str, Callable[[], "Figure"]]:
    """Return a function that draws each figure that applies.

    Parameters
    ----------
    data : ReportData
        Data to draw.

    Returns
    -------
    dict of str to callable
        Functions by name, in this order: ``evidence`` and ``prior-sensitivity`` with two or more
        forms; ``bands``, and with many textures ``bands-first`` with the first three; ``held-out``
        if rows are held out; ``percent-error``, ``slopes``; ``coverage`` if it was computed;
        ``posterior-checks`` and ``prior-bands`` of the best form; ``corner-<form>`` of each fit.
        Quick comparisons have only ``evidence``, ``bands-first`` (or ``bands``) and ``held-out``.
    """
    comparison, shown = data.comparison, data.shown
    held_out, errors = data.held_out, data.percent_errors
    if len(held_out):
        # Without K for a texture the power law predicts from the prior: a bar across the page.
        alone = len(comparison.fits) == 1 and held_out["form"] == AVERAGE
        held_out = held_out[~(held_out["prior_alone"] | alone)]
    # Published coefficients belong to the embedded sweep only.
    if not data.is_paper_sweep and len(errors):
        errors = errors[errors["coefficients"] == "calibrated"]
    # Classic is left out, because its intercept differs.
    slopes = data.slopes[data.slopes["form"] != "classic"] if len(data.slopes) else data.slopes
    forms, predictions = drawing.forms, drawing.predictions
    recipes: dict[str, Any] = {
        "evidence": len(data.factors)
        and partial(forms.plot_bayes_factors, data.factors, shown, comparison.noise.name),
        "prior-sensitivity": len(data.sensitivity)
        and partial(forms.plot_prior_sensitivity, data.sensitivity, shown),
        **_bands(data),
        "held-out": len(held_out) and partial(predictions.plot_held_out, held_out),
        "percent-error": len(errors) and partial(forms.plot_percent_errors, errors),
        "slopes": len(slopes) and partial(forms.plot_slopes, slopes),
        "coverage": len(comparison.coverage)
        and partial(drawing.coverage.plot_coverage, comparison.coverage),
        "posterior-checks": data.checks
        and partial(drawing.posterior.plot_posterior_checks, shown, quantities_of(data.checks)),
        "prior-bands": len(data.prior_bands)
        and partial(
            predictions.plot_prior_bands, data.prior_bands, exact_rows(data.fit.model.data), shown
        ),
    }
    for name in data.ranked:
        fit = comparison.fits[name]
        recipes[f"corner-{name}"] = partial(corner_of, fit, published=data.is_paper_sweep)
    selected = recipes if data.preset.extras else _QUICK_FIGURES
    return {name: recipe for name, recipe in recipes.items() if recipe and name in selected}


def _bands(data: ReportData) -> dict[str, Callable[[], "Figure"]]:
    """Return functions that draw Q against load, for the first textures and for all."""
    n_texture, n_first = len(data.comparison.table.ok.textures), len(data.textures)
    draw = partial(drawing.predictions.plot_bands, table=data.transitions, form=data.shown)
    recipes: dict[str, Callable[[], Figure]] = {}
    if n_texture > n_first > 0:
        textures = pd.MultiIndex.from_frame(data.bands[["a_over_R", "b_over_R"]])
        first = data.bands[textures.isin(list(data.textures))]
        recipes["bands-first"] = partial(draw, first, untitled=True)
    if data.preset.extras or not recipes:
        recipes["bands"] = partial(draw, data.bands, n_texture=n_texture)
    return recipes


def quantities_of(checks: PredictiveChecks) -> dict[str, tuple[FloatArray, FloatArray, float]]:
    """Return observed values, replicated values and p-value of each quantity, by title."""
    return {
        QUANTITIES[name]: (checks.observed[:, i], checks.replicated[:, i], p_value)
        for i, (name, p_value) in enumerate(checks.p_values.items())
    }


def exact_rows(rows: Observations) -> pd.DataFrame:
    """Return the rows that give the load exactly, as a data frame."""
    a, b = np.array(rows.textures)[rows.texture].T
    columns = {"a_over_R": a, "b_over_R": b, "Q": rows.Q, "p_over_E": np.exp(rows.log_load)}
    return pd.DataFrame(columns)[rows.is_exact]


def corner_of(fit: Fit, *, most: int = MOST_PARAMETERS, published: bool = False) -> "Figure":
    """Draw all marginals of a fit from its thinned draws, which a saved fit has too.

    Parameters
    ----------
    fit : Fit
        Fit with draws.
    most : int, optional
        Maximum number of parameters shown: the first, and those of the error model.
    published : bool, optional
        Whether to mark the study's coefficients, if the form has any.

    Returns
    -------
    matplotlib.figure.Figure
    """
    names, n = fit.model.parameter_names, fit.model.n_parameter
    marked = fit.form.published if published else None
    values = dict(zip(names, marked or (), strict=False))
    n_noise = n - fit.model.n_coefficient
    shown = list(range(n)) if n <= most else [*range(most - n_noise), *range(n - n_noise, n)]
    chosen = [names[i] for i in shown]
    draws = fit.draws[:, shown]
    return drawing.posterior.plot_corner(fit.form.name, chosen, draws, values, n_parameter=n)
