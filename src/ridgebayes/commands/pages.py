"""Figures and reports of a run folder: begun by workers, written when the run is done."""

from concurrent.futures import Executor
from pathlib import Path

from ridgebayes.commands.run_files import REFERENCE
from ridgebayes.comparison.comparison import Comparison


def begin_figures(comparison: Comparison, executor: Executor | None) -> None:
    """Have workers, if there are any, begin to draw what `write_pages` will ask for."""
    if executor is not None:
        from ridgebayes.report.figures import begin_gallery

        begin_gallery(comparison, executor)


def write_pages(comparison: Comparison, folder: Path, reference: Comparison | None) -> None:
    """Write figures, report.html and report.md into a folder."""
    from ridgebayes.report import write_reports
    from ridgebayes.report.figures import save_figures

    save_figures(comparison, folder / "figures")
    if reference is not None and (folder / REFERENCE).is_dir():
        save_figures(reference, folder / REFERENCE / "figures")
        write_reports(reference, folder / REFERENCE)
    write_reports(comparison, folder, reference=reference)
