"""`ridgebayes compare`: posteriors, evidences, Bayes factors and scores of several forms."""

from pathlib import Path
from typing import Any

from ridgebayes.commands.parsing import parse_names
from ridgebayes.commands.request import FitRequest, finish
from ridgebayes.commands.run_files import write_comparison, write_run_json
from ridgebayes.commands.run_folder import new_folder
from ridgebayes.comparison.comparison import Comparison
from ridgebayes.runtime.progress import Progress


def command(*, out: Path, forms: str, force: bool, **asked: Any) -> None:
    """Do what the command line asks for."""
    done = compare_job(out, FitRequest(forms=parse_names(forms), **asked), force=force)
    print(done.bayes_factors.to_string(index=False))
    finish(done, out)


def compare_job(
    folder: Path, request: FitRequest, *, force: bool = False, resume: bool = False
) -> Comparison:
    """Compare forms on a table and write a run folder; arguments as for `run_job`."""
    inputs = request.resolve()
    with (
        new_folder(folder, force=force, resume=resume) as partial,
        Progress(2 * len(inputs.forms) + 3) as progress,
    ):
        comparison = inputs.compare(progress, partial)
        write_comparison(comparison, partial)
        write_run_json(
            partial,
            comparison,
            command="compare",
            seed=request.seed,
            options=request.options,
            stages=progress.stages,
        )
    return comparison
