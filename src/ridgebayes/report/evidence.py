# ruff: noqa: RUF001  (typographic minus, times and Greek are meant: readers see them)
"""Sections on the evidence: Bayes factors, error models, and what they owe to the priors."""

import math
from collections import Counter
from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from ridgebayes.checks.report_data import ReportData
from ridgebayes.comparison.bayes_factors import SUMMED
from ridgebayes.model.default_priors import REASONS
from ridgebayes.report.blocks import Block, Folded, Odds, Picture, Table, Text
from ridgebayes.report.first_screen import prior_words
from ridgebayes.report.wording import (
    ABSENT,
    component_name,
    decimals,
    form_name,
    noise_name,
    parameter_name,
    probability,
    reading_text,
    say,
    with_error,
)


def evidence_section(data: ReportData) -> list[Block]:
    """Return log evidences, Bayes factors and how well the methods agree."""
    words = say("evidence")
    blocks: list[Block] = [Text(words), ranking_table(data)]
    if len(data.comparison.probabilities) > 1:
        blocks.append(Folded("Your own prior probabilities", [_odds(data)]))
        factors = data.comparison.bayes_factors
        summed = factors[factors["noise"] == SUMMED]
        caption = "ln Bayes factor of each form against the best, by every method."
        pairs = [pairs_table(data)]
        if len(summed):
            caption = say("evidence_caption")
            words = "Bayes factors with the error models summed out."
            pairs.insert(0, _pairs(summed, words))
        blocks += [
            Picture("evidence", caption, _evidence_alt(data)),
            Folded("Bayes factors of all pairs", pairs),
        ]
    return blocks


def _odds(data: ReportData) -> Odds:
    """Return fields for the prior probability of each form, the most probable first."""
    values = data.comparison.to_dataframe().set_index("form")["log_evidence"].dropna().to_dict()
    prior = data.comparison.prior_probabilities
    names = [name for name in data.ranked if name in values]
    return Odds([(form_name(name), values[name], prior[name]) for name in names])


def _evidence_alt(data: ReportData) -> str:
    """Say what the evidence figure shows."""
    first = data.factors.drop_duplicates("form").sort_values("ln_bf", ascending=False)
    against = ", ".join(
        f"{form_name(row['form'])} {decimals(row['ln_bf'], 1)}" for row in first.to_dict("records")
    )
    return f"ln Bayes factors against {form_name(data.shown)}: {against}."


def ranking_table(data: ReportData) -> Table:
    """Return one row per form: evidence, factor against the best, probability."""
    comparison, best = data.comparison, data.best
    summed = data.factors[data.factors["method"] == SUMMED] if len(data.factors) else data.factors
    over_best = {row["form"]: (row["ln_bf"], row["ln_bf_se"]) for row in summed.to_dict("records")}
    used = {row["form"]: row for row in comparison.own_evidence.query("used").to_dict("records")}
    rows = []
    for name in data.ranked:
        fit, cells = comparison.fits[name], [ABSENT, ABSENT, ABSENT]
        if name in used and best is not None:
            own, top = used[name], used[best]
            error = _hypot(own["log_evidence_se"], top["log_evidence_se"])
            factor, error = over_best.get(name, (own["log_evidence"] - top["log_evidence"], error))
            cells = [
                with_error(own["log_evidence"], own["log_evidence_se"], 1),
                "0 (best)" if name == best else with_error(factor, error, 1),
                probability(comparison.probabilities[name]),
            ]
        lacks = "NO" if name in comparison.unconverged else "no: negligible"
        state = "yes" if fit.converged else lacks
        rows.append([form_name(name), str(len(fit.summary)), *cells, state])
    rows += [[form_name(f), ABSENT, ABSENT, ABSENT, ABSENT, "FAILED"] for f in comparison.failures]
    return Table(
        ["Form", "Parameters", "ln evidence", "ln BF against the best", "Probability", "Converged"],
        rows,
        say(
            "ranking_caption",
            prior=prior_words(comparison),
            has_negligible=any(row[-1] == "no: negligible" for row in rows),
        ),
        text=(0, 5),
        strong=(0,) if best is not None else (),
    )


