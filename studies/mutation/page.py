"""Writes the score in docs/mutation.md from the results of the runs and the reasons of survivors.

``python -m studies.mutation.page`` from the repository's root. `docs/mutation/survivors.csv`
holds the reasons. A survivor without one is an error.
"""

import csv
from collections import Counter
from collections.abc import Iterable, Sequence

from studies.mutation.results import ROOT, Result, read, totals

PAGE = ROOT / "docs" / "mutation.md"
REASONS = ROOT / "docs" / "mutation" / "survivors.csv"
CORE = {
    "forms": ("model.forms.",),
    "likelihood": (
        *("model.model", "model.rows", "model.observations", "model.noise"),
        "distributions.distribution",
    ),
    "evidence": ("evidence.", "inference."),
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


def table(header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return a table in Markdown."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join(f"| {' | '.join(map(str, line))} |" for line in lines)


def by_part(results: Sequence[Result]) -> str:
    """Return the table with a line for each part of the core."""
    size = totals()
    parts = {part: [r for r in results if r.module.startswith(CORE[part])] for part in CORE}
    rows = [row_of(part, of_part, size) for part, of_part in parts.items() if of_part]
    header = ("part", "mutants", "tried", "killed", "timed out", "survived", "detected")
    return table(header, [*rows, row_of("all", results, size)])


def row_of(name: str, results: Sequence[Result], size: dict[str, int]) -> list[object]:
    """Return a line of the table."""
    count = Counter(result.outcome for result in results)
    n_mutant = sum(size[module] for module in {result.module for result in results})
    counts = (count["killed"], count["timed out"], count["survived"])
    return [name, n_mutant, len(results), *counts, share(results)]


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
    """Return the page: its text as it is, and the score of the results."""
    results = read()
    head, heading, _ = PAGE.read_text(encoding="utf-8").partition("## Score\n")
    return "\n\n".join([head + heading.strip(), by_part(results), *survivors(results)]) + "\n"


if __name__ == "__main__":
    PAGE.write_text(text(), encoding="utf-8")
