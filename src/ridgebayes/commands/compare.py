"""`ridgebayes compare`: posteriors, evidences, Bayes factors and scores of several forms."""

from pathlib import Path

from ridgebayes.commands import options
from ridgebayes.commands.answers import comparison_answer
from ridgebayes.commands.parsing import parse_forms
from ridgebayes.commands.request import FitRequest
from ridgebayes.commands.run_files import write_comparison, write_fits, write_run_json
from ridgebayes.commands.run_folder import new_folder
from ridgebayes.commands.terminal import Answer
from ridgebayes.comparison.comparison import Comparison
from ridgebayes.runtime.progress import Progress


def command(asked: options.Compare) -> Answer:
    """Do what the command line asks for."""
    request = FitRequest.of(asked, parse_forms(asked.forms))
    done = compare_job(asked.out, request, force=asked.force, resume=None)
    return comparison_answer(done, asked.out)


def compare_job(
    folder: Path,
    request: FitRequest,
    *,
    scores: bool = True,
    force: bool = False,
    resume: bool | None = False,
) -> Comparison:
    """Fit forms to a table and write a run folder.

    Parameters
    ----------
    folder : Path
        Run folder to make.
    request : FitRequest
        Table and forms to fit, with their options.
    scores : bool, optional
        Whether forms are also compared by Bayes factors and scores, as `ridgebayes compare` does;
        `ridgebayes fit` writes posteriors and evidences alone.
    force : bool, optional
        As for `ridgebayes.commands.run.run_job`.
    resume : bool or None, optional
        As for `ridgebayes.commands.run_folder.new_folder`.

    Returns
    -------
    Comparison
        Where a fit failed or did not converge, `complete` is False.

    Raises
    ------
    InputError
        If an argument or the table breaks a rule; nothing is written then.
    """
    inputs, options = request.resolve(), request.options
    if not scores:
        options["form"] = ",".join(options.pop("forms"))
    with (
        new_folder(folder, force=force, resume=resume) as partial,
        Progress(len(inputs.walked) + (4 if scores else 2)) as progress,
    ):
        comparison = inputs.compare(progress, partial, scores=scores)
        (write_comparison if scores else write_fits)(comparison, partial)
        write_run_json(
            partial,
            comparison,
            command="compare" if scores else "fit",
            seed=request.seed,
            options=options,
            stages=progress.stages,
        )
    return comparison
