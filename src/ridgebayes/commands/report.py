"""`ridgebayes report`: figures and report of a finished run, from what its folder holds."""

from pathlib import Path

from ridgebayes.commands import options
from ridgebayes.commands.pages import write_pages
from ridgebayes.commands.run_files import REFERENCE, read_run


def command(asked: options.Report) -> None:
    """Do what the command line asks for."""
    report_job(asked.folder)
    print(f"read {asked.folder / 'report.html'}")


def report_job(folder: Path) -> None:
    """Write the figures and the report of a run folder again, from what is in it."""
    reference = folder / REFERENCE
    comparison = read_run(folder)
    write_pages(comparison, folder, read_run(reference) if reference.is_dir() else None)
