"""Report of a comparison, as one self-contained HTML file or one Markdown file.

`write_report` collects all results once (`ridgebayes.checks.report_data`). Then `report.sections`
arranges them into sections, `report.figures` draws figures, and a template lays them out; no result
is computed here. All text that comes from a table is escaped.

Examples
--------
>>> import ridgebayes as rb
>>> cmp = rb.compare(rb.paper_sweep(), ["modified", "hybrid"], noise="iid", accuracy="quick")
>>> print(render_report(cmp, ".md").splitlines()[4])
**The evidence supports Hybrid among the forms compared.**
"""

import base64
import os
import re
from pathlib import Path

from ridgebayes.checks.report_data import report_data
from ridgebayes.comparison.comparison import Comparison
from ridgebayes.drawing import KINDS
from ridgebayes.errors import InputError, expect
from ridgebayes.report.blocks import Picture
from ridgebayes.report.exports import links
from ridgebayes.report.figures.gallery import Gallery
from ridgebayes.report.first_screen import first_screen
from ridgebayes.report.sections import contents
from ridgebayes.runtime.atomic import write_text
from ridgebayes.runtime.templates import environment_of
from ridgebayes.runtime.text import visible

__all__ = ["render_report", "write_report", "write_reports"]

_MAX_BYTES_SVG = 72_000  # bytes; a larger SVG is embedded as PNG
_TEMPLATES = {".html": "report.html.jinja", ".md": "report.md.jinja"}


def write_report(
    comparison: Comparison, path: str | os.PathLike[str], *, reference: Comparison | None = None
) -> None:
    """Write the report of a comparison to one file.

    Parameters
    ----------
    comparison : Comparison
        Comparison as computed, or read from a run folder, which gives the same report.
    path : str or path
        Ends in ``.html`` (with figures and small scripts, without external links) or ``.md`` (text
        and tables). An existing file is overwritten.
    reference : Comparison, optional
        Second comparison, on finite-element rows, shown in a separate section.

    Raises
    ------
    InputError
        If `comparison` is not a `Comparison`, the suffix is unknown, or the folder does not exist.
    OutputError
        If the file cannot be written, for instance because the disk is full.

    Notes
    -----
    Equal comparisons give equal bytes: the report contains no date, and no path except the name of
    the table. Published coefficients are shown for the embedded sweep only.

    *Cost.* About two CPU seconds for Markdown; with figures about 15.

    Examples
    --------
    >>> import tempfile
    >>> import ridgebayes as rb
    >>> cmp = rb.compare(rb.paper_sweep(), ["modified", "hybrid"], noise="iid", accuracy="quick")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_report(cmp, f"{folder}/report.md")
    ...     print(Path(folder, "report.md").read_text(encoding="utf-8").splitlines()[4])
    **The evidence supports Hybrid among the forms compared.**
    """
    expect(Comparison, comparison=comparison)
    expect(Comparison, None, reference=reference)
    expect(str, os.PathLike, path=path)
    target = Path(path)
    suffix = target.suffix.lower()
    if suffix not in _TEMPLATES:
        raise InputError(f"{target}: expected a report that ends in .html or .md")
    write_text(render_report(comparison, suffix, reference=reference), target)


def render_report(
    comparison: Comparison, suffix: str = ".html", *, reference: Comparison | None = None
) -> str:
    """Return the text of a report; see `write_report`.

    Parameters
    ----------
    comparison : Comparison
        Comparison to report.
    suffix : str, optional
        ``.html`` or ``.md``.
    reference : Comparison, optional
        Second comparison.

    Returns
    -------
    str
        The whole file.
    """
    second = None if reference is None else Gallery(report_data(reference))
    return _rendered(Gallery(report_data(comparison)), second, [suffix])[0]


def write_reports(
    gallery: Gallery, folder: Path, *, reference: Gallery | None = None, command: str = ""
) -> None:
    """Write report.html and report.md into a folder; see `write_report`.

    Parameters
    ----------
    gallery : Gallery
        Comparison to report, with its figures.
    folder : Path
        Folder to write to.
    reference : Gallery, optional
        Second comparison, with figures in the folder's ``reference-fe``.
    command : str, optional
        Command line as typed by the user.
    """
    pages = _rendered(gallery, reference, list(_TEMPLATES), command=command, in_folder=True)
    for suffix, page in zip(_TEMPLATES, pages, strict=True):
        write_text(page, folder / f"report{suffix}")


def _rendered(
    gallery: Gallery,
    reference: Gallery | None,
    suffixes: list[str],
    *,
    command: str = "",
    in_folder: bool = False,
) -> list[str]:
    def image(picture: Picture) -> str:
        """Return a figure to embed, drawn now, so that a page without figures draws none."""
        owner = reference if picture.of_reference and reference is not None else gallery
        kind, content = "svg+xml", owner.file(picture.name, "svg")
        if len(content) > _MAX_BYTES_SVG:
            kind, content = "png", owner.file(picture.name, "png")
        return f"data:image/{kind};base64,{base64.b64encode(content).decode('ascii')}"

    def files(picture: Picture) -> dict[str, str]:
        """Return the paths of a figure's files if they are saved beside the page."""
        folder = "reference-fe/figures" if picture.of_reference else "figures"
        paths = {kind: f"{folder}/{picture.name}.{kind}" for kind in KINDS}
        return paths if in_folder else {}

    filled: dict[str, object] = {
        "first": first_screen(gallery.data, None if reference is None else reference.data, command),
        "sections": contents(gallery, reference),
        "image": image,
        "files": files,
        "downloads": links,
    }
    pages = []
    for suffix in suffixes:
        # Markdown is escaped here; HTML is escaped afterwards by autoescape.
        finalize = _markdown if suffix == ".md" else _escaped_html_text
        environment = environment_of("ridgebayes.report", _TEMPLATES[suffix], finalize)
        pages.append(environment.get_template(_TEMPLATES[suffix]).render(filled))
    return pages


def _escaped_html_text(value: object) -> object:
    """Keep a number and its per cent sign on one line, and show invisible characters."""
    return visible(value).replace(" %", "\N{NO-BREAK SPACE}%") if type(value) is str else value


def _markdown(value: object) -> object:
    """Escape a value unless it is Markdown already."""
    return value if hasattr(value, "__html__") else escaped_markdown(value)


def escaped_markdown(value: object) -> str:
    r"""Return text escaped for Markdown, also inside a table cell.

    Examples
    --------
    >>> print(escaped_markdown("<script> a|b *c*"))
    &lt;script&gt; a\|b \*c\*
    """
    text = visible(" ".join(str(value).split())).replace("&", "&amp;")
    text = text.replace("<", "&lt;").replace(">", "&gt;")
    # An underscore within a word has no meaning in Markdown.
    return re.sub(r"([\\`*\[\]|~$]|(?<![^\W_])_|_(?![^\W_]))", r"\\\1", text)
