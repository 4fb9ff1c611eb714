# ruff: noqa: RUF001  (typographic minus, times and Greek are intended)
"""Sections on the evidence: Bayes factors, error models and sensitivity to the priors."""

import math
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from ridgebayes.checks.report_data import ReportData
from ridgebayes.comparison.bayes_factors import SUMMED
from ridgebayes.distributions.distribution import Distribution
from ridgebayes.model.default_priors import REASONS
from ridgebayes.report.blocks import Block, Folded, Odds, Picture, Table, Text
from ridgebayes.report.first_screen import prior_words
from ridgebayes.report.wording import (
    ABSENT,
    COMPONENTS,
    decimals,
    form_name,
    noise_name,
    parameter_name,
    probability,
    say,
    with_error,
)


def evidence_section(data: ReportData) -> list[Block]:
    """Return log evidences and Bayes factors."""
    blocks: list[Block] = [Text(say("evidence")), ranking_table(data)]
    if len(data.comparison.probabilities) > 1:
        factors = data.comparison.bayes_factors
        summed = factors[factors["noise"] == SUMMED]
        pairs = [_pairs(summed, say("summed_pairs_caption"))] if len(summed) else []
        blocks += [
            Folded("Your own prior probabilities", [_odds(data)]),
            Picture("evidence", say("evidence_caption", is_summed=len(summed)), _alt(data)),
            Folded("Bayes factors of all pairs", [*pairs, pairs_table(data)]),
        ]
    return blocks


def _odds(data: ReportData) -> Odds:
    """Return fields for the prior probability of each form, the most probable form first."""
    values = data.comparison.to_dataframe().set_index("form")["log_evidence"].dropna().to_dict()
    prior = data.comparison.prior_probabilities
    names = [name for name in data.ranked if name in values]
    return Odds([(form_name(name), values[name], prior[name]) for name in names])


def _alt(data: ReportData) -> str:
    """Return the alternative text of the evidence figure."""
    first = data.factors.drop_duplicates("form").sort_values("ln_bf", ascending=False)
    return say("evidence_alt", shown=data.shown, first=first.to_dict("records"))


def ranking_table(data: ReportData) -> Table:
    """Return a table of evidence, Bayes factor against the best and probability of each form."""
    comparison, best = data.comparison, data.best
    summed = data.factors[data.factors["method"] == SUMMED] if len(data.factors) else data.factors
    over_best = {row["form"]: (row["ln_bf"], row["ln_bf_se"]) for row in summed.to_dict("records")}
    used = {row["form"]: row for row in comparison.own_evidence.query("used").to_dict("records")}

    def factor(name: str) -> str:
        if name not in used or best is None:
            return ABSENT
        if name == best:
            return "0 (best)"
        value, se = over_best.get(name) or _difference(used[name], used[best])
        return with_error(value, se, 1)

    def state(name: str) -> str:
        if name in comparison.failures:
            return "FAILED"
        lacks = "NO" if name in comparison.unconverged else "no: negligible"
        return "yes" if comparison.fits[name].converged else lacks

    fits, names = comparison.fits, [*data.ranked, *comparison.failures]
    has_negligible = "no: negligible" in map(state, names)
    return Table.of(
        names,
        {
            "Form": form_name,
            "Parameters": lambda name: str(len(fits[name].summary)) if name in fits else ABSENT,
            "ln evidence": lambda name: _evidence(used.get(name), 1),
            "ln BF against the best": factor,
            "Probability": lambda name: probability(comparison.probabilities.get(name)),
            "Converged": state,
        },
        say("ranking_caption", prior=prior_words(comparison), has_negligible=has_negligible),
        text=(0, 5),
        strong=(0,) if best else (),
    )


def pairs_table(data: ReportData) -> Table:
    """Return all Bayes factors under the error model of the fits."""
    caption = say("pairs_caption", noise=data.comparison.noise.name)
    return _pairs(data.comparison.own_bayes_factors, caption)


