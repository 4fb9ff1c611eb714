"""`ridgebayes fit`: the posterior of one form, and its evidence."""

from ridgebayes.commands import options
from ridgebayes.commands.compare import compare_job
from ridgebayes.commands.request import FitRequest, finish


def command(asked: options.Fit) -> None:
    """Do what the command line asks for."""
    request = FitRequest.of(asked, [asked.form])
    done = compare_job(asked.out, request, scores=False, force=asked.force, resume=asked.resume)
    for fit in done.fits.values():
        print(fit)
    finish(done, asked.out)
