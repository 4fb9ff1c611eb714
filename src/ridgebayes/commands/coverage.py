"""`ridgebayes coverage`: share of the loads of left-out textures inside their bands."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd

from ridgebayes import drawing
from ridgebayes.checks.coverage import coverage
from ridgebayes.commands.options import Coverage
from ridgebayes.commands.parsing import parse_forms, parse_names
from ridgebayes.commands.run_files import EMBEDDED, about_run
from ridgebayes.commands.run_folder import new_folder, write_csv, write_json
from ridgebayes.commands.terminal import Answer, files_in
from ridgebayes.errors import InputError
from ridgebayes.model.noise import Noise
from ridgebayes.request import DEFAULT_FORMS, Request
from ridgebayes.runtime.pool import executor_for
from ridgebayes.runtime.progress import Progress
from ridgebayes.table.datafiles import paper_sweep

COVERAGE_JSON = "coverage.json"


def command(asked: Coverage) -> Answer:
    """Compute the share of transitions of left-out textures inside the bands of each form.

    The output folder contains coverage.csv, a figure as PNG and SVG, and coverage.json.
    """
    names, noises = parse_forms(asked.forms), parse_names(asked.noise, "--noise")
    table = replace(paper_sweep(), where=EMBEDDED) if asked.table is None else asked.table
    request = Request.of(table, names or DEFAULT_FORMS)
    if len(set(noises)) < len(noises):
        raise InputError(f"noise: expected error models without repeats, got {', '.join(noises)}")
    models = [Noise.named(name) for name in noises] or list(Noise.every())
    n_worker = 2 if asked.workers is None and asked.scheduler is None else asked.workers
    with (
        new_folder(asked.out, force=asked.force, about=COVERAGE_JSON) as partial,
        Progress(len(request.forms) * len(models) + 1) as progress,
        executor_for(n_worker, asked.scheduler) as executor,
    ):
        keywords: dict[str, Any] = {"rng": asked.seed, "executor": executor}
        shares = coverage(request.table, request.forms, models, progress=progress.stage, **keywords)
        if shares.empty:
            raise InputError(
                f"{request.table.where}: expected a row that gives the load itself, got only "
                "brackets and counts; bands are not compared with these"
            )
        write_csv(shares, partial / "coverage.csv")
        with progress.stage("figure"):
            drawing.style.save(drawing.coverage.plot_coverage(shares), partial / "coverage")
        options = {
            "table": str(asked.table) if asked.table else None,
            "forms": names,
            "noise": noises,
            "workers": n_worker,
        }
        about = about_run("coverage", asked.seed, options, request.table)
        write_json(about | {"stages": progress.stages}, partial / COVERAGE_JSON)
    return _answer(shares, asked.out)


def _answer(shares: pd.DataFrame, out: Path) -> Answer:
    """Return the coverage of 90 % bands; failed fits are the problem of the answer."""
    shown = shares[shares["prob"] == 0.9]
    columns = ["form", "noise", "n", "covered", "share", "share_se", "mean_width"]
    failed = shown[shown["n_failed"] > 0]
    rows = zip(failed["form"], failed["noise"], failed["failed"], strict=True)
    summary = f"{out}: {len(shares)} rows; look at {out / 'coverage.png'}"
    return Answer(
        ("Bands of 90 %:", shown[columns].round(3), summary),
        shares,
        files_in(out),
        problem="\n".join(f"{form}, {name}: {why}" for form, name, why in rows),
    )
