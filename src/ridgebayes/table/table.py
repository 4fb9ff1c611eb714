"""`ContactTable`: validated loads at which ridges were reached."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
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

if TYPE_CHECKING:  # slow to import
    from matplotlib.axes import Axes

_LOAD_KEY = ("a_over_R", "b_over_R", "nu", "offset_over_R", "Q", "kind", "p_over_E_lower")
_MIN_ROWS_COPY = 3  # rows of a curve that counts as a copy of another


@dataclass(frozen=True, eq=False, repr=False)
class ValidatedTable(Tabular):
    """Table of rows that satisfy the rules of its columns.

    Parameters
    ----------
    where : str, optional
        File or name for messages.
    """

    _frame: pd.DataFrame
    where: str = "table"
    contract: ClassVar[Sequence[Column]]

    @property
    def frame(self) -> pd.DataFrame:
        """A copy of the rows: contract columns in their order, all filled, then other columns."""
        return self._frame.copy()

    def to_dataframe(self) -> pd.DataFrame:
        """Return a copy of the rows; see `frame`.

        Returns
        -------
        pandas.DataFrame, shape (n_row, n_column)
            Contract columns in their order, all filled in, then other columns.
        """
        return self.frame

    def _first_rows(self, n: int) -> pd.DataFrame:
        return self._frame.head(n)

    def __len__(self) -> int:
        return len(self._frame)

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write the table atomically; optional columns that hold only defaults are left out.

        Parameters
        ----------
        path : str or path
            Path ending in ``.csv`` or ``.parquet``; an existing file is overwritten. CSV has no
            types: text in other columns that looks like numbers is read back as numbers.

        Raises
        ------
        InputError
            If the suffix is unknown, the folder does not exist, or pyarrow is missing.
        OutputError
            If the file cannot be written, for instance because the disk is full.
        """
        optional = [c for c in self.contract if c.default is not None and not c.always_written]
        silent = [c.name for c in optional if self._frame[c.name].isin([c.default]).all()]
        write_frame(self._frame.drop(columns=silent), Path(path))

    def digest(self) -> str:
        """Return the SHA-256 of the content, which is equal for equal rows in equal order.

        Returns
        -------
        str
            64 hexadecimal digits, independent of the file format, the order of columns, and whether
            defaults are written.
        """
        return frame_digest(self._frame, self.contract)


