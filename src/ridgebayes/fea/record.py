"""What importers hand on: a table, and what they understood of the file."""

import hashlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from ridgebayes.errors import InputError
from ridgebayes.runtime.reading import read_bytes
from ridgebayes.runtime.text import one_line_message
from ridgebayes.table.table import ContactTable

HUGE = 1e100  # of lengths and loads: no body's are so great, and products of a few are floats yet


@dataclass(frozen=True, eq=False)
class Imported:
    """A file that was understood.

    Parameters
    ----------
    table : ContactTable
        Its rows.
    messages : tuple of str
        What was understood, a line each: columns, units, textures, rows kept, what was ignored and
        why.
    known : mapping of str to str
        Columns of a table file by key, as ``--map`` would name them.
    """

    table: ContactTable
    messages: tuple[str, ...]
    known: Mapping[str, str] = field(default_factory=dict)


def provenance(path: Path, importer: str, *details: str) -> str:
    """Return where rows come from: importer, file, the beginning of its SHA-256, details."""
    digest = hashlib.sha256(read_bytes(path)).hexdigest()[:16]
    return " ".join([f"import {importer}:", path.name, f"sha256={digest}", *details])


@contextmanager
def refusing(
    where: str, *kinds: type[Exception], rule: str = "", most: int = 120
) -> Iterator[None]:
    """Refuse what a library cannot read, in the library's words.

    Parameters
    ----------
    where : str
        What messages begin with.
    *kinds : type of Exception
        What the library raises; none for any: some let out exceptions of many kinds.
    rule : str, optional
        What messages end with.
    most : int, optional
        Characters of the library's words.
    """
    try:
        yield
    except InputError:
        raise
    except Exception as error:
        if kinds and not isinstance(error, kinds):
            raise
        raise InputError(f"{where}: {one_line_message(error, most)}{rule}") from None
