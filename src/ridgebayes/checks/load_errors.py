"""Forms compared with the table: held-out loads, load errors in per cent and slopes K."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from ridgebayes._types import BATCH_SIZE
from ridgebayes.comparison.bands import loads_table, predicted_rows
from ridgebayes.comparison.comparison import Comparison
from ridgebayes.contact.scaling import Texture
from ridgebayes.model.forms import PowerLaw
from ridgebayes.model.observations import nearest_load

_MAX_TEXTURES_SHOWN = 3  # one panel for each in a row


def held_out_loads(comparison: Comparison) -> pd.DataFrame:
    """Return the predicted load of each held-out transition, and whether its band has the observed.

    Parameters
    ----------
    comparison : Comparison
        Fits and their table.

    Returns
    -------
    pandas.DataFrame
        Table of `comparison.bands.loads_table` with the simulation bands of held-out rows. Column
        ``inside`` says whether the band contains the observed load, or a load of its bracket;
        ``p_over_E_observed_lower`` is the lower end of the bracket, ``p_over_E_nearest`` its load
        nearest to the median; ``prior_alone`` marks predictions of the power law for textures
        without K. The frame is empty if no transition is held out, or no form has a probability.
    """
    held_out = comparison.table.held_out
    # Without a usable evidence there are no weights for the average of the forms.
    if not comparison.probabilities or predicted_rows(held_out).empty:
        return pd.DataFrame()
    loads = loads_table(replace(comparison, table=held_out), kinds=("simulation",))
    rows, power_law = predicted_rows(held_out), comparison.fits.get("power-law")
    lower = np.resize(rows["p_over_E_lower"].to_numpy(), len(loads))
    nearest = nearest_load(loads["p_over_E_median"], loads["p_over_E_observed"], lower)
    with_k = list(power_law.model.data.textures) if power_law is not None else []
    has_k = pd.MultiIndex.from_frame(loads[["a_over_R", "b_over_R"]]).isin(with_k)
    loads["prior_alone"] = (loads["form"] == "power-law") & ~has_k
    loads = loads.assign(p_over_E_observed_lower=lower, p_over_E_nearest=nearest)
    loads["inside"] = loads.eval("p_over_E_lower <= p_over_E_nearest <= p_over_E_upper")
    return loads


def shown_textures(comparison: Comparison) -> tuple[Texture, ...]:
    """Return the textures whose load errors are shown.

    Parameters
    ----------
    comparison : Comparison
        Comparison with its table.

    Returns
    -------
    tuple of (float, float)
        All textures if there are at most three. Otherwise those of the smallest and the largest
        ratio b/a, and a held-out or intermediate texture.
    """
    ok = predicted_rows(comparison.table)
    present = list(dict.fromkeys(zip(ok["a_over_R"], ok["b_over_R"], strict=True)))
    if len(present) <= _MAX_TEXTURES_SHOWN:
        return tuple(present)
    ordered = sorted(present, key=lambda texture: texture[1] / texture[0])
    held_out = [t for t in comparison.table.held_out.textures if t in present]
    middle = ordered[len(ordered) // 2]
    return tuple(dict.fromkeys([ordered[0], ordered[-1], *held_out, middle]))[:_MAX_TEXTURES_SHOWN]


def percent_errors(
    comparison: Comparison, textures: Sequence[Texture] | None = None
) -> pd.DataFrame:
    """Return 100 (p_form/p_data - 1) of each form at each transition of the given textures.

    Parameters
    ----------
    comparison : Comparison
        Fits and their table.
    textures : sequence of (float, float), optional
        Textures; `shown_textures` if not given.

    Returns
    -------
    pandas.DataFrame
        Columns form, coefficients (``calibrated``: posterior means, or ``published`` in the study),
        a_over_R, b_over_R, Q, role, p_over_E, percent. A positive error means that the form
        overestimates the load. For a bracket, p_data is its load nearest to p_form. The power law
        has no row for a texture without K.
    """
    frame = predicted_rows(comparison.table)
    blocks = []
    for a, b in shown_textures(comparison) if textures is None else textures:
        rows = frame[(frame["a_over_R"] == a) & (frame["b_over_R"] == b)].sort_values("Q")
        q, nu, p, lower = rows[["Q", "nu", "p_over_E", "p_over_E_lower"]].to_numpy(float).T
        for name, fit in comparison.fits.items():
            if isinstance(fit.form, PowerLaw) and (a, b) not in fit.form.textures:
                continue
            means = fit.summary["mean"].to_numpy()[: fit.model.n_coefficient]
            # Results read from a file have 15 digits: rounding to 12 gives equal figures.
            sets = {"calibrated": np.array([float(f"{mean:.12g}") for mean in means])}
            if fit.form.published is not None:
                sets["published"] = np.array(fit.form.published)
            for coefficients, theta in sets.items():
                load = fit.form.load(q, a, b, theta, nu)
                error = 100 * (load / nearest_load(load, p, lower) - 1)
                blocks.append(rows.assign(form=name, coefficients=coefficients, percent=error))
    columns = ["form", "coefficients", "a_over_R", "b_over_R", "Q", "role", "p_over_E", "percent"]
    if not blocks:
        return pd.DataFrame(columns=columns)
    return pd.concat(blocks, ignore_index=True)[columns]


def slopes_table(comparison: Comparison) -> pd.DataFrame:
    """Return K = dQ'/ds of each calibrated texture under each closed form.

    Parameters
    ----------
    comparison : Comparison
        Fits.

    Returns
    -------
    pandas.DataFrame
        Columns form, a_over_R, b_over_R, pitch, K, K_lower, K_upper, prob. The half-plane form has
        no row because its slope varies. The frame is empty unless K was fitted to several textures.
    """
    rows, power_law = [], comparison.fits.get("power-law")
    has_trend = power_law is not None and len(power_law.model.data.textures) > 1
    for name, fit in comparison.fits.items() if has_trend else ():
        if name == "half-plane":
            continue
        theta, prob = fit.draws[:, : fit.model.n_coefficient], float(fit.summary["prob"].iloc[0])
        textures = np.array(fit.model.data.textures)
        step = max(BATCH_SIZE // len(theta), 1)
        for i in range(0, len(textures), step):
            a, b = textures[i : i + step].T
            slope = fit.form.slope(a, b, theta)
            lower, upper = np.quantile(slope, [0.5 - prob / 2, 0.5 + prob / 2], axis=0)
            values = (a, b, a + b, slope.mean(axis=0), lower, upper)
            rows += [(name, *row, prob) for row in zip(*values, strict=True)]
    columns = ["form", "a_over_R", "b_over_R", "pitch", "K", "K_lower", "K_upper", "prob"]
    return pd.DataFrame(rows, columns=columns)