@dataclass(frozen=True, eq=False, repr=False)
class ContactTable(ValidatedTable):
    """Validated rows of the contact table.

    Rows are validated however a table is made: `ContactTable.from_frame`, `read_table`, or from a
    DataFrame. Additional columns follow the contract's columns:

    ================== ============================================================================
    a_over_R, b_over_R ridge and groove width over the radius: finite, > 0
    Q                  proximal edges in contact: an even integer (odd only off centre), >= 4 for a
                       transition, >= 2 for a count
    p_over_E           load at which Q was reached (transition) or seen (count): finite, > 0;
                       may be empty only if `status` is not ``ok``
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
        File or name for messages.

    Notes
    -----
    A curve is the ``ok`` transitions of one texture, nu, offset, source, solver and series. Its
    loads rise strictly with Q, and each Q occurs once.

    A texture is its (a_over_R, b_over_R). A label must not name two textures, because results are
    named by label. A texture may have two labels (two samples of one geometry); results are named
    by the first, see `labels`.

    Examples
    --------
    >>> import pandas as pd
    >>> rows = {"a_over_R": 0.032, "b_over_R": 0.01, "Q": [4, 6], "p_over_E": [0.00098, 0.0038]}
    >>> table = ContactTable.from_frame(pd.DataFrame(rows))
    >>> len(table), table.textures, table.labels
    (2, ((0.032, 0.01),), ('a0.032_b0.01',))
    >>> table.column("Q").tolist(), table.plot().get_xlabel()
    ([4, 6], 'load $p/E$')

    Fitted rows, held-out rows, both, failed rows and repeated rows:

    >>> import ridgebayes as rb
    >>> sweep = rb.paper_sweep()
    >>> len(sweep.calibration), len(sweep.held_out), len(sweep.ok)
    (41, 3, 44)
    >>> len(sweep.left_out), len(sweep.repeated)
    (0, 0)
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     sweep.write(f"{folder}/sweep.csv")
    ...     again = rb.read_table(f"{folder}/sweep.csv")
    >>> again.digest() == sweep.digest(), again.to_dataframe().equals(sweep.frame)
    (True, True)
    """

    contract: ClassVar[Sequence[Column]] = COLUMNS
    _is_valid: bool = False

    def __post_init__(self) -> None:
        if self._is_valid:
            return
        if not isinstance(self._frame, pd.DataFrame):
            kind = type(self._frame).__name__
            raise InputError(f"{self.where}: expected a pandas.DataFrame, got {kind}")
        frame = validated(RawTable(self._frame.copy(), self.where), checked)
        object.__setattr__(self, "_frame", frame)

    @classmethod
    def from_frame(cls, frame: pd.DataFrame, *, where: str = "table") -> "ContactTable":
        """Validate a DataFrame.

        Parameters
        ----------
        frame : pandas.DataFrame, shape (n_row, n_column)
            Columns of the contract in any order; the index is ignored. NaN, None and empty text are
            empty cells.
        where : str, optional
            Name for messages.

        Returns
        -------
        ContactTable
            Table with a copy of the rows.

        Raises
        ------
        InputError
            If `frame` is not a DataFrame, or a rule is violated. One message lists the invalid
            cells with row (from 1), column, value and rule; it shows twenty and counts the rest.
        """
        return cls(frame, where)

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw Q against load as steps, one curve per texture, for rows with status ``ok``.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Axes to draw on; those of a new figure if not given.

        Returns
        -------
        matplotlib.axes.Axes
            Axes drawn on.
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
            Name of a column of the contract, or of an additional column.

        Returns
        -------
        numpy.ndarray, shape (n_row,), in the unit of the column
            Read-only numbers, or text as objects.

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
    def ok(self) -> "ContactTable":
        """Rows whose status is ok: those to fit and those held out."""
        return self._where(self._ok)

    @property
    def calibration(self) -> "ContactTable":
        """Rows to fit: status ok and role calibration. The table may be empty."""
        return self._where(self._ok & (self._frame["role"] == CALIBRATION).to_numpy())

    @property
    def held_out(self) -> "ContactTable":
        """Rows to predict and compare but not to fit: status ok and role held-out."""
        return self._where(self._ok & (self._frame["role"] == HELD_OUT).to_numpy())

    @property
    def left_out(self) -> "ContactTable":
        """Rows whose status is not ok, which are not used."""
        return self._where(~self._ok)

    @property
    def repeated(self) -> "ContactTable":
        """Rows to fit of curves whose loads all occur in another curve, with all digits equal.

        They are fitted like other rows, so a load measured once may count twice. Curves of fewer
        than three rows are not reported: repeats read to two digits may agree by chance.
        """
        rows, frame = self.calibration, self.calibration._frame
        codes = pd.DataFrame(
            {
                name: frame.groupby(list(keys), sort=False, dropna=False).ngroup()
                for name, keys in (("curve", CURVE), ("load", (*_LOAD_KEY, "p_over_E")))
            }
        )
        shared = codes[codes.duplicated("load", keep=False)]
        pairs = shared.merge(shared, on="load").query("curve_x != curve_y")
        pairs_of_curves = pairs.groupby(["curve_x", "curve_y"]).size().rename("n").reset_index()
        size = codes["curve"].value_counts()
        other, later = (pairs_of_curves[name].map(size) for name in ("curve_x", "curve_y"))
        # The later of two equal curves is the copy; else the curve contained in the other.
        is_copy = (later < other) | (pairs_of_curves["curve_x"] < pairs_of_curves["curve_y"])
        whole = pairs_of_curves.loc[
            (pairs_of_curves["n"] == later) & (later >= _MIN_ROWS_COPY) & is_copy, "curve_y"
        ]
        return rows._where(codes["curve"].isin(whole).to_numpy())

    @property
    def _ok(self) -> np.ndarray:
        return (self._frame["status"] == OK).to_numpy(dtype=bool)

    def _where(self, keep: np.ndarray) -> "ContactTable":
        return replace(self, _frame=self._frame[keep].reset_index(drop=True), _is_valid=True)

    @property
    def textures(self) -> tuple[tuple[float, float], ...]:
        """Distinct (a_over_R, b_over_R) in order of first appearance."""
        pairs = self._frame[["a_over_R", "b_over_R"]].drop_duplicates()
        return tuple((float(a), float(b)) for a, b in pairs.to_numpy())

    @property
    def labels(self) -> tuple[str, ...]:
        """Label of each of `textures`: its first label in the table."""
        kept = self._frame.drop_duplicates(["a_over_R", "b_over_R"])["texture"]
        return tuple(str(label) for label in kept)


def read_table(source: ContactTable | pd.DataFrame | str | os.PathLike[str]) -> ContactTable:
    """Read and validate a contact table.

    Parameters
    ----------
    source : str, path, pandas.DataFrame or ContactTable
        A ``.csv`` file (UTF-8, commas, one header line), a ``.parquet`` file, or the rows. See
        `ContactTable` for the columns. A ContactTable is returned unchanged.

    Returns
    -------
    ContactTable
        Validated table with defaults filled in; no row is dropped or repaired.

    Raises
    ------
    InputError
        If the source is of another type, the file cannot be read, or a rule is violated. The
        message gives file, row, column, value and rule of each invalid cell; it shows twenty and
        counts the rest.

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
    return ContactTable(validated(raw, checked), raw.where, _is_valid=True)
