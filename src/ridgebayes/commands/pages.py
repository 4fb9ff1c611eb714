"""Figures and reports of a run folder: begun by workers, written when the run is done."""

from concurrent.futures import Executor
from pathlib import Path
from typing import TYPE_CHECKING, Optional

from ridgebayes.commands.run_files import REFERENCE
from ridgebayes.comparison.comparison import Comparison

if TYPE_CHECKING:
    from ridgebayes.report.figures.gallery import Gallery


def begin_figures(comparison: Comparison, executor: Executor | None) -> Optional["Gallery"]:
    """Have workers, if there are any, begin to draw what `write_pages` will ask for."""
    return None if executor is None else _gallery(comparison, executor)


def write_pages(
    comparison: Comparison,
    folder: Path,
    reference: Comparison | None,
    begun: tuple[Optional["Gallery"], Optional["Gallery"]] = (None, None),
) -> None:
    """Write figures, report.html and report.md into a folder.

    Parameters
    ----------
    comparison : Comparison
        What to report.
    folder : Path
        Where to.
    reference : Comparison or None
        Second comparison, whose own pages go into a folder of their own if that is there.
    begun : (Gallery or None, Gallery or None), optional
        What `begin_figures` returned for each.
    """
    from ridgebayes.report import write_reports  # imports matplotlib

    gallery, second = begun[0] or _gallery(comparison), begun[1]
    if reference is not None:
        second = second or _gallery(reference)
        if (folder / REFERENCE).is_dir():
            second.save(folder / REFERENCE / "figures")
            write_reports(second, folder / REFERENCE)
    gallery.save(folder / "figures")
    write_reports(gallery, folder, reference=second)


def _gallery(comparison: Comparison, executor: Executor | None = None) -> "Gallery":
    # They import matplotlib, which a run does while it waits for workers.
    from ridgebayes.checks.report_data import report_data
    from ridgebayes.report.figures.gallery import Gallery

    return Gallery(report_data(comparison), executor)