def pairs_table(data: ReportData) -> Table:
    """Return every Bayes factor under the fits' error model."""
    return _pairs(
        data.comparison.own_bayes_factors,
        say("pairs_caption", noise=data.comparison.noise.name),
    )


def _pairs(factors: pd.DataFrame, caption: str) -> Table:
    """Return Bayes factors, the favoured form first."""
    rows = []
    for row in factors.to_dict("records"):
        ahead, behind = row["form_a"], row["form_b"]
        if row["ln_bf"] < 0:
            ahead, behind = behind, ahead
        rows.append(
            [
                f"{form_name(ahead)} over {form_name(behind)}",
                with_error(abs(row["ln_bf"]), row["ln_bf_se"], 1),
                decimals(abs(row["log10_bf"]), 1),
                row["method"],
                reading_text(row["reading"]).partition(" (")[0],
            ]
        )
    return Table(["Pair", "ln BF", "log₁₀ BF", "Method", "Reading"], rows, caption, text=(0, 3, 4))


def agreement_table(data: ReportData) -> Table:
    """Return the evidence by every method, and what lies between them in joint standard errors."""
    evidence = data.comparison.own_evidence
    walked = "bridge" in set(evidence["method"])
    rows = []
    for name in data.ranked:
        part = evidence[evidence["form"] == name].to_dict("records")
        own = {row["method"]: row for row in part}
        cells = [_evidence(own.get("importance"))]
        if walked:
            cells += [_evidence(own.get("bridge")), _distance(own)]
        rows.append([form_name(name), *cells])
    header = ["Form", "importance"]
    if walked:
        header += ["bridge", "bridge − importance, in joint standard errors"]
    return Table(header, rows, say("methods", are_walked=walked))


def _evidence(row: Mapping[Any, Any] | None, most: int = 4) -> str:
    if row is None:
        return ABSENT
    if not math.isfinite(row["log_evidence"]):
        return str(row["status"])
    return with_error(row["log_evidence"], row["log_evidence_se"], most)


def _distance(own: Mapping[str, Mapping[Any, Any]]) -> str:
    if not {"bridge", "importance"} <= set(own):
        return ABSENT
    a, b = own["bridge"], own["importance"]
    error = _hypot(a["log_evidence_se"], b["log_evidence_se"])
    apart = (a["log_evidence"] - b["log_evidence"]) / error if error else math.nan
    return decimals(apart, 1) if math.isfinite(apart) else ABSENT


def _hypot(*errors: float) -> float:
    return math.hypot(*(e for e in errors if e == e))


def error_models_section(data: ReportData) -> list[Block]:
    """Return evidences by form and error model; nothing where one error model alone was weighed."""
    comparison, means = data.comparison, data.error_models
    if len(means) < 2:
        return []
    forms = [*data.ranked, *comparison.failures]
    usable = {
        (row["form"], row["noise"]): row
        for row in comparison.evidence.query("used").to_dict("records")
    }
    rows = [
        [
            mean["noise"],
            *(_evidence(usable.get((form, mean["noise"])), 1) for form in forms),
            decimals(mean["log_mean_evidence"], 1),
            probability(mean["probability"]),
        ]
        for mean in means.to_dict("records")
    ]
    return [
        Text(say("error_models", noise=noise_name(comparison.noise.name))),
        *_smooth(data),
        *_components(data),
        Folded(
            "Evidence of each error model",
            [
                Table(
                    ["Error model", *map(form_name, forms), "ln of the mean", "Probability"],
                    rows,
                    say("error_models_caption"),
                    strong=(0,),
                ),
                Text(
                    say("offsets"),
                    "note",
                ),
            ],
        ),
    ]


def _components(data: ReportData) -> list[Block]:
    """Return which components of the error model the rows support, where that can be asked."""
    found = data.comparison.components
    if not len(found):
        return []
    rows = [
        [
            component_name(row["component"]),
            with_error(row["ln_bf"], row["ln_bf_se"], 1),
            probability(row["probability"]),
            row["reading"],
        ]
        for row in found.to_dict("records")
    ]
    return [
        Table(
            ["Component", "ln BF", "Probability", "Reading"],
            rows,
            say("components_caption"),
            text=(0, 3),
        )
    ]


