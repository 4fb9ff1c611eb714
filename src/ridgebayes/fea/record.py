"""What importers hand on: a table, and what they understood of the file."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from ridgebayes.runtime.reading import read_bytes
from ridgebayes.table.table import ContactTable

FARTHEST = 4.0  # of R: where a body may come to lie
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
