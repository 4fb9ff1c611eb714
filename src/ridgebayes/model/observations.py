"""The fitted rows of a table, as arrays."""

import hashlib
from dataclasses import dataclass, field

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from ridgebayes._types import BoolArray, FloatArray, IntArray
from ridgebayes.contact.scaling import Texture, reduced_load
from ridgebayes.errors import InputError
from ridgebayes.model.forms import Form
from ridgebayes.table.table import ContactTable


@dataclass(frozen=True, eq=False)
class Observations:
    """Rows of three kinds: exact loads, brackets, and counts observed at a load.

    Parameters
    ----------
    textures : tuple of (float, float), length n_texture
        (a/R, b/R) in order of first appearance.
    texture : ndarray of int, shape (n_obs,)
        Index of each row's texture.
    Q : ndarray of int, shape (n_obs,)
        Count reached at the load, or observed at it.
    log_load : ndarray of float, shape (n_obs,), dimensionless
        log of the load p/E reduced to nu = 0.5; the upper end of a bracket.
    rel_se : ndarray of float, shape (n_obs,), dimensionless
        Known relative standard error of the load.
    log_lower : ndarray of float, shape (n_obs,), dimensionless
        log of the last load at which Q was not yet reached, -inf if this load is 0; NaN in rows
        without a bracket.
    is_count : ndarray of bool, shape (n_obs,)
        True if Q was observed at the load, False if the load is the transition to Q.
    labels : tuple of str, length n_texture
        Names of the textures.
    series : ndarray of int, shape (n_obs,), optional
        Index of each row's series; one series if not given.
    series_labels : tuple of str, length n_series, optional
        Names of the series. `take` keeps all names, including those of series without rows.
    a_over_R, b_over_R : ndarray of float, shape (n_texture,), dimensionless
        Ridge and groove widths of the textures.
    """

    textures: tuple[Texture, ...]
    texture: IntArray
    Q: IntArray
    log_load: FloatArray
    rel_se: FloatArray
    log_lower: FloatArray
    is_count: BoolArray
    labels: tuple[str, ...] = ()
    series: IntArray = field(default_factory=lambda: np.zeros(0, np.int64))
    series_labels: tuple[str, ...] = ("",)
    a_over_R: FloatArray = field(init=False, repr=False)
    b_over_R: FloatArray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        a, b = np.array(self.textures, dtype=float).reshape(-1, 2).T.copy()
        object.__setattr__(self, "a_over_R", a)
        object.__setattr__(self, "b_over_R", b)
        if not len(self.series):
            object.__setattr__(self, "series", np.zeros(len(self.log_load), np.int64))

    @classmethod
    def from_table(cls, table: ContactTable) -> "Observations":
        """Return the calibration rows of a table.

        Raises
        ------
        InputError
            If the table has no calibration row, or if a row's body is laterally offset.
        """
        rows = table.calibration
        frame = rows.frame
        if frame.empty:
            raise InputError(
                f"{table.where}: expected a row with role calibration and status ok, got none"
            )
        _refuse_offsets(table)
        widths = frame[["a_over_R", "b_over_R"]].to_numpy()
        codes, textures = pd.factorize(pd.MultiIndex.from_arrays([widths[:, 0], widths[:, 1]]))
        nu = frame["nu"].to_numpy()
        # Sources, for example file names, define the series only if no row has a series label.
        by = "series" if (frame["series"] != "").any() else "source"
        series, series_labels = pd.factorize(frame[by])
        with np.errstate(divide="ignore"):  # a lower end of 0 is minus infinity
            log_lower = np.log(reduced_load(frame["p_over_E_lower"].to_numpy(float), nu))
        return cls(
            textures=tuple((float(a), float(b)) for a, b in textures),
            texture=codes.astype(np.int64),
            Q=frame["Q"].to_numpy(np.int64),
            log_load=np.log(reduced_load(frame["p_over_E"].to_numpy(), nu)),
            rel_se=frame["rel_se"].to_numpy(float),
            log_lower=log_lower,
            is_count=(frame["kind"] == "count").to_numpy(),
            labels=rows.labels,
            series=series.astype(np.int64),
            series_labels=tuple(str(label) for label in series_labels),
        )

    def __len__(self) -> int:
        return len(self.log_load)

    @property
    def n_series(self) -> int:
        """Number of series of the table, or of its sources if no row has a series label."""
        return len(self.series_labels)

    @property
    def one_series_per_texture(self) -> bool:
        """Whether there are several series, and every texture has rows of one series only."""
        return self.n_series > 1 and self._n_pair == len(self.textures)

    @property
    def one_texture_per_series(self) -> bool:
        """Whether there are several series, and every series has rows of one texture only."""
        return self.n_series > 1 and self._n_pair == self.n_series

    @property
    def _n_pair(self) -> int:
        return len(set(zip(self.texture.tolist(), self.series.tolist(), strict=True)))

    @property
    def is_exact(self) -> BoolArray:
        """Mask of rows with an exact load: no count, and no bracket or one of zero width."""
        value: BoolArray = ~self.is_count & (
            np.isnan(self.log_lower) | (self.log_lower == self.log_load)
        )
        return value

    def digest(self) -> str:
        """Return the SHA-256 of textures, counts and loads of the rows."""
        rows = np.stack([self.a_over_R[self.texture], self.Q, self.log_load])
        return hashlib.sha256(rows.tobytes()).hexdigest()

    def take(self, rows: BoolArray) -> "Observations":
        """Return selected rows, with only the textures that occur in them."""
        kept, codes = np.unique(self.texture[rows], return_inverse=True)
        return Observations(
            textures=tuple(self.textures[j] for j in kept),
            texture=codes.astype(np.int64),
            Q=self.Q[rows],
            log_load=self.log_load[rows],
            rel_se=self.rel_se[rows],
            log_lower=self.log_lower[rows],
            is_count=self.is_count[rows],
            labels=tuple(self.labels[j] for j in kept) if self.labels else (),
            series=self.series[rows],
            series_labels=self.series_labels,
        )


