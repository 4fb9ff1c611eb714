"""Writes docs/mutation.md from the results of the runs and the reasons given for survivors.

``python -m studies.mutation.page`` from the repository's root. `docs/mutation/survivors.csv`
holds the reasons. A survivor without one is an error.
"""

import csv
from collections import Counter
from collections.abc import Iterable, Sequence

from scipy import stats

from studies.mutation.results import ROOT, Result, read, totals

PAGE = ROOT / "docs" / "mutation.md"
REASONS = ROOT / "docs" / "mutation" / "survivors.csv"
CORE = {
    "forms": ("model.forms.",),
    "likelihood": (
        *("model.model", "model.rows", "model.likelihood", "model.observations", "model.noise"),
        *("distributions.distribution", "model.shared_offsets", "inference.laplace"),
    ),
    "evidence": (*("evidence.", "inference."),),
    "half-plane": ("contact.",),
}
NEEDLESS = ("no difference", "speed only", "record type only")


def reasons() -> dict[tuple[str, str, int], tuple[str, str]]:
    """Return kind and reason of each survivor."""
    with REASONS.open(encoding="utf-8", newline="") as file:
        return {
            (row["module"], row["operator"], int(row["occurrence"])): (row["kind"], row["reason"])
            for row in csv.DictReader(file)
        }


def noticed(results: Sequence[Result]) -> int:
    """Return how many mutants a test noticed, by a failure or by not ending."""
    return sum(result.outcome != "survived" for result in results)


def share(results: Sequence[Result]) -> str:
    """Return the share of mutants noticed."""
    return f"{100 * noticed(results) / len(results):.1f} %"


def interval(results: Sequence[Result]) -> str:
    """Return the exact 95 % interval of the share among all mutants of a sampled module."""
    ends = stats.binomtest(noticed(results), len(results)).proportion_ci(0.95, "exact")
    return f"{100 * ends.low:.0f} to {100 * ends.high:.0f} %"


def table(header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return a table in Markdown."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join(f"| {' | '.join(map(str, line))} |" for line in lines)


def by_module(results: Sequence[Result]) -> str:
    """Return the table of modules, with a line for each part of the core."""
    rows, size = [], totals()
    for part, names in CORE.items():
        of_part = [r for r in results if r.module.startswith(names)]
        if not of_part:  # not measured yet
            continue
        modules = list(dict.fromkeys(r.module for r in of_part))
        for module in modules:
            rows.append(row_of(f"`{module}`", [r for r in of_part if r.module == module], size))
        rows.append(row_of(f"**{part}**", of_part, size))
    rows.append(row_of("**all**", results, size))
    return table(
        ("module", "mutants", "tried", "killed", "timed out", "survived", "detected"), rows
    )


def row_of(name: str, results: Sequence[Result], size: dict[str, int]) -> list[object]:
    """Return a line of the table of modules."""
    count = Counter(result.outcome for result in results)
    modules = {result.module for result in results}
    everything = sum(size[module] for module in modules)
    noted = share(results)
    if len(modules) == 1 and everything > len(results):
        noted += f" ({interval(results)})"
    counts = (count["killed"], count["timed out"], count["survived"])
    return [name, everything, len(results), *counts, noted]


def survivors(results: Sequence[Result]) -> tuple[str, str]:
    """Return the share without needless changes, and the table of kinds of survivors.

    Raises
    ------
    KeyError
        If a survivor has no reason.
    """
    reason_of = reasons()
    lived = [result for result in results if result.outcome == "survived"]
    kinds = Counter(reason_of[result.mutant][0] for result in lived)
    needless = sum(kinds[kind] for kind in NEEDLESS)
    rest = len(results) - needless
    return (
        f"{needless} of the {len(results)} mutants survive because they change no result "
        f"({', '.join(NEEDLESS)}). Tests detect {100 * noticed(results) / rest:.1f} % of the "
        f"other {rest}.",
        table(("kind", "survivors"), kinds.most_common()),
    )


def text() -> str:
    """Return the page."""
    results = read()
    head = REASONS.with_name("head.md").read_text(encoding="utf-8")
    parts = [head.strip(), "## Score", by_module(results), *survivors(results)]
    return "\n\n".join(parts) + "\n"


if __name__ == "__main__":
    PAGE.write_text(text(), encoding="utf-8")
