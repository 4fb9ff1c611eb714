"""Blocks of a report: sections of paragraphs, tables, figures. The templates only lay them out."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, TypeAlias

import pandas as pd

MOST_ROWS = 40  # of one table; the run folder's CSV files hold them all


@dataclass(frozen=True)
class Text:
    """A paragraph of plain text; `tone` is ``plain``, ``note``, ``strong`` or ``warning``."""

    words: str
    tone: str = "plain"
    kind: ClassVar[str] = "text"


@dataclass(frozen=True)
class Table:
    """A table of finished strings.

    `text` are the columns that are not numbers, `strong` the rows to set off, `badge` a column
    whose words are to stand out.
    """

    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    caption: str = ""
    text: Sequence[int] = (0,)
    strong: Sequence[int] = ()
    badge: int | None = None
    kind: ClassVar[str] = "table"

    @classmethod
    def of(
        cls,
        records: pd.DataFrame | Iterable[Any],
        columns: Mapping[str, Callable[[Any], str]],
        caption: str = "",
        **look: Any,
    ) -> "Table":
        """Return a table with a row for each record, a frame's row or another.

        A column's function makes a record's cell.
        """
        if isinstance(records, pd.DataFrame):
            records = records.to_dict("records")
        rows = [[cell(record) for cell in columns.values()] for record in records]
        return cls([*columns], rows, caption, **look)


@dataclass(frozen=True)
class Picture:
    """A figure by its name in the gallery of the comparison, or of the reference, and a caption.

    `alt` tells the finding to those who do not see the figure; the caption does where it is empty.
    """

    name: str
    caption: str
    alt: str = ""
    narrow: bool = False
    of_reference: bool = False
    kind: ClassVar[str] = "picture"


@dataclass(frozen=True)
class Folded:
    """Details that open on demand; `short` ones are on paper, too."""

    title: str
    blocks: Sequence["Block"]
    short: bool = False
    kind: ClassVar[str] = "folded"


@dataclass(frozen=True)
class Odds:
    """Fields for a reader's own prior probabilities, which a script turns into posterior ones.

    A row has a form's name, its ln evidence and its prior probability in the run.
    """

    rows: Sequence[tuple[str, float, float]]
    kind: ClassVar[str] = "odds"


@dataclass(frozen=True)
class TextureFields:
    """Fields for a reader's own texture and load, which a script predicts Q and loads for.

    `table` is JSON, see `ridgebayes.comparison.own_texture`; the rest is what the fields hold
    first: radius in mm, modulus in kPa, widths in um, load in kPa.
    """

    table: str
    ridge: str
    groove: str
    load: str
    radius: str
    modulus: str
    kind: ClassVar[str] = "texture"


@dataclass(frozen=True)
class Heading:
    """A heading inside a section."""

    words: str
    kind: ClassVar[str] = "part"


Block: TypeAlias = Text | Table | Picture | Folded | Odds | TextureFields | Heading


@dataclass(frozen=True)
class Section:
    """A titled part of the report, its blocks in reading order; left out where it has none."""

    title: str
    anchor: str
    blocks: Sequence[Block]
