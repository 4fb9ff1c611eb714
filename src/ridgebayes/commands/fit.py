"""`ridgebayes fit`: the posterior of one form, and its evidence."""

from pathlib import Path
from typing import Any

from ridgebayes.commands.request import FitRequest, finish
from ridgebayes.commands.run_files import write_fits, write_run_json
from ridgebayes.commands.run_folder import new_folder
from ridgebayes.comparison.comparison import Comparison
from ridgebayes.runtime.progress import Progress


def command(*, out: Path, form: str, force: bool, resume: bool, **asked: Any) -> None:
    """Do what the command line asks for."""
    done = fit_job(out, FitRequest(forms=[form], **asked), force=force, resume=resume)
    for fit in done.fits.values():
        print(fit)
    finish(done, out)


def fit_job(
    folder: Path, request: FitRequest, *, force: bool = False, resume: bool = False
) -> Comparison:
    """Fit one form to a table and write a run folder; arguments as for `run_job`."""
    inputs = request.resolve()
    with new_folder(folder, force=force, resume=resume) as partial, Progress(3) as progress:
        comparison = inputs.compare(progress, partial, scores=False)
        write_fits(comparison, partial)
        options = {"form": request.forms[0]} | request.options
        del options["forms"]
        write_run_json(
            partial,
            comparison,
            command="fit",
            seed=request.seed,
            options=options,
            stages=progress.stages,
        )
    return comparison
