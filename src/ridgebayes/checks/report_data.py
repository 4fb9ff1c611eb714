"""Results shown in a report, computed before any figure or page is made."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
import pandas as pd

from ridgebayes.checks import load_errors
from ridgebayes.checks.least_squares import fit_by_least_squares
from ridgebayes.checks.power_scaling import power_scaling
from ridgebayes.checks.predictive_checks import PredictiveChecks, posterior_checks, prior_bands
from ridgebayes.checks.repeat import Repeat, against_priors, is_cheap, repeat_posterior
from ridgebayes.comparison import ranking
from ridgebayes.comparison.bands import N_LOAD, bands_table
from ridgebayes.comparison.comparison import Comparison
from ridgebayes.comparison.own_texture import OwnTexture, own_texture
from ridgebayes.comparison.ranking import Predicting, best_form
from ridgebayes.contact.scaling import Texture
from ridgebayes.drawing import MOST_TEXTURES
from ridgebayes.errors import ComputationError, InputError
from ridgebayes.evidence.tables import mean_evidence
from ridgebayes.inference.presets import Preset
from ridgebayes.results import Fit
from ridgebayes.table.datafiles import paper_sweep

_PANEL_END_OVER_MAX_LOAD = 1.6  # largest load of a panel over that of its texture


@dataclass(frozen=True)
class Consequence:
    """Effect of the choice of a form on predictions for fitted textures, up to their largest loads.

    Parameters
    ----------
    n_texture : int
        Number of textures compared.
    over : str
        Second form; empty if there is none.
    apart : int
        Largest difference between the median Q of the two forms.
    width : int
        Largest width of the band on Q of the shown form.
    """

    n_texture: int
    over: str
    apart: int
    width: int


@dataclass(frozen=True, eq=False)
class ReportData:
    """A comparison and the results that its report shows with it.

    Parameters
    ----------
    comparison : Comparison
        Comparison to report.
    preset : Preset
        Accuracy preset of the run.
    best : str or None
        Most probable form; None if no evidence is usable.
    shown : str
        Form whose bands and checks are shown: the best, or the first fitted.
    ranked : tuple of str
        Fitted forms, most probable first.
    problems : tuple of str
        Fits that failed or did not converge.
    factors, sensitivity : pandas.DataFrame
        ln Bayes factors of each form against the best, by method and by scale of a prior.
    predicting : Predicting or None
        Whether the form or the smooth offset predicts left-out textures better.
    error_models : pandas.DataFrame
        Mean evidence of each error model.
    transitions : pandas.DataFrame
        Transitions of the table with status ok.
    bands : pandas.DataFrame
        Bands on Q of the shown form, by texture.
    consequence : Consequence
        Effect of the choice of a form on these bands.
    held_out : pandas.DataFrame
        Held-out loads with their bands, see `held_out_loads`.
    textures : tuple of (float, float)
        Textures of the percent errors, a/R and b/R.
    percent_errors, slopes : pandas.DataFrame
        See `ridgebayes.checks.load_errors`; slopes are empty for a single texture.
    least_squares : dict of str to pandas.DataFrame
        Coefficients by least squares on Q, if the form allows them.
    checks : PredictiveChecks or None
        Posterior predictive checks of the shown form; None if no row gives its load exactly.
    prior_bands : pandas.DataFrame
        Prior predictive loads of the shown form; empty in a quick run.
    power_scaling : pandas.DataFrame
        Sensitivity of each parameter of the shown form to prior and likelihood.
    repeat : Repeat or None
        Repeat of the shown fit; None in a quick run or if it would take long.
    against_priors : pandas.DataFrame
        Positions of the shown fit's means in their priors.
    own_texture : OwnTexture
        Quantiles from which the page predicts new textures.
    is_paper_sweep : bool
        Whether the rows are the embedded sweep, to which published coefficients belong.
    """

    comparison: Comparison
    preset: Preset
    best: str | None
    shown: str
    ranked: tuple[str, ...]
    problems: tuple[str, ...]
    factors: pd.DataFrame
    sensitivity: pd.DataFrame
    predicting: Predicting | None
    error_models: pd.DataFrame
    transitions: pd.DataFrame
    bands: pd.DataFrame
    consequence: Consequence
    held_out: pd.DataFrame
    textures: tuple[Texture, ...]
    percent_errors: pd.DataFrame
    slopes: pd.DataFrame
    least_squares: dict[str, pd.DataFrame]
    checks: PredictiveChecks | None
    prior_bands: pd.DataFrame
    power_scaling: pd.DataFrame
    repeat: Repeat | None
    against_priors: pd.DataFrame
    own_texture: OwnTexture
    is_paper_sweep: bool

    @property
    def fit(self) -> Fit:
        """Fit of the shown form."""
        return self.comparison.fits[self.shown]


def report_data(comparison: Comparison) -> ReportData:
    """Compute the results shown in the report of a comparison.

    Parameters
    ----------
    comparison : Comparison
        Comparison as computed, or read from a run folder, which gives the same numbers.

    Returns
    -------
    ReportData
        The comparison with these results.

    Notes
    -----
    *Cost.* About two CPU seconds for the paper's sweep.

    Examples
    --------
    >>> import ridgebayes as rb
    >>> forms = ["modified", "hybrid"]
    >>> data = report_data(rb.compare(rb.paper_sweep(), forms, noise="iid", accuracy="quick"))
    >>> data.ranked, data.is_paper_sweep, len(data.held_out)
    (('hybrid', 'modified'), True, 9)
    """
    best, preset = best_form(comparison), Preset.named(comparison.accuracy)
    shown = best or next(iter(comparison.fits))
    fit = comparison.fits[shown]
    seen, none = comparison.table.ok.frame, pd.DataFrame()
    textures = load_errors.shown_textures(comparison)
    verdict = comparison.verdict
    # With prior odds the shown form may have the second highest evidence.
    compared = () if verdict is None else (verdict.over, verdict.form)
    over = next((name for name in compared if name != shown), "")
    bands = _panel_bands(comparison, [shown, *([over] if over else [])], seen, textures)
    own_bands = bands[bands["form"] == shown]
    return ReportData(
        comparison,
        preset,
        best,
        shown,
        tuple(ranking.forms_by_probability(comparison)),
        ranking.problems(comparison),
        none if best is None else ranking.factors_by_method(comparison, best),
        none if best is None else ranking.sensitivity_factors(comparison, best),
        ranking.predicting(comparison),
        mean_evidence(comparison.evidence),
        seen[seen["kind"] == "transition"],
        own_bands.reset_index(drop=True),
        consequence_of(bands, shown, over, seen[seen["role"] == "calibration"]),
        load_errors.held_out_loads(comparison),
        textures,
        load_errors.percent_errors(comparison, textures),
        load_errors.slopes_table(comparison),
        _least_squares(comparison),
        posterior_checks(fit, rng=fit.seed) if fit.model.data.is_exact.any() else None,
        prior_bands(fit.model, rng=fit.seed) if preset.extras else none,
        power_scaling(fit),
        repeat_posterior(fit) if preset.extras and is_cheap(fit) else None,
        against_priors(fit),
        own_texture(comparison),
        comparison.table.digest() == paper_sweep().digest(),
    )


def consequence_of(bands: pd.DataFrame, shown: str, over: str, seen: pd.DataFrame) -> Consequence:
    """Compare the simulation bands of two forms at loads up to each texture's largest.

    Parameters
    ----------
    bands : pandas.DataFrame
        Columns of bands.csv, with both forms at the same textures and loads.
    shown, over : str
        Names of the forms; `over` may be empty.
    seen : pandas.DataFrame
        Fitted rows.

    Returns
    -------
    Consequence
        Comparison over the textures of `seen`.
    """
    key = ["a_over_R", "b_over_R"]
    largest = seen.groupby(key)["p_over_E"].max().rename("largest").reset_index()
    bands = bands[bands["kind_of_band"] == "simulation"].merge(largest, on=key)
    bands = bands[bands["p_over_E"] <= bands["largest"]]
    band, other = (bands[bands["form"] == form].reset_index(drop=True) for form in (shown, over))
    apart = (band["q_median"] - other["q_median"]).abs().max() if over else 0
    n_texture = len(band[key].drop_duplicates())
    return Consequence(n_texture, over, int(apart), int((band["q_upper"] - band["q_lower"]).max()))


def _panel_bands(
    comparison: Comparison, forms: list[str], seen: pd.DataFrame, first: Sequence[Texture]
) -> pd.DataFrame:
    """Return the bands of some forms at loads that span the panel of each texture."""
    # A figure holds at most `MOST_TEXTURES` panels; bands.csv in the run folder has all textures.
    every = comparison.table.ok.textures
    kept = list(dict.fromkeys([*first, *every]))[:MOST_TEXTURES]
    textures, loads = [texture for texture in every if texture in kept], []
    largest = seen.groupby(["a_over_R", "b_over_R"])["p_over_E"].max()
    for texture in textures:
        top = largest.get(texture, seen["p_over_E"].max())
        loads.append((np.linspace(0.0, np.sqrt(_PANEL_END_OVER_MAX_LOAD * top), N_LOAD) ** 2)[1:])
    return bands_table(comparison, textures=textures, forms=forms, loads=np.array(loads))


def _least_squares(comparison: Comparison) -> dict[str, pd.DataFrame]:
    squares = {}
    for name, fit in comparison.fits.items():
        # The form may have a coefficient per texture, too few rows, or rows that it cannot fit.
        with suppress(InputError, ComputationError):
            squares[name] = fit_by_least_squares(fit.form, comparison.table)
    return squares
