"""`ridgebayes fit`: the posterior of one form, and its evidence."""

from pathlib import Path
from typing import Any

from ridgebayes.commands.compare import compare_job
from ridgebayes.commands.request import FitRequest, finish


def command(*, out: Path, form: str, force: bool, resume: bool, **asked: Any) -> None:
    """Do what the command line asks for."""
    request = FitRequest(forms=[form], **asked)
    done = compare_job(out, request, scores=False, force=force, resume=resume)
    for fit in done.fits.values():
        print(fit)
    finish(done, out)
