"""`ridgebayes coverage`: how often bands contain the loads of textures left out."""

import json
from pathlib import Path

import pandas as pd

from ridgebayes.checks.coverage import coverage
from ridgebayes.commands.parsing import parse_names
from ridgebayes.commands.request import FitRequest
from ridgebayes.commands.run_files import versions
from ridgebayes.commands.run_folder import new_folder, write_csv, write_text
from ridgebayes.drawing.coverage import plot_coverage
from ridgebayes.drawing.style import save
from ridgebayes.errors import ComputationError, InputError
from ridgebayes.model.noise import Noise
from ridgebayes.runtime.pool import executor_for
from ridgebayes.runtime.progress import Progress

COVERAGE_JSON = "coverage.json"


def command(
    *,
    table: Path | None,
    out: Path,
    forms: str,
    noise: str,
    seed: int,
    force: bool,
    workers: int | None,
    scheduler: str | None,
) -> None:
    """Count how often bands contain transitions of textures left out, form by form.

    The folder holds coverage.csv, its figure as PNG and SVG, and coverage.json.
    """
    names, noises = parse_names(forms), parse_names(noise, "--noise")
    inputs = FitRequest(table, names).resolve()
    if len(set(noises)) < len(noises):
        raise InputError(f"noise: expected each once, got {', '.join(noises)}")
    models = [Noise.named(name) for name in noises] or list(Noise.every())
    n_worker = 2 if workers is None and scheduler is None else workers
    with (
        new_folder(out, force=force, about=COVERAGE_JSON) as partial,
        Progress(len(inputs.forms) * len(models) + 1) as progress,
        executor_for(n_worker, scheduler) as executor,
    ):
        found = coverage(
            inputs.table, inputs.forms, models, rng=seed, executor=executor, progress=progress.stage
        )
        write_csv(found, partial / "coverage.csv")
        with progress.stage("figure"):
            save(plot_coverage(found), partial / "coverage")
        content = {
            "command": "coverage",
            "versions": versions(),
            "seed": seed,
            "options": {
                "table": str(table) if table else None,
                "forms": names,
                "noise": noises,
                "workers": n_worker,
            },
            "table": inputs.table.where,
            "table_digest": inputs.table.digest(),
            "stages": progress.stages,
        }
        write_text(json.dumps(content, indent=2) + "\n", partial / COVERAGE_JSON)
    _print(found, out)


def _print(found: pd.DataFrame, out: Path) -> None:
    """Print the bands of 90 %; fits that failed are an error."""
    shown = found[found["prob"] == 0.9]
    columns = ["form", "noise", "n", "covered", "share", "share_se", "mean_width"]
    print("Bands of 90 %:")
    print(shown[columns].to_string(index=False, float_format="{:.3f}".format))
    print(f"{out}: {len(found)} rows; look at {out / 'coverage.png'}")
    failed = shown[shown["n_failed"] > 0]
    if len(failed):
        rows = zip(failed["form"], failed["noise"], failed["failed"], strict=True)
        raise ComputationError("\n".join(f"{form}, {name}: {why}" for form, name, why in rows))
