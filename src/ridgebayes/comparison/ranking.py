"""Results of a comparison arranged for the report: ranked forms, Bayes factors and problems."""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from ridgebayes.comparison.bayes_factors import SUMMED, summed_evidence
from ridgebayes.comparison.comparison import Comparison
from ridgebayes.model.noise import SMOOTH

_BASELINE = "classic"  # the smooth contact, which has pitch and groove but no single ridges


def best_form(comparison: Comparison) -> str | None:
    """Return the form with the highest probability, or None if no form has a usable evidence."""
    return comparison.best if comparison.probabilities else None


def forms_by_probability(comparison: Comparison) -> list[str]:
    """Return the fitted forms, the most probable first and forms without an evidence last."""
    shares = comparison.probabilities
    return sorted(comparison.fits, key=lambda name: -shares.get(name, -1.0))


def factors_by_method(comparison: Comparison, against: str) -> pd.DataFrame:
    """Return ln BF of every form over a given form, by each method that gives both evidences.

    Parameters
    ----------
    comparison : Comparison
        Comparison.
    against : str
        Form in the denominator of the Bayes factors.

    Returns
    -------
    pandas.DataFrame
        Columns form, method, ln_bf (= ln Z_form - ln Z_against), ln_bf_se (NaN if the method has
        none). If several error models were weighed, the first rows have the error models summed
        out. The methods' rows are under the selected error model.
    """
    columns = ["form", "method", "log_evidence", "log_evidence_se"]
    usable = comparison.own_evidence.query("status == 'ok'").drop_duplicates(["form", "method"])
    sums = summed_evidence(comparison.evidence) if len(comparison.components) else {}
    summed = [(form, SUMMED, *value_and_se) for form, value_and_se in sums.items()]
    frame = pd.DataFrame([*summed, *usable[columns].itertuples(index=False)], columns=columns)
    pairs = frame.merge(frame[frame["form"] == against], on="method", suffixes=("", "_of_other"))
    pairs = pairs[pairs["form"] != against].assign(
        ln_bf=lambda x: x["log_evidence"] - x["log_evidence_of_other"],
        ln_bf_se=lambda x: np.hypot(x["log_evidence_se"], x["log_evidence_se_of_other"]),
    )
    return pairs[["form", "method", "ln_bf", "ln_bf_se"]].reset_index(drop=True)


@dataclass(frozen=True)
class Predicting:
    """Gain from the best form and from the smooth offset in predicting left-out textures.

    Parameters
    ----------
    without_form : float
        Error (CRPS) of log loads of Classic, relative to the best form.
    without_offset : float
        Width of the 90 % band of loads with independent rows, relative to the smooth offset.
    """

    without_form: float
    without_offset: float


def predicting(comparison: Comparison) -> Predicting | None:
    """Return the gain from the best form and its smooth offset for left-out textures.

    The result is None if the selected error model has no smooth offset, Classic was not compared or
    is the best form, or no textures were left out.
    """
    scores, widths, best = comparison.left_out, comparison.coverage, best_form(comparison) or ""
    is_smooth = SMOOTH in comparison.noise.factors
    if not is_smooth or best in ("", _BASELINE) or not len(scores) or not len(widths):
        return None
    crps = scores[scores["leave"] == "texture"].set_index("form")["mean_crps"]
    width = widths[(widths["prob"] == 0.9) & (widths["form"] == best)].set_index("noise")
    if not {best, _BASELINE} <= set(crps.dropna().index) or len(width) < 2:
        return None
    wide = width["mean_width"]
    ratios = crps[_BASELINE] / crps[best], wide["iid"] / wide[comparison.noise.name]
    return Predicting(*map(float, ratios)) if np.isfinite(ratios).all() else None


def sensitivity_factors(comparison: Comparison, against: str) -> pd.DataFrame:
    """Return ln BF of every other form over a given form for each changed prior scale.

    Parameters
    ----------
    comparison : Comparison
        Comparison, whose prior_sensitivity table may be empty.
    against : str
        Form in the denominator of the Bayes factors.

    Returns
    -------
    pandas.DataFrame
        Columns prior, factor, form, ln_bf. Priors that change no evidence are left out.
    """
    columns = ["prior", "factor", "form", "ln_bf"]
    table = comparison.prior_sensitivity
    if not len(table) or against not in set(table["form"]):
        return pd.DataFrame(columns=columns)
    wide = table.pivot_table(
        index=["prior", "factor"], columns="form", values="log_evidence", sort=False
    )
    varies = wide.groupby(level="prior").transform(np.ptp).max(axis=1) > 0
    ratio = wide[varies].drop(columns=against).sub(wide.loc[varies, against], axis=0)
    ratio = ratio.melt(ignore_index=False, var_name="form", value_name="ln_bf")
    return ratio.reset_index()[columns]


def problems(comparison: Comparison) -> tuple[str, ...]:
    """Return the problems of a comparison, one sentence each; empty if it is complete."""
    sentences = [f"{name}: could not be fitted: {why}" for name, why in comparison.failures.items()]
    for name, failures in comparison.unconverged.items():
        sentences += [f"{name}: did not converge: {failure}" for failure in failures]
    unweighed = [name for name in comparison.fits if name not in comparison.probabilities]
    return (*sentences, *(f"{name}: no method gave a usable evidence" for name in unweighed))
