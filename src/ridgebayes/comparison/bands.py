"""Tables of bands on Q and on loads, as in `bands.csv` and `loads.csv`."""

import itertools
import math
from collections.abc import Sequence
from concurrent.futures import Executor
from copy import copy
from functools import cache, partial

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from ridgebayes._types import FloatArray
from ridgebayes.comparison.comparison import Comparison
from ridgebayes.contact.scaling import Texture, reduced_load
from ridgebayes.errors import InputError
from ridgebayes.inference.posterior import Posterior
from ridgebayes.predict.load_distribution import LoadDistribution, mix_loads
from ridgebayes.predict.load_draws import MAX_DRAWS_TIMES_ROWS, NEGLIGIBLE_PROBABILITY
from ridgebayes.predict.of_scene import q_of_scene
from ridgebayes.predict.posterior_loads import N_SHARED
from ridgebayes.predict.predict import KINDS, Places, load_places, predict_load, predict_q, q_places
from ridgebayes.predict.q_distribution import QDistribution, mix_q, shares
from ridgebayes.runtime.pool import map_ordered
from ridgebayes.scene.scene import Scene
from ridgebayes.table.table import ContactTable

AVERAGE = "average"
MAX_BANDS_KEPT = 100_000  # bands kept per posterior, to limit memory; more are recomputed
N_LOAD, _MIN_N_LOAD = 200, 10  # loads per texture; fewer than 200 if there are too many bands
_N_DECIMAL = round(-math.log10(NEGLIGIBLE_PROBABILITY))  # decimals of probabilities


def default_loads(comparison: Comparison, n: int = N_LOAD) -> FloatArray:
    """Return log-spaced loads over the range of a comparison's table, shape (n,)."""
    p = comparison.table.ok.column("p_over_E")
    # Twelve digits keep bands.csv small. Both ends are exact, so that they are no extrapolation.
    inner = [float(f"{load:.12g}") for load in np.geomspace(p.min(), p.max(), n)[1:-1]]
    return np.array([p.min(), *inner, p.max()])


