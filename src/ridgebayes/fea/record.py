"""The result of an import: a table, and messages about the file."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ridgebayes.contact.hertz import load_of_half_width
from ridgebayes.runtime.reading import read_bytes
from ridgebayes.runtime.text import count, some_of
from ridgebayes.table.columns import CURVE, OK, TRANSITION
from ridgebayes.table.table import ContactTable

FIRST = 4  # Q of the first load that a run can tell
_UNSURE = 0.2  # rel_se
_FAR = 5.0  # of the smooth body's load: textured ones are lower
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
        Messages about the reading, a line each: columns, units, textures, rows kept, and parts
        ignored, with the reason.
    known : mapping of str to str
        Columns of a table file by key, as ``--map`` would name them.
    """

    table: ContactTable
    messages: tuple[str, ...]
    known: Mapping[str, str] = field(default_factory=dict)

    @property
    def cautions(self) -> list[str]:
        """Warnings of doubtful rows that break no rule of the table.

        An error above a fifth of the load, a curve that begins above Q = 4, and a load over five
        times that at which a smooth body reaches the same corner.
        """
        frame = self.table.frame
        transition = frame[(frame["kind"] == TRANSITION) & (frame["status"] == OK)]
        first = transition.loc[transition.groupby(list(CURVE), sort=False)["Q"].idxmin()]
        corner = frame["b_over_R"] / 2 + (frame["Q"] / 2 - 1) * (
            frame["a_over_R"] + frame["b_over_R"]
        )
        smooth = load_of_half_width(corner, nu=frame["nu"])
        far = f"p/E is over {_FAR:g} times that of a smooth body whose contact reaches this corner"
        found = {
            f"{far}; check the units of loads, widths, R and E": frame[
                frame["p_over_E"] > _FAR * smooth
            ],
            f"rel_se is above {_UNSURE:g}: the load is hardly known": frame[
                frame["rel_se"] > _UNSURE
            ],
            "a curve begins here; loads of lower Q are missing": first[first["Q"] > FIRST],
        }
        return [
            f"{count(len(rows), 'row')}, {some_of(map(_shown, rows.itertuples()), 3)}: {what}"
            for what, rows in found.items()
            if len(rows)
        ]


def _shown(row: Any) -> str:
    return f"{row.texture} Q = {row.Q:g} p/E = {row.p_over_E:.5g}"


def provenance(path: Path, importer: str, *details: str) -> str:
    """Return where rows come from: importer, file, the beginning of its SHA-256, details."""
    digest = hashlib.sha256(read_bytes(path)).hexdigest()[:16]
    return " ".join([f"import {importer}:", path.name, f"sha256={digest}", *details])
