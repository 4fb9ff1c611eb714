"""`ContactTable`: the loads at which ridges were reached, validated once, at the door."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pandas as pd

from ridgebayes import drawing
from ridgebayes._types import Tabular
from ridgebayes.errors import InputError
from ridgebayes.runtime.text import count
from ridgebayes.table.columns import CALIBRATION, COLUMNS, CURVE, HELD_OUT, OK, Column, RawTable
from ridgebayes.table.files import frame_digest, raw_cells, write_frame
from ridgebayes.table.rules import checked, validated

if TYPE_CHECKING:  # heavy
    from matplotlib.axes import Axes

_SAME_LOAD = ("a_over_R", "b_over_R", "nu", "offset_over_R", "Q", "kind", "p_over_E_lower")
_LEAST_CURVE = 3  # rows of a curve, for it to count as a copy


@dataclass(frozen=True, eq=False, repr=False)
class ValidatedTable(Tabular):
    """Rows that keep the rules of a contract of columns.

    Parameters
    ----------
    where : str, optional
        File or name that messages show.
    """

    _frame: pd.DataFrame
    where: str = "table"
    contract: ClassVar[Sequence[Column]]

    @property
    def frame(self) -> pd.DataFrame:
        """A copy of the rows: contract columns in their order, all filled, then the user's own."""
        return self._frame.copy()

    def to_dataframe(self) -> pd.DataFrame:
        """Return a copy of the rows, as `frame`.

        Returns
        -------
        pandas.DataFrame, shape (n_row, n_column)
            Contract columns in their order, all filled, then the user's own.
        """
        return self.frame

    def _first_rows(self, n: int) -> pd.DataFrame:
        return self._frame.head(n)

    def __len__(self) -> int:
        return len(self._frame)

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write the whole table or nothing; optional columns without content are left out.

        Parameters
        ----------
        path : str or path
            Ends in ``.csv`` or ``.parquet``; an existing file is replaced. CSV has no types: text
            of the user's own columns that looks like numbers comes back as numbers.

        Raises
        ------
        InputError
            If the suffix is unknown, the folder does not exist, or pyarrow is missing.
        OutputError
            If the file cannot be written, such as on a full disk.
        """
        optional = [c for c in self.contract if c.default is not None and not c.always_written]
        silent = [c.name for c in optional if self._frame[c.name].isin([c.default]).all()]
        write_frame(self._frame.drop(columns=silent), Path(path))

    def digest(self) -> str:
        """Return the SHA-256 of the content: equal for equal rows in equal order.

        Returns
        -------
        str
            64 hexadecimal digits, whatever the file format, the order of columns, and whether
            defaults were written or left out.
        """
        return frame_digest(self._frame, self.contract)


@dataclass(frozen=True, eq=False, repr=False)
class ContactTable(ValidatedTable):
    """Validated rows of the contact table.

    `ContactTable.from_frame` and `read_table` make it. Your own columns follow those of the
    contract:

    ================== ============================================================================
    a_over_R, b_over_R ridge and groove width over the radius: finite, > 0
    Q                  proximal edges in contact: an even integer (odd only off centre), >= 4 for a
                       transition, >= 2 for a count
    p_over_E           load at which that Q was reached (transition) or seen (count): finite, > 0;
                       may be empty only where `status` is not ``ok``
    p_over_E_lower     optional: last load at which Q was not yet reached: 0 <= lower <= p_over_E
    rel_se             optional: known relative standard error of the load, independent from row to
                       row: >= 0; default 0
    kind               optional: ``transition`` (default) or ``count``
    nu                 optional: Poisson's ratio: 0 to 0.5; default 0.5
    offset_over_R      optional: lateral offset of the body from the groove's centre; default 0
    texture            optional: label; default ``a<A>_b<B>`` from the shortest exact decimals
    series             optional: laboratory, rig, mesh or repeat that made the row
    role               optional: ``calibration`` (default) or ``held-out``
    solver, source     optional: who computed the row, and where it came from
    status             optional: ``ok`` (default), or what failed; only ``ok`` rows are fitted
    ================== ============================================================================

    Parameters
    ----------
    where : str, optional
        File or name that messages show.

    Notes
    -----
    A curve is the ``ok`` transitions of one texture, nu, offset, source, solver and series. Its
    loads rise strictly with Q, and each Q occurs once.

    A texture is its (a_over_R, b_over_R). One label on two textures is refused, because results
    are named by label. One texture under two labels is accepted (two samples of one geometry):
    results are named by the first of them, see `labels`.

    Examples
    --------
    >>> import pandas as pd
    >>> rows = {"a_over_R": 0.032, "b_over_R": 0.01, "Q": [4, 6], "p_over_E": [0.00098, 0.0038]}
    >>> table = ContactTable.from_frame(pd.DataFrame(rows))
    >>> len(table), table.textures, table.labels
    (2, ((0.032, 0.01),), ('a0.032_b0.01',))
    >>> table.column("Q").tolist(), table.plot().get_xlabel()
    ([4, 6], 'load $p/E$')

    Fitted rows, held-out rows, failed rows and repeated rows:

    >>> import ridgebayes as rb
    >>> sweep = rb.paper_sweep()
    >>> len(sweep.calibration), len(sweep.held_out), len(sweep.left_out), len(sweep.repeated)
    (41, 3, 0, 0)
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     sweep.write(f"{folder}/sweep.csv")
    ...     again = rb.read_table(f"{folder}/sweep.csv")
    >>> again.digest() == sweep.digest(), again.to_dataframe().equals(sweep.frame)
    (True, True)
    """

    contract: ClassVar[Sequence[Column]] = COLUMNS

    @classmethod
    def from_frame(cls, frame: pd.DataFrame, *, where: str = "table") -> "ContactTable":
        """Validate a DataFrame.

        Parameters
        ----------
        frame : pandas.DataFrame, shape (n_row, n_column)
            Columns of the contract in any order; the index is ignored. NaN, None and empty text are
            empty cells.
        where : str, optional
            Name that messages show.

        Returns
        -------
        ContactTable
            A copy: later changes of `frame` do not reach it.

        Raises
        ------
        InputError
            If `frame` is no DataFrame, or a rule is broken: one message that lists every bad cell
            with row (from 1), column, value and rule, the first twenty shown and the rest counted.
        """
        if not isinstance(frame, pd.DataFrame):
            kind = type(frame).__name__
            raise InputError(f"{where}: expected a pandas.DataFrame, got {kind}")
        return cls(validated(RawTable(frame.copy(), where), checked), where)

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw Q against load as steps, one curve per texture, without rows that are not ``ok``.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure's if not given.

        Returns
        -------
        matplotlib.axes.Axes
            The axes drawn on.
        """
        ok = self._frame[self._ok]
        if ok.empty:
            raise InputError(f"{self.where}: expected a row with status ok to plot, got none")
        varying = [name for name in CURVE[2:] if len(ok[name].unique()) > 1]
        by_curve, curves = ok.groupby(list(CURVE), sort=False, dropna=False), {}
        for _, rows in islice(by_curve, drawing.MOST_TEXTURES):
            rise = rows.sort_values("p_over_E")
            varied = [f"{name} {rise[name].iloc[0]}" for name in varying]
            label = ", ".join([str(rise["texture"].iloc[0]), *varied])
            curves[label] = (rise["p_over_E"].to_numpy(), rise["Q"].to_numpy())
        return drawing.records.draw_curves(curves, by_curve.ngroups, ax)

    def column(self, name: str) -> np.ndarray:
        """Return one column without a copy, which is cheaper than `frame`.

        Parameters
        ----------
        name : str
            Name of a column of the contract, or of a column of the user's own.

        Returns
        -------
        numpy.ndarray, shape (n_row,), in the unit of the column
            Read-only: numbers, or text as objects.

        Raises
        ------
        KeyError
            If the table has no such column.
        """
        values = np.asarray(self._frame[name]).view()
        values.flags.writeable = False
        return values

    def __repr__(self) -> str:
        size = f"{count(len(self), 'row')}, {count(len(self.textures), 'texture')}"
        return f"ContactTable({self.where}: {size})"

    @property
    def calibration(self) -> "ContactTable":
        """The rows to fit: status ok, role calibration. May be empty."""
        return self._where(self._ok & (self._frame["role"] == CALIBRATION).to_numpy())

    @property
    def held_out(self) -> "ContactTable":
        """The rows to predict and compare, never to fit: status ok, role held-out."""
        return self._where(self._ok & (self._frame["role"] == HELD_OUT).to_numpy())

    @property
    def left_out(self) -> "ContactTable":
        """The rows whose status is not ok; messages count them."""
        return self._where(~self._ok)

    @property
    def repeated(self) -> "ContactTable":
        """The rows to fit of curves whose loads are all those of another curve, to all digits.

        They are fitted like any other, so what was measured once counts twice. Curves of fewer than
        three rows are not told: repeats that are read to two digits have loads in common by chance.
        """
        rows, frame = self.calibration, self.calibration._frame
        codes = pd.DataFrame(
            {
                name: frame.groupby(list(keys), sort=False, dropna=False).ngroup()
                for name, keys in (("curve", CURVE), ("load", (*_SAME_LOAD, "p_over_E")))
            }
        )
        shared = codes[codes.duplicated("load", keep=False)]
        pairs = shared.merge(shared, on="load").query("curve_x != curve_y")
        pairs_of_curves = pairs.groupby(["curve_x", "curve_y"]).size().rename("n").reset_index()
        size = codes["curve"].value_counts()
        other, later = (pairs_of_curves[name].map(size) for name in ("curve_x", "curve_y"))
        # The later one of two equal curves; else the curve that lies within the other.
        is_copy = (later < other) | (pairs_of_curves["curve_x"] < pairs_of_curves["curve_y"])
        whole = pairs_of_curves.loc[
            (pairs_of_curves["n"] == later) & (later >= _LEAST_CURVE) & is_copy, "curve_y"
        ]
        return rows._where(codes["curve"].isin(whole).to_numpy())

    @property
    def _ok(self) -> np.ndarray:
        return (self._frame["status"] == OK).to_numpy(dtype=bool)

    def _where(self, keep: np.ndarray) -> "ContactTable":
        return ContactTable(self._frame[keep].reset_index(drop=True), self.where)

    @property
    def textures(self) -> tuple[tuple[float, float], ...]:
        """The distinct (a_over_R, b_over_R), in order of first appearance."""
        pairs = self._frame[["a_over_R", "b_over_R"]].drop_duplicates()
        return tuple((float(a), float(b)) for a, b in pairs.to_numpy())

    @property
    def labels(self) -> tuple[str, ...]:
        """The label of each of `textures`: the first it has in the table."""
        kept = self._frame.drop_duplicates(["a_over_R", "b_over_R"])["texture"]
        return tuple(str(label) for label in kept)


