"""`ridgebayes report`: figures and report of a finished run, from what its folder holds."""

from pathlib import Path

from ridgebayes.commands import options
from ridgebayes.commands.pages import command_line, write_pages
from ridgebayes.commands.run_files import REFERENCE, read_command, read_run
from ridgebayes.commands.terminal import Answer, files_in
from ridgebayes.report import checklist_of


def command(asked: options.Report) -> Answer:
    """Do what the command line asks for."""
    if asked.checklist:
        rows = checklist_of(read_run(asked.folder))
        met = sum(is_met for _, is_met, _ in rows)
        lines = (f"{'met' if is_met else 'NOT'}  {item}: {at}" for item, is_met, at in rows)
        result = [{"item": item, "met": is_met, "where": at} for item, is_met, at in rows]
        return Answer((*lines, f"{met} of {len(rows)} items are met."), result)
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
