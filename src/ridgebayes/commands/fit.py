"""`ridgebayes fit`: the posterior of one form, and its evidence."""

from ridgebayes.commands import options
from ridgebayes.commands.answers import fit_answer
from ridgebayes.commands.compare import compare_job
from ridgebayes.commands.parsing import parse_form
from ridgebayes.commands.request import FitRequest
from ridgebayes.commands.terminal import Answer


def command(asked: options.Fit) -> Answer:
    """Do what the command line asks for."""
    request = FitRequest.of(asked, [parse_form(asked.form)])
    done = compare_job(asked.out, request, scores=False, force=asked.force, resume=asked.resume)
    return fit_answer(done, asked.out)
