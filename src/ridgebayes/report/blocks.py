"""What a report is made of: sections of paragraphs, tables, figures. The templates only lay out."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from ridgebayes.comparison.comparison import Comparison


@dataclass(frozen=True)
class Text:
    """A paragraph of plain text; `tone` is ``plain``, ``note`` or ``warning``."""

    words: str
    tone: str = "plain"
    kind: ClassVar[str] = "text"


@dataclass(frozen=True)
class Table:
    """A table of finished strings.

    `numeric` are the columns to align to the right, `strong` the rows to set off, `badge` a column
    whose words are to stand out; `wide` takes the whole page.
    """

    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    caption: str = ""
    numeric: frozenset[int] = frozenset()
    strong: frozenset[int] = frozenset()
    badge: int | None = None
    wide: bool = False
    kind: ClassVar[str] = "table"


@dataclass(frozen=True)
class Picture:
    """A figure by its name in a comparison's gallery, with what it shows.

    Drawn when laid out, so that a report without figures costs none.
    """

    owner: Comparison
    name: str
    caption: str
    narrow: bool = False
    kind: ClassVar[str] = "picture"


@dataclass(frozen=True)
class Section:
    """A titled part of the report, its blocks in reading order."""

    title: str
    anchor: str
    blocks: tuple["Text | Table | Picture", ...]


def table(
    header: Sequence[str],
    rows: Sequence[Sequence[str]],
    caption: str = "",
    *,
    text: Sequence[int] = (0,),
    strong: Sequence[int] = (),
    badge: int | None = None,
    wide: bool = False,
) -> Table:
    """Return a table whose columns are numbers except those in `text`."""
    return Table(
        tuple(header),
        tuple(tuple(row) for row in rows),
        caption,
        frozenset(range(len(header))) - frozenset(text),
        frozenset(strong),
        badge,
        wide,
    )