def _pairs(factors: pd.DataFrame, caption: str) -> Table:
    """Return a table of Bayes factors with the favoured form first."""

    def pair(row: dict[str, Any]) -> str:
        names = [form_name(row[key]) for key in ("form_a", "form_b")]
        return " over ".join(reversed(names) if row["ln_bf"] < 0 else names)

    return Table.of(
        factors,
        {
            "Pair": pair,
            "ln BF": lambda row: with_error(abs(row["ln_bf"]), row["ln_bf_se"], 1),
            "log₁₀ BF": lambda row: decimals(abs(row["log10_bf"]), 1),
            "Method": lambda row: row["method"],
            "Reading": lambda row: re.sub(r" for .* \(Kass & Raftery\)", "", row["reading"]),
        },
        caption,
        text=(0, 3, 4),
    )


def agreement_section(data: ReportData) -> list[Block]:
    """Return the evidence by every method, and their distance in joint standard errors."""
    evidence = data.comparison.own_evidence
    walked = "bridge" in set(evidence["method"])
    by_form = {
        name: {row["method"]: row for row in part.to_dict("records")}
        for name, part in evidence.groupby("form")
    }
    columns: dict[str, Callable[[str], str]] = {
        "Form": form_name,
        "importance": lambda name: _evidence(by_form.get(name, {}).get("importance")),
    }
    if walked:
        columns |= {
            "bridge": lambda name: _evidence(by_form.get(name, {}).get("bridge")),
            "bridge − importance, in joint standard errors": lambda name: _distance(by_form[name]),
        }
    return [Table.of(data.ranked, columns, say("methods", are_walked=walked))]


def _evidence(row: Mapping[Any, Any] | None, most: int = 4) -> str:
    if row is None:
        return ABSENT
    if not math.isfinite(row["log_evidence"]):
        return str(row["status"])
    return with_error(row["log_evidence"], row["log_evidence_se"], most)


def _distance(rows: Mapping[str, Mapping[Any, Any]]) -> str:
    if not {"bridge", "importance"} <= set(rows):
        return ABSENT
    apart, error = _difference(rows["bridge"], rows["importance"])
    return decimals(apart / error if error else math.nan, 1)


def _difference(row: Mapping[Any, Any], other: Mapping[Any, Any]) -> tuple[float, float]:
    """Return the difference of two ln evidences and its error, from the errors that are known."""
    errors = np.nan_to_num([row["log_evidence_se"], other["log_evidence_se"]])
    return row["log_evidence"] - other["log_evidence"], math.hypot(*errors)


def error_models_section(data: ReportData) -> list[Block]:
    """Return evidences by form and error model; nothing if there is only one error model."""
    comparison = data.comparison
    if len(data.error_models) < 2:
        return []
    usable = comparison.evidence.query("used").to_dict("records")
    by_pair = {(row["form"], row["noise"]): row for row in usable}

    def cell(form: str) -> Callable[[dict[str, Any]], str]:
        return lambda mean: _evidence(by_pair.get((form, mean["noise"])), 1)

    evidences = Table.of(
        data.error_models,
        {
            "Error model": lambda mean: mean["noise"],
            **{form_name(form): cell(form) for form in [*data.ranked, *comparison.failures]},
            "ln of the mean": lambda mean: decimals(mean["log_mean_evidence"], 1),
            "Probability": lambda mean: probability(mean["probability"]),
        },
        say("error_models_caption"),
        strong=(0,),
    )
    return [
        Text(say("error_models", noise=noise_name(comparison.noise.name))),
        *_smooth(data),
        *_components(data),
        Folded("Evidence of each error model", [evidences, Text(say("offsets"), "note")]),
    ]


def _components(data: ReportData) -> list[Block]:
    """Return which components of the error model the rows support, if they were compared."""
    components = data.comparison.components
    table = Table.of(
        components,
        {
            "Component": lambda row: COMPONENTS[row["component"]],
            "ln BF": lambda row: with_error(row["ln_bf"], row["ln_bf_se"], 1),
            "Probability": lambda row: probability(row["probability"]),
            "Reading": lambda row: row["reading"],
        },
        say("components_caption"),
        text=(0, 3),
    )
    return [table] if len(components) else []


def _smooth(data: ReportData) -> list[Block]:
    """Explain the Bayes factors if a smooth offset is likely, and whether it predicts better."""
    weights = {} if (verdict := data.comparison.verdict) is None else verdict.error_model_weights
    if sum(weight for name, weight in weights.items() if "smooth" in name) < 0.5:
        return []
    if data.predicting is None:
        return [Text(say("smooth"))]
    return [Text(say("predicts_more", by=data.predicting, shown=form_name(data.shown)))]


