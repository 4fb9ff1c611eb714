"""`ridgebayes report`: figures and report of a finished run, from what its folder holds."""

from pathlib import Path

from ridgebayes.commands import options
from ridgebayes.commands.pages import command_line, write_pages
from ridgebayes.commands.run_files import REFERENCE, read_command, read_run
from ridgebayes.commands.terminal import Answer, files_in


def command(asked: options.Report) -> Answer:
    """Do what the command line asks for."""
    report_job(asked.folder)
    names = {"report.html", "report.md", "figures"}
    written = [path for path in files_in(asked.folder) if not names.isdisjoint(path.parts)]
    return Answer((f"read {asked.folder / 'report.html'}",), files=written)


def report_job(folder: Path) -> None:
    """Write the figures and the report of a run folder again, from what is in it."""
    reference = folder / REFERENCE
    comparison = read_run(folder)
    second = read_run(reference) if reference.is_dir() else None
    write_pages(comparison, folder, second, command=command_line(*read_command(folder)))