def nearest_load(predicted: ArrayLike, load: ArrayLike, lower: ArrayLike) -> FloatArray:
    """Return what a row observed, as near to a prediction as its bracket allows.

    Parameters
    ----------
    predicted, load : array_like of float, shape (n_row,), dimensionless
        Predicted load, and the observed load or the upper end of its bracket.
    lower : array_like of float, shape (n_row,), dimensionless
        Lower end of the bracket; NaN for a row that gives its load exactly.

    Returns
    -------
    ndarray of float, shape (n_row,), dimensionless
        The observed load, or the prediction limited to the bracket.

    Examples
    --------
    >>> nearest_load([1.0, 1.0, 5.0], [2.0, 2.0, 2.0], [np.nan, 0.5, 1.5]).tolist()
    [2.0, 1.0, 2.0]
    """
    nearest: FloatArray = np.clip(np.asarray(predicted), np.fmin(lower, load), load)
    return nearest


def _refuse_offsets(table: ContactTable) -> None:
    """Raise InputError if the body of a calibration row is not centred over a groove."""
    frame = table.frame
    fitted = (frame["status"] == "ok") & (frame["role"] == "calibration")
    rows = np.flatnonzero(fitted & (frame["offset_over_R"] != 0))
    if len(rows):
        value = frame["offset_over_R"].tolist()[rows[0]]
        others = f" and {len(rows) - 1} more rows" if len(rows) > 1 else ""
        raise InputError(
            f"{table.where}, row {rows[0] + 1}{others}: offset_over_R: expected 0, got {value!r}; "
            "this version fits only centred bodies"
        )


def refuse_circular(table: ContactTable, form: Form) -> None:
    """Raise InputError if the half-plane form would be fitted to rows from its own equation."""
    if form.name != "half-plane":
        return
    n_half_plane = int((table.calibration.column("solver") == "half-plane").sum())
    if n_half_plane:
        raise InputError(
            f"{table.where}: {n_half_plane} calibration rows have solver 'half-plane'. The "
            "half-plane form is not compared on rows that its own equation generated: that would "
            "be circular"
        )