def _smooth(data: ReportData) -> list[Block]:
    """Say what Bayes factors mean under a smooth offset, and whether it or the form predicts."""
    weights = {} if data.verdict is None else data.verdict.error_model_weights
    if sum(weight for name, weight in weights.items() if "smooth" in name) < 0.5:
        return []
    if data.predicting is None:
        return [Text(say("smooth"))]
    return [Text(say("predicts_more", by=data.predicting, shown=form_name(data.shown)))]


def prior_section(data: ReportData) -> list[Block]:
    """Return the Bayes factors against the scale of each prior."""
    factors, against = data.sensitivity, form_name(data.shown)
    if not len(factors):
        return _unscaled(data)
    rows = []
    for (form, prior), part in factors.groupby(["form", "prior"], sort=False):
        ordered = part.sort_values("factor").dropna()
        if not len(ordered) or np.ptp(ordered["ln_bf"]) == 0:
            continue  # neither form has that parameter
        at_default = ordered.iloc[(ordered["factor"] - 1).abs().argmin()]
        cells = (ordered["ln_bf"].iloc[0], at_default["ln_bf"], ordered["ln_bf"].iloc[-1])
        span = f"{ordered['factor'].iloc[0]:g} to {ordered['factor'].iloc[-1]:g}"
        name = "c and c₁" if prior == "c" else parameter_name(str(prior))
        rows.append([form_name(str(form)), name, span, *(decimals(x, 1) for x in cells)])
    low, high = factors["factor"].min(), factors["factor"].max()
    words = say("prior_scales", low=f"{low:g}", high=f"{high:g}")
    caption = say("prior_scales_caption", against=against)
    ahead = factors.dropna().loc[lambda x: x["ln_bf"] > 0, "form"].unique()
    alt = say("ahead_somewhere", forms=[form_name(name) for name in ahead], against=against)
    header = ["Prior of", "Scale, times default", "ln BF at the least", "at default", "at the most"]
    found = Table([f"Form, against {against}", *header], rows, text=(0, 1))
    return [
        Text(f"{words} {alt}"),
        *_unscaled(data),
        Folded("Bayes factors at each scale", [Picture("prior-sensitivity", caption, alt), found]),
    ]


def _unscaled(data: ReportData) -> list[Block]:
    """Say which priors have no scale that could be varied."""
    fixed = {
        f"{parameter_name(name.partition('[')[0])} ({form_name(form)})"
        for form, fit in data.comparison.fits.items()
        for posterior in fit.posteriors.values()
        for name, prior in posterior.model.priors.items()
        if not prior.scale_name
    }
    if not fixed:
        return []
    return [Text(say("unscaled", priors=", ".join(sorted(fixed))))]


def prior_table(data: ReportData) -> Table:
    """Return the prior of every parameter and its reason; the first K represents all K."""
    found: dict[tuple[str, str], dict[str, tuple[str, str]]] = {}
    for form, fit in data.comparison.fits.items():
        for posterior in fit.posteriors.values():
            n_of = Counter(name.partition("[")[0] for name in posterior.model.priors)
            for name, prior in posterior.model.priors.items():
                kind = name.partition("[")[0]
                shown = f"{parameter_name(name)} and of the others" if n_of[kind] > 1 else None
                cells = shown or parameter_name(name), prior.words
                # Forms may have other priors of one parameter; of many K the first is shown.
                key = kind, prior.words if shown is None else ""
                found.setdefault(key, {}).setdefault(form, cells)
    kinds = Counter(kind for kind, _ in found)
    rows = []
    for (kind, _), by_form in found.items():
        shown, words = next(iter(by_form.values()))
        if kinds[kind] > 1:
            shown += f" ({', '.join(map(form_name, by_form))})"
        rows.append([shown, words, REASONS.get(kind, ABSENT)])
    return Table(
        ["Parameter", "Prior", "Why"],
        rows,
        "Priors of this run. The reasons are those of the defaults.",
        text=(0, 1, 2),
    )