def prior_section(data: ReportData) -> list[Block]:
    """Return the Bayes factors at several scales of each prior."""
    factors, against = data.sensitivity, form_name(data.shown)
    if not len(factors):
        return _unscaled(data)
    usable = factors.dropna()
    parts = [
        part.sort_values("factor")
        for _, part in usable.groupby(["form", "prior"], sort=False)
        if np.ptp(part["ln_bf"]) > 0  # a constant factor means that neither form has this prior
    ]
    columns: dict[str, Callable[[pd.DataFrame], str]] = {
        f"Form, against {against}": lambda part: form_name(part["form"].iloc[0]),
        "Prior of": lambda part: (
            "c and c₁" if (name := part["prior"].iloc[0]) == "c" else parameter_name(name)
        ),
        "Scale, times default": lambda part: "{:g} to {:g}".format(*part["factor"].iloc[[0, -1]]),
        "ln BF at the lowest scale": lambda part: decimals(part["ln_bf"].iloc[0], 1),
        "at the default": lambda part: decimals(
            part["ln_bf"].iloc[(part["factor"] - 1).abs().argmin()], 1
        ),
        "at the highest": lambda part: decimals(part["ln_bf"].iloc[-1], 1),
    }
    scales = {"low": factors["factor"].min(), "high": factors["factor"].max()}
    ahead = usable.loc[usable["ln_bf"] > 0, "form"].unique().tolist()
    alt = say("ahead_somewhere", forms=[*map(form_name, ahead)], against=against)
    picture = Picture("prior-sensitivity", say("prior_scales_caption", against=against), alt)
    return [
        Text(f"{say('prior_scales', **scales)} {alt}"),
        *_unscaled(data),
        Folded("Bayes factors at each scale", [picture, Table.of(parts, columns, text=(0, 1))]),
    ]


def _unscaled(data: ReportData) -> list[Block]:
    """Name the priors without a scale that could be varied."""
    fixed = {
        f"{parameter_name(name.partition('[')[0])} ({form_name(form)})"
        for form, name, prior, _ in _priors(data)
        if not prior.scale_name
    }
    return [Text(say("unscaled", priors=", ".join(sorted(fixed))))] if fixed else []


def _priors(data: ReportData) -> Iterator[tuple[str, str, Distribution, bool]]:
    """Yield form, parameter, prior, and whether the parameter is one of several K."""
    for form, fit in data.comparison.fits.items():
        for posterior in fit.posteriors.values():
            priors = posterior.model.priors
            several = Counter(name.partition("[")[0] for name in priors)
            for name, prior in priors.items():
                yield form, name, prior, several[name.partition("[")[0]] > 1


def _least_and_most(priors: Sequence[Distribution]) -> str:
    """Return the priors with the smallest and the largest median, in words; one if they agree."""
    ordered = sorted(priors, key=lambda prior: float(prior.value_at(0.0)))
    return ", to ".join(dict.fromkeys([ordered[0].words, ordered[-1].words]))


def prior_table(data: ReportData) -> Table:
    """Return the prior of every parameter and its reason; all K share a row."""
    forms: dict[tuple[str, str], dict[str, None]] = {}  # by parameter and prior, in order
    shown: dict[tuple[str, str], tuple[str, list[Distribution]]] = {}
    for form, name, prior, is_several in _priors(data):
        # Forms may differ in their prior of a parameter.
        key = name.partition("[")[0], "" if is_several else prior.words
        label = parameter_name(name) + is_several * " and of the others"
        shown.setdefault(key, (label, []))[1].append(prior)
        forms.setdefault(key, {})[form] = None
    kinds = Counter(kind for kind, _ in shown)

    def parameter(key: tuple[str, str]) -> str:
        owners = f" ({', '.join(map(form_name, forms[key]))})" if kinds[key[0]] > 1 else ""
        return shown[key][0] + owners

    return Table.of(
        shown,
        {
            "Parameter": parameter,
            "Prior": lambda key: _least_and_most(shown[key][1]),
            "Why": lambda key: REASONS.get(key[0], ABSENT),
        },
        say("prior_table_caption"),
        text=(0, 1, 2),
    )
