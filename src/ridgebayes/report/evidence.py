# ruff: noqa: RUF001  (typographic minus, times and Greek are meant: readers see them)
"""Sections on the evidence: Bayes factors and what they owe to the priors."""

import math
from collections.abc import Hashable, Mapping
from typing import Any

import numpy as np

from ridgebayes.comparison.comparison import Comparison
from ridgebayes.comparison.ranking import best_form, forms_by_probability, sensitivity_factors
from ridgebayes.report.blocks import Picture, Section, Table, Text, table
from ridgebayes.report.names import form_name, parameter_name, said
from ridgebayes.report.numbers import ABSENT, decimals, number, probability, with_error


def evidence_section(comparison: Comparison) -> Section:
    """Return log evidences, Bayes factors and how well the methods agree."""
    blocks: list[Text | Table | Picture] = [ranking_table(comparison)]
    if len(comparison.probabilities) > 1:
        blocks.append(
            Picture(
                comparison,
                "evidence",
                "ln Bayes factor of each form against the best, by every method: the symbols lie "
                "one below the other where the methods agree. Monte Carlo errors are smaller than "
                "the symbols unless a bar shows.",
            )
        )
        blocks.append(pairs_table(comparison))
    blocks.append(agreement_table(comparison))
    return Section("Evidence", "evidence", tuple(blocks))


def ranking_table(comparison: Comparison) -> Table:
    """Return one row per form: evidence, factor against the best, probability."""
    used = {row["form"]: row for row in comparison.own_evidence.query("used").to_dict("records")}
    best = best_form(comparison)
    rows = []
    for name in forms_by_probability(comparison):
        fit = comparison.fits[name]
        state = "yes" if fit.converged else "NO"
        if name not in used or best is None:
            rows.append([form_name(name), str(len(fit.summary)), ABSENT, ABSENT, ABSENT, state])
            continue
        own, top = used[name], used[best]
        error = _hypot(own["log_evidence_se"], top["log_evidence_se"])
        factor = own["log_evidence"] - top["log_evidence"]
        rows.append(
            [
                form_name(name),
                str(len(fit.summary)),
                with_error(own["log_evidence"], own["log_evidence_se"]),
                "0 (best)" if name == best else with_error(factor, error),
                probability(own["model_probability"]),
                state,
            ]
        )
    rows += [[form_name(f), ABSENT, ABSENT, ABSENT, ABSENT, "FAILED"] for f in comparison.failures]
    return table(
        ["Form", "Parameters", "ln evidence", "ln BF against the best", "Probability", "Converged"],
        rows,
        "Natural logarithms; evidence of the log loads; probabilities at equal prior odds.",
        text=(0, 5),
        strong=(0,) if best is not None else (),
    )


def pairs_table(comparison: Comparison) -> Table:
    """Return every Bayes factor, the favoured form first."""
    rows = []
    factors = comparison.own_bayes_factors
    for row in factors.to_dict("records"):
        ahead, behind = row["form_a"], row["form_b"]
        if row["ln_bf"] < 0:
            ahead, behind = behind, ahead
        rows.append(
            [
                f"{form_name(ahead)} over {form_name(behind)}",
                with_error(abs(row["ln_bf"]), row["ln_bf_se"]),
                decimals(abs(row["log10_bf"]), 2),
                row["method"],
                said(row["reading"].partition(" (")[0].partition(";")[0] + " ").strip(),
            ]
        )
    return table(
        ["Pair", "ln BF", "log₁₀ BF", "Method", "Reading"],
        rows,
        "Bayes factors with Monte Carlo errors. Reading: Kass and Raftery (1995); undecided where "
        "|ln BF| is under 1 or under two standard errors.",
        text=(0, 3, 4),
    )


def agreement_table(comparison: Comparison) -> Table:
    """Return the evidence by every method and the distance between them in standard errors."""
    methods = list(dict.fromkeys(comparison.own_evidence["method"]))
    others = [m for m in methods if m != "bridge"]
    check = "importance" if "importance" in others else "quadrature"
    rows = []
    for name in forms_by_probability(comparison):
        rows_of = comparison.own_evidence[comparison.own_evidence["form"] == name]
        own = {row["method"]: row for row in rows_of.to_dict("records")}
        cells = [form_name(name)]
        for method in ["bridge", *others]:
            row = own.get(method)
            if row is None:
                cells.append(ABSENT)
            elif row["status"] != "ok":
                cells.append(str(row["status"]))
            else:
                cells.append(with_error(row["log_evidence"], row["log_evidence_se"]))
        cells.append(_distance(own, check))
        rows.append(cells)
    return table(
        ["Form", "bridge", *others, f"bridge − {check}, in standard errors"],
        rows,
        "The same ln evidence by independent methods: bridge from the draws, quadrature without "
        "any draw, importance sampling with draws of its own, Laplace as a first look without an "
        "error.",
    )


def _distance(own: Mapping[str, Mapping[Hashable, Any]], check: str) -> str:
    if not {"bridge", check} <= set(own):
        return ABSENT
    a, b = own["bridge"], own[check]
    error = _hypot(a["log_evidence_se"], b["log_evidence_se"])
    return decimals((a["log_evidence"] - b["log_evidence"]) / error, 1) if error else ABSENT


def _hypot(*errors: float) -> float:
    return math.hypot(*(e for e in errors if e == e))


def prior_section(comparison: Comparison) -> Section:
    """Return the Bayes factors against every prior scale."""
    best = best_form(comparison)
    if best is None or len(comparison.probabilities) < 2:
        return Section("Prior sensitivity", "priors", ())
    factors = sensitivity_factors(comparison, best)
    if not len(factors):
        return Section("Prior sensitivity", "priors", ())
    rows = []
    for (form, prior), part in factors.groupby(["form", "prior"], sort=False):
        ordered = part.sort_values("factor").dropna()
        if not len(ordered) or np.ptp(ordered["ln_bf"]) == 0:
            continue  # neither form has that parameter
        at_default = ordered.iloc[(ordered["factor"] - 1).abs().argmin()]
        cells = (ordered["ln_bf"].iloc[0], at_default["ln_bf"], ordered["ln_bf"].iloc[-1])
        name = "c and c₁" if prior == "c" else parameter_name(str(prior))
        rows.append([form_name(str(form)), name, *(decimals(x, 2) for x in cells)])
    low, high = factors["factor"].min(), factors["factor"].max()
    return Section(
        "Prior sensitivity",
        "priors",
        (
            Text(
                "A Bayes factor always depends on how wide the priors are. Here each prior's scale "
                f"is run over a factor of {number(high / low, 3)} with everything else kept."
            ),
            Picture(
                comparison,
                "prior-sensitivity",
                f"ln Bayes factor of each form against {form_name(best)}; above zero it would be "
                "ahead. Dotted line: the default scale. The axis is linear within 5 of zero.",
            ),
            table(
                [
                    f"Form, against {form_name(best)}",
                    "Prior of",
                    f"ln BF at {low:g} × scale",
                    "at default",
                    f"at {high:g} × scale",
                ],
                rows,
                text=(0, 1),
            ),
        ),
    )
