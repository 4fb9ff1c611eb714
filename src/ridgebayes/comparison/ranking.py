"""A comparison arranged for a reader: factors against the best form, and a verdict."""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from ridgebayes.comparison.bayes_factors import SUMMED, summed_evidence
from ridgebayes.comparison.comparison import Comparison
from ridgebayes.model.noise import SMOOTH

_PLAINEST = "classic"  # the smooth contact: it knows of pitch and groove, not of single ridges


def best_form(comparison: Comparison) -> str | None:
    """Return the form of highest probability, or None where no evidence could be used."""
    return comparison.best if comparison.probabilities else None


def forms_by_probability(comparison: Comparison) -> list[str]:
    """Return the fitted forms, most probable first, those without an evidence last."""
    shares = comparison.probabilities
    return sorted(comparison.fits, key=lambda name: -shares.get(name, -1.0))


def factors_by_method(comparison: Comparison, against: str) -> pd.DataFrame:
    """Return ln BF of every form over one of them, by every method that gives both evidences.

    Parameters
    ----------
    comparison : Comparison
        With its evidence table.
    against : str
        Form that all are compared with.

    Returns
    -------
    pandas.DataFrame
        Columns form, method, ln_bf (= ln Z_form - ln Z_against), ln_bf_se (NaN where the method
        has none). First with the error models summed out, where several were weighed; the methods
        are of the selected one.
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
    """Whether the form or the smooth offset predicts textures left out.

    Parameters
    ----------
    without_form : float
        Times that the error (CRPS) of log loads is larger with Classic in the best form's place.
    without_offset : float
        Times that the 90 % band of loads is wider with independent rows in the offset's place.
    """

    without_form: float
    without_offset: float


def predicting(comparison: Comparison) -> Predicting | None:
    """Return how well the best form and its smooth offset predict textures left out.

    None where the selected error model has no smooth offset, Classic was not compared or is the
    best form, or textures were not left out.
    """
    scores, widths, best = comparison.left_out, comparison.coverage, best_form(comparison) or ""
    if SMOOTH not in comparison.noise.factors or best in ("", _PLAINEST):
        return None
    if not len(scores) or not len(widths):
        return None
    crps = scores[scores["leave"] == "texture"].set_index("form")["mean_crps"]
    width = widths[(widths["prob"] == 0.9) & (widths["form"] == best)].set_index("noise")
    if not {best, _PLAINEST} <= set(crps.dropna().index) or len(width) < 2:
        return None
    wide = width["mean_width"]
    ratios = Predicting(
        float(crps[_PLAINEST] / crps[best]), float(wide["iid"] / wide[comparison.noise.name])
    )
    return ratios if np.isfinite([ratios.without_form, ratios.without_offset]).all() else None


def sensitivity_factors(comparison: Comparison, against: str) -> pd.DataFrame:
    """Return ln BF of every other form over one of them as each prior's scale is changed.

    Parameters
    ----------
    comparison : Comparison
        With its prior_sensitivity table, which may be empty.
    against : str
        Form that all are compared with.

    Returns
    -------
    pandas.DataFrame
        Columns prior, factor, form, ln_bf; priors that no fitted form has are left out.
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
    """Return what is wrong with a comparison, a sentence each; empty if it is complete."""
    sentences = [f"{name}: could not be fitted: {why}" for name, why in comparison.failures.items()]
    for name, failures in comparison.unconverged.items():
        sentences += [f"{name}: did not converge: {what}" for what in failures]
    for name in comparison.fits:
        if name not in comparison.probabilities:
            sentences.append(f"{name}: no method gave a usable evidence")
    return tuple(sentences)
