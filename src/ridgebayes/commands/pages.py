"""Figures and reports of a run folder: begun by workers, written when the run is done."""

from collections.abc import Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import TYPE_CHECKING, Optional

from ridgebayes.checks.report_data import ReportData, report_data
from ridgebayes.commands.run_files import REFERENCE
from ridgebayes.comparison.comparison import Comparison

if TYPE_CHECKING:
    from ridgebayes.report.figures.gallery import Gallery


def begin_figures(data: ReportData, executor: Executor) -> "Gallery":
    """Have workers begin to draw what `write_pages` will ask for."""
    from ridgebayes.report.figures.gallery import Gallery  # imports matplotlib

    return Gallery(data, executor)


def write_pages(
    comparison: Comparison,
    folder: Path,
    reference: Comparison | None,
    begun: Sequence[Optional["Gallery"]] = (),
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
    begun : sequence of Gallery or None, optional
        What `begin_figures` returned for each; None where nothing is begun.
    """
    # They import matplotlib, which a run does while it waits for workers.
    from ridgebayes.report import write_reports
    from ridgebayes.report.figures.gallery import Gallery

    first, second = (*begun, None, None)[:2]
    gallery = first or Gallery(report_data(comparison))
    if reference is not None:
        second = second or Gallery(report_data(reference))
        if (folder / REFERENCE).is_dir():
            second.save(folder / REFERENCE / "figures")
            write_reports(second, folder / REFERENCE)
    gallery.save(folder / "figures")
    write_reports(gallery, folder, reference=second)
