"""`ridgebayes report`: figures and report of a run folder, also at the end of a run."""

import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ridgebayes.checks.report_data import report_data
from ridgebayes.commands import options
from ridgebayes.commands.run_files import REFERENCE, read_command, read_run
from ridgebayes.commands.terminal import Answer, files_in
from ridgebayes.comparison.comparison import Comparison
from ridgebayes.inference.presets import STANDARD
from ridgebayes.model.noise import AUTO
from ridgebayes.report import write_reports
from ridgebayes.report.figures.gallery import Gallery

_DEFAULTS = (("noise", AUTO), ("accuracy", STANDARD.name))


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


def write_pages(
    comparison: Comparison,
    folder: Path,
    reference: Comparison | None,
    galleries: Sequence[Gallery | None] = (),
    *,
    command: str = "",
) -> None:
    """Write figures, report.html and report.md into a folder.

    Parameters
    ----------
    comparison : Comparison
        Comparison to report.
    folder : Path
        Folder to write to.
    reference : Comparison or None
        Second comparison, whose own pages go into a folder of their own if that is there.
    galleries : sequence of Gallery or None, optional
        Figures of each comparison that workers draw already; None where none are started.
    command : str, optional
        Command line as typed, see `command_line`.
    """
    first, second = (*galleries, None, None)[:2]
    gallery = first or Gallery(report_data(comparison))
    if reference is not None:
        second = second or Gallery(report_data(reference))
        if (folder / REFERENCE).is_dir():
            second.save(folder / REFERENCE / "figures")
            write_reports(second, folder / REFERENCE, command=command)
    gallery.save(folder / "figures")
    write_reports(gallery, folder, reference=second, command=command)


def command_line(command: str, options: Mapping[str, Any], seed: int) -> str:
    """Return a command line that gives the same numbers; files without their folders.

    Examples
    --------
    >>> command_line("run", {"table": "/home/me/a.csv", "forms": [], "noise": "auto"}, 3)
    'ridgebayes run --table a.csv --seed 3'
    >>> command_line("run", {"prior_odds": {"hybrid": 2.0, "classic": 0.5}}, 0)
    'ridgebayes run --prior-odds hybrid=2,classic=0.5 --seed 0'
    """
    words = ["ridgebayes", command]
    for name, value in options.items():
        if value and (name, value) not in _DEFAULTS:
            if isinstance(value, dict):  # prior odds
                value = [f"{key}={odds:.15g}" for key, odds in value.items()]
            text = ",".join(map(str, value)) if isinstance(value, list) else str(value)
            word = Path(text).name if name in ("table", "priors") else text
            words += [f"--{name.replace('_', '-')}", word]
    return shlex.join([*words, "--seed", str(seed)])
