"""The report of a comparison: one self-contained HTML file, or one Markdown file.

`write_report` arranges what a `Comparison` holds into sections (`report.sections` lists them), and
a template lays them out. Everything that comes from a table is escaped.
"""

import base64
import os
import re
from pathlib import Path
from typing import TYPE_CHECKING

from ridgebayes.comparison.comparison import Comparison
from ridgebayes.errors import InputError
from ridgebayes.report.blocks import Picture
from ridgebayes.report.figures import gallery
from ridgebayes.report.sections import contents
from ridgebayes.report.verdict import verdict
from ridgebayes.runtime.atomic import replacing
from ridgebayes.runtime.text import visible

if TYPE_CHECKING:
    from jinja2 import Environment

__all__ = ["render_report", "write_report", "write_reports"]

_TEMPLATES = {".html": "report.html.jinja", ".md": "report.md.jinja"}


def write_report(
    comparison: Comparison,
    path: str | os.PathLike[str],
    *,
    reference: Comparison | None = None,
) -> None:
    """Write the report of a comparison into one file.

    Parameters
    ----------
    comparison : Comparison
        As computed, or read back from a run folder: the report is the same.
    path : str or path
        Ends in ``.html`` (figures embedded, no scripts, no links to elsewhere) or ``.md`` (text
        and tables). An existing file is replaced, whole or not at all.
    reference : Comparison, optional
        A second comparison, on finite-element rows, that gets a section of its own.

    Raises
    ------
    InputError
        If the suffix is another, or the folder does not exist.
    OutputError
        If the file cannot be written, such as on a full disk.

    Notes
    -----
    Equal comparisons give equal bytes: no date, no path but the table's name.

    Examples
    --------
    >>> import tempfile
    >>> import ridgebayes as rb
    >>> cmp = rb.compare(rb.paper_sweep(), [rb.Modified(), rb.Hybrid()], rng=1)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_report(cmp, f"{folder}/report.md")
    ...     print(Path(folder, "report.md").read_text(encoding="utf-8").splitlines()[2])
    **Hybrid is the form the evidence supports.**
    """
    target = Path(path)
    suffix = target.suffix.lower()
    if suffix not in _TEMPLATES:
        raise InputError(
            f"{target}: suffix {target.suffix!r}; expected a report ends in .html or .md"
        )
    _write(target, render_report(comparison, suffix, reference=reference))


def write_reports(
    comparison: Comparison, folder: Path, *, reference: Comparison | None = None
) -> None:
    """Write report.html and report.md into a folder; see `write_report`.

    Parameters
    ----------
    comparison : Comparison
        What to report.
    folder : Path
        Where to.
    reference : Comparison, optional
        Second comparison.
    """
    filled = _filled(comparison, reference)
    for suffix in _TEMPLATES:
        _write(folder / f"report{suffix}", _rendered(suffix, filled))


def render_report(
    comparison: Comparison, suffix: str = ".html", *, reference: Comparison | None = None
) -> str:
    """Return the text of a report; see `write_report`.

    Parameters
    ----------
    comparison : Comparison
        What to report.
    suffix : str, optional
        ``.html`` or ``.md``.
    reference : Comparison, optional
        Second comparison.

    Returns
    -------
    str
        The whole file.
    """
    return _rendered(suffix, _filled(comparison, reference))


def _filled(comparison: Comparison, reference: Comparison | None) -> dict[str, object]:
    return {
        "verdict": verdict(comparison, reference),
        "sections": contents(comparison, reference),
    }


def _rendered(suffix: str, filled: dict[str, object]) -> str:
    return _environment(suffix).get_template(_TEMPLATES[suffix]).render(filled)


def _write(path: Path, content: str) -> None:
    with replacing(path) as partial:
        partial.write_text(content, encoding="utf-8", newline="\n")


def _environment(suffix: str) -> "Environment":
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("ridgebayes"),
        autoescape=suffix == ".html",
        # Markdown is escaped here, HTML after this by autoescape.
        finalize=escaped_markdown if suffix == ".md" else _tied,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.globals["image"] = _data_uri
    environment.filters["badge"] = _badge
    return environment


def _data_uri(picture: Picture) -> str:
    """Return a figure to embed, or nothing where it does not apply to its comparison."""
    plate = gallery(picture.owner).get(picture.name)
    if plate is None:
        return ""
    return "data:image/png;base64," + base64.b64encode(plate.png).decode("ascii")


def _tied(value: object) -> object:
    """Keep a number and its per cent sign on one line, and show characters that hide."""
    return visible(value).replace(" %", "\N{NO-BREAK SPACE}%") if type(value) is str else value


def _badge(words: str) -> str:
    """Return the class of a word that stands out."""
    good, bad = (
        {"confirmed", "converged", "inside"},
        {"not confirmed", "did not converge", "outside"},
    )
    return "good" if words in good else "bad" if words in bad else "open"


def escaped_markdown(value: object) -> str:
    r"""Return text so that Markdown shows it as it is, in a table cell as well.

    Examples
    --------
    >>> print(escaped_markdown("<script> a|b *c*"))
    &lt;script&gt; a\|b \*c\*
    """
    text = visible(" ".join(str(value).split())).replace("&", "&amp;")
    text = text.replace("<", "&lt;").replace(">", "&gt;")
    # Within a word an underscore means nothing.
    return re.sub(r"([\\`*\[\]|~$]|(?<![^\W_])_|_(?![^\W_]))", r"\\\1", text)
