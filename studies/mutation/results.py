"""The results of mutation runs, as a file: one row per mutant."""

import csv
import hashlib
import tomllib
from dataclasses import astuple, dataclass, fields
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
CONFIGURATION = tomllib.loads(Path(__file__).with_name("modules.toml").read_text(encoding="utf-8"))
RESULTS = ROOT / "docs" / "mutation" / "mutants.csv"
TOTALS = RESULTS.with_name("modules.csv")


@dataclass(frozen=True)
class Result:
    """What became of a mutant: ``killed``, by which test, ``timed out`` or ``survived``.

    `source` tells the state of the module's file that was changed.
    """

    module: str
    source: str
    line: int
    column: int
    operator: str
    occurrence: int
    change: str
    outcome: str
    by: str
    cpu_s: float

    @property
    def mutant(self) -> tuple[str, str, int]:
        """What tells it from all others of the same source."""
        return self.module, self.operator, self.occurrence


def path_of(module: str) -> Path:
    """Return the file of a module named as in `modules.toml`."""
    above = ROOT if module.startswith("tests.") else ROOT / "src" / "ridgebayes"
    return above / f"{module.replace('.', '/')}.py"


def state_of(module: str) -> str:
    """Return what tells a state of a module's file from others."""
    return hashlib.sha256(path_of(module).read_bytes()).hexdigest()[:12]


def read() -> list[Result]:
    """Return all results so far."""
    if not RESULTS.exists():
        return []
    with RESULTS.open(encoding="utf-8", newline="") as file:
        return [
            Result(
                **{
                    **row,
                    "line": int(row["line"]),
                    "column": int(row["column"]),
                    "occurrence": int(row["occurrence"]),
                    "cpu_s": float(row["cpu_s"]),
                }
            )
            for row in csv.DictReader(file)
        ]


def write(results: list[Result]) -> None:
    """Write results in the order of the configuration and of the lines."""
    RESULTS.parent.mkdir(parents=True, exist_ok=True)
    order = {module: i for i, module in enumerate(CONFIGURATION["modules"])}
    results = sorted(
        results, key=lambda r: (order[r.module], r.line, r.column, r.operator, r.occurrence)
    )
    beside = RESULTS.with_suffix(".new")
    with beside.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([field.name for field in fields(Result)])
        writer.writerows(map(astuple, results))
    beside.replace(RESULTS)  # at once: a run may be stopped at any time


def totals() -> dict[str, int]:
    """Return how many mutants each module has, tried or not."""
    if not TOTALS.exists():
        return {}
    with TOTALS.open(encoding="utf-8", newline="") as file:
        return {row["module"]: int(row["mutants"]) for row in csv.DictReader(file)}


def write_totals(known: dict[str, int]) -> None:
    """Write how many mutants each module has."""
    order = [module for module in CONFIGURATION["modules"] if module in known]
    with TOTALS.open("w", encoding="utf-8", newline="") as file:
        rows = [("module", "mutants"), *((module, known[module]) for module in order)]
        csv.writer(file, lineterminator="\n").writerows(rows)
