"""Blocks of a report: paragraphs, tables, figures and sections, which the templates lay out."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import pandas as pd

MOST_ROWS = 40  # rows shown of a table; the run folder's CSV files hold all rows


class Block:
    """Base class of the parts of a section."""

    @property
    def kind(self) -> str:
        """Name of the class, by which a template chooses the layout."""
        return type(self).__name__


@dataclass(frozen=True)
class Text(Block):
    """A paragraph of plain text; `tone` is ``plain``, ``note``, ``strong`` or ``warning``."""

    words: str
    tone: str = "plain"


@dataclass(frozen=True)
class Table(Block):
    """A table of strings.

    `text` lists the columns that are not numbers, and `strong` the rows to set in bold. `badge` is
    a column whose words are shown as badges.
    """

    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    caption: str = ""
    text: Sequence[int] = (0,)
    strong: Sequence[int] = ()
    badge: int | None = None

    @classmethod
    def of(
        cls,
        records: pd.DataFrame | Iterable[Any],
        columns: Mapping[str, Callable[[Any], str]],
        caption: str = "",
        **look: Any,
    ) -> "Table":
        """Return a table with a row for each record, such as the rows of a data frame.

        The function of each column returns the cell of a record.
        """
        if isinstance(records, pd.DataFrame):
            records = records.to_dict("records")
        rows = [[cell(record) for cell in columns.values()] for record in records]
        return cls([*columns], rows, caption, **look)


@dataclass(frozen=True)
class Picture(Block):
    """A figure and its caption.

    `name` is a key of the comparison's gallery, or of the reference's. `alt` describes the figure
    to readers who cannot see it; if it is empty, the caption does.
    """

    name: str
    caption: str
    alt: str = ""
    narrow: bool = False
    of_reference: bool = False


@dataclass(frozen=True)
class Folded(Block):
    """Details that open on demand; `short` details are also printed on paper."""

    title: str
    blocks: Sequence[Block]
    short: bool = False


@dataclass(frozen=True)
class Odds(Block):
    """Input fields for the reader's prior probabilities; a script computes the posterior ones.

    Each row holds the name of a form, its ln evidence and its prior probability in the run.
    """

    rows: Sequence[tuple[str, float, float]]


@dataclass(frozen=True)
class TextureFields(Block):
    """Input fields for the reader's texture and load; a script predicts Q and loads.

    `table` is JSON, see `ridgebayes.comparison.own_texture`. The other attributes are the initial
    values: radius in mm, modulus in kPa, widths in um, load in kPa.
    """

    table: str
    ridge: str
    groove: str
    load: str
    radius: str
    modulus: str


@dataclass(frozen=True)
class Heading(Block):
    """A heading inside a section."""

    words: str


@dataclass(frozen=True)
class Section:
    """A titled part of the report with its blocks in reading order."""

    title: str
    anchor: str
    blocks: Sequence[Block]