def bands_table(
    comparison: Comparison,
    *,
    textures: Sequence[Texture] | None = None,
    loads: FloatArray | None = None,
    nu: float | None = None,
    forms: Sequence[str] | None = None,
    prob: float = 0.9,
    kinds: Sequence[str] = KINDS,
    executor: Executor | None = None,
) -> pd.DataFrame:
    """Return bands on Q of each form and of the average, for each texture and load.

    Parameters
    ----------
    comparison : Comparison
        Fits and model probabilities.
    textures : sequence of (float, float), optional
        Textures (a/R, b/R); those of the table's ok rows if not given.
    loads : ndarray of float, shape (n_load,) or (n_texture, n_load), dimensionless, optional
        p/E, for each texture or for all textures. If not given, 200 loads log-spaced over the
        table's range; with more than 500 textures fewer loads, at least ten, so that there are
        about 100,000 bands.
    nu : float, optional
        Poisson's ratio; if not given, that of each texture in the table, or 0.5.
    forms : sequence of str, optional
        Names of fitted forms or ``average``; all forms and ``average`` if not given.
    prob : float, optional
        Probability inside the band.
    kinds : sequence of str, optional
        ``curve``, ``simulation`` or both, see `predict_q`.
    executor : concurrent.futures.Executor, optional
        Executor of the predictions, one task for each posterior; if not given, they are computed
        one after the other in this process.

    Returns
    -------
    pandas.DataFrame
        Columns form, noise, kind_of_band (curve, simulation), a_over_R, b_over_R, nu,
        p_over_E, q_mean, q_median, q_lower, q_upper, prob, extrapolation, extrapolation_of,
        p_q_ge_4, ... up to the first n whose probability is below 1e-6 in all rows.

    Raises
    ------
    InputError
        If a form was not fitted, or `prob` is not between 0 and 1.
    """
    if nu is not None:
        reduced_load(1.0, nu)  # checked here so that the error shows a number, not an array
    names = [*comparison.fits, AVERAGE] if forms is None else list(forms)
    _check(comparison, names, prob)
    chosen = comparison.table.ok.textures if textures is None else tuple(textures)
    a, b = np.array(chosen).T[:, :, None]
    of_table = _nu_of_textures(comparison) if nu is None else {}
    poisson = np.array([[of_table.get(texture, 0.5 if nu is None else nu)] for texture in chosen])
    if loads is None:
        n_load = int(np.clip(MAX_BANDS_KEPT // len(chosen), _MIN_N_LOAD, N_LOAD))
        loads = default_loads(comparison, n_load)
    p = np.atleast_2d(loads).astype(float)
    mixtures = _mixtures(comparison, names)
    where = q_places(a, b, p, poisson)
    share_of = _largest_shares(mixtures)
    tasks = {id(fit): (fit, share_of[id(fit)]) for parts in mixtures.values() for fit, _ in parts}
    kept: dict[int, dict[str, QDistribution]] = {}
    # Each posterior enters the mixture of its form and the average, and is computed once if kept.
    if where["a_over_R"].size <= MAX_BANDS_KEPT:
        predicted = partial(_predict, kinds=kinds, where=where)
        bands = map_ordered(predicted, [*tasks.values()], executor, name=lambda x: x[0].form.name)
        kept = dict(zip(tasks, bands, strict=True))
    blocks = []
    for kind, (name, parts) in itertools.product(kinds, mixtures.items()):
        ids = (id(fit) for fit, _ in parts)
        each_q = ((kept.get(i) or _predict(tasks[i], [kind], where))[kind] for i in ids)
        q = mix_q(each_q, [weight for _, weight in parts])
        blocks.append(_label(name, parts, q.to_dataframe(prob)))
    kept.clear()  # frees memory before the blocks are concatenated
    return _concatenate(blocks)


def scene_bands(
    comparison: Comparison,
    scene: Scene,
    form: str,
    *,
    load: ArrayLike | None = None,
    p_over_E: ArrayLike | None = None,
    prob: float = 0.9,
    kinds: Sequence[str] = KINDS,
) -> pd.DataFrame:
    """Return bands on Q of a scene, whose uncertain values are drawn with the posterior.

    Parameters
    ----------
    comparison : Comparison
        Fits and model probabilities.
    scene : Scene
        Scene with one or more textures.
    form : str
        Name of a fitted form, or ``average``.
    load, p_over_E : array_like of float, shape (n_load,), optional
        As in `Predictive.predict`.
    prob : float, optional
        Probability inside the band.
    kinds : sequence of str, optional
        ``curve``, ``simulation`` or both.

    Returns
    -------
    pandas.DataFrame
        Columns of `bands_table`, and load, load_unit and offset_pitches. Widths, Poisson's ratio,
        offset and p_over_E are medians.
    """
    _check(comparison, [form], prob)
    parts = _mixtures(comparison, [form])[form]
    each_q = (q_of_scene(parts, scene, load=load, p_over_E=p_over_E, kind=kind) for kind in kinds)
    return _concatenate([_label(form, parts, q.to_dataframe(prob)) for q in each_q])


def loads_table(
    comparison: Comparison, *, prob: float = 0.9, kinds: Sequence[str] = KINDS
) -> pd.DataFrame:
    """Return the predicted load of each transition in the table beside the observed one.

    Parameters
    ----------
    comparison : Comparison
        Fits and model probabilities.
    prob : float, optional
        Probability inside the band.
    kinds : sequence of str, optional
        ``curve``, ``simulation`` or both.

    Returns
    -------
    pandas.DataFrame
        Columns form, noise, kind_of_band, a_over_R, b_over_R, nu, Q, p_over_E_median,
        p_over_E_lower, p_over_E_upper, prob, extrapolation, extrapolation_of, p_over_E_observed.
        Each form and the average have one row for each ok transition of the table. Held-out rows
        are included; rows of a body off centre are not, as no form predicts them. Simulation bands
        include the known relative error `rel_se` of the row, as they predict the observed load.
    """
    frame = predicted_rows(comparison.table)
    blocks = []
    where = load_places(*(frame[name].to_numpy() for name in ("a_over_R", "b_over_R", "Q", "nu")))
    mixtures = _mixtures(comparison, [*comparison.fits, AVERAGE])
    share_of = _largest_shares(mixtures)
    share_of_draws = min(MAX_DRAWS_TIMES_ROWS / (N_SHARED * max(len(frame), 1)), 1.0)

    @cache
    def predicted(fit: Posterior, kind: str) -> LoadDistribution:
        share = share_of_draws * share_of[id(fit)]
        return predict_load(fit, where, kind, share)

    for kind in kinds:
        rel_se = frame["rel_se"].to_numpy() * (kind == "simulation")
        for name, parts in mixtures.items():
            weights = [weight for _, weight in parts]
            load = mix_loads([predicted(fit, kind).widened(rel_se) for fit, _ in parts], weights)
            blocks.append(_label(name, parts, load.to_dataframe(prob)))
            blocks[-1]["p_over_E_observed"] = frame["p_over_E"].to_numpy()
    return pd.concat(blocks, ignore_index=True)


def _check(comparison: Comparison, forms: Sequence[str], prob: float) -> None:
    """Raise InputError for forms that were not fitted and for an invalid probability."""
    if not 0 < prob < 1:
        raise InputError(f"prob: expected 0 < prob < 1, got {prob!r}")
    fitted = [*comparison.fits, AVERAGE]
    if unknown := [name for name in forms if name not in fitted]:
        rule = f"expected one of {', '.join(fitted)}"
        raise InputError(f"form {unknown[0]!r}: not in this run; {rule}")


def predicted_rows(table: ContactTable) -> pd.DataFrame:
    """Return the ok transitions of a table, except of bodies off centre, which no form predicts."""
    frame = table.ok.frame
    return frame[(frame["kind"] == "transition") & (frame["offset_over_R"] == 0)]


def _nu_of_textures(comparison: Comparison) -> dict[Texture, float]:
    """Return the first Poisson's ratio of each texture in the table."""
    table = comparison.table.ok
    rows = table.frame.drop_duplicates(["a_over_R", "b_over_R"])
    return dict(zip(table.textures, rows["nu"].tolist(), strict=True))


def _predict(
    task: tuple[Posterior, float], kinds: Sequence[str], where: Places
) -> dict[str, QDistribution]:
    """Predict with a copy of the posterior, so that its cached offsets are freed.

    The cached offsets of all fits would take gigabytes.
    """
    posterior, share = copy(task[0]), task[1]
    return {kind: predict_q(posterior, where, kind, share) for kind in kinds}


_Mixture = list[tuple[Posterior, float]]


def _mixtures(comparison: Comparison, names: Sequence[str]) -> dict[str, _Mixture]:
    """Return the weighted posteriors that predict each named form or the average."""
    mixtures: dict[str, _Mixture] = {}
    for name in names:
        if name != AVERAGE:
            mixtures[name] = comparison.fits[name].averaged
        elif comparison.probabilities:  # without evidences there is no average
            mixtures[AVERAGE] = comparison.averaged
    return mixtures


def _largest_shares(mixtures: dict[str, _Mixture]) -> dict[int, float]:
    """Return the largest weight of each posterior in any mixture, by the posterior's id."""
    largest: dict[int, float] = {}
    for parts in mixtures.values():
        for (fit, _), share in zip(parts, shares([w for _, w in parts]).tolist(), strict=True):
            largest[id(fit)] = max(largest.get(id(fit), 0.0), share)
    return largest


def _label(name: str, parts: _Mixture, rows: pd.DataFrame) -> pd.DataFrame:
    """Insert the columns of the form and the error model."""
    noises = {posterior.noise.name for posterior, _ in parts}
    rows.insert(0, "form", name)
    rows.insert(1, "noise", AVERAGE if len(noises) > 1 else noises.pop())
    return rows


def _concatenate(blocks: list[pd.DataFrame]) -> pd.DataFrame:
    """Concatenate bands; fill missing probabilities with 0 and drop negligible columns."""
    frame = pd.concat(blocks, ignore_index=True)
    tail = frame.filter(regex="^p_q_ge_").columns
    n_shown = int((frame[tail].max() >= NEGLIGIBLE_PROBABILITY).sum()) + 1
    frame, shown = frame.drop(columns=tail[n_shown:]), list(map(str, tail[:n_shown]))
    frame[shown] = frame[shown].fillna(0.0)
    return frame.round(dict.fromkeys(["q_mean", *shown], _N_DECIMAL))