def read_table(source: ContactTable | pd.DataFrame | str | os.PathLike[str]) -> ContactTable:
    """Read and validate a contact table.

    Parameters
    ----------
    source : str, path, pandas.DataFrame or ContactTable
        A ``.csv`` file (UTF-8, commas, one header line), a ``.parquet`` file, or the rows
        themselves. `ContactTable` describes the columns; one is returned as it is.

    Returns
    -------
    ContactTable
        The validated table; defaults are filled in, and nothing is dropped or repaired.

    Raises
    ------
    InputError
        If the source is none of these, the file cannot be read, or a rule is broken; the message
        names file, row, column, value and rule of every bad cell (the first twenty shown, the rest
        counted).

    Examples
    --------
    >>> rows = {"a_over_R": 0.032, "b_over_R": 0.01, "Q": [4, 6], "p_over_E": [0.0038, 0.00098]}
    >>> read_table(pd.DataFrame(rows))
    Traceback (most recent call last):
        ...
    ridgebayes.errors.InputError: table: 1 value in 1 row breaks the rules of the table
      table, row 2: p_over_E = 0.00098: must rise with Q along a curve: row 1 has a lower Q
    """
    if isinstance(source, ContactTable):
        return source
    raw = raw_cells(source, "table", "ContactTable")
    return ContactTable(validated(raw, checked), raw.where)
