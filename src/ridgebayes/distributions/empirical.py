"""Distribution of a sample, such as a column of a file."""

import csv
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import ClassVar

import numpy as np
from scipy import special
from scipy.interpolate import CubicHermiteSpline, PchipInterpolator
from scipy.optimize import elementwise

from ridgebayes._types import LOG_2PI, FloatArray
from ridgebayes.distributions.distribution import Distribution
from ridgebayes.errors import InputError
from ridgebayes.runtime.reading import LARGEST_TEXT, read_text, refusing
from ridgebayes.runtime.text import clipped

LEAST_SAMPLE = 10
_N_KNOTS = (5, 25)  # minimum and maximum; between them one for ten values, rounded to odd
_MAX_SCORE = 3.0  # last knot in sds; quantiles farther out are those of single values


@dataclass(frozen=True)
class Empirical(Distribution):
    """Smooth distribution with the quantiles of a sample.

    Values are a monotone function of a standard normal: a cubic spline between the sample's
    quantiles at evenly spaced normal scores, and linear beyond, so that tails are normal. If all
    values are positive, their logarithms are interpolated.

    Parameters
    ----------
    scores : tuple of float, dimensionless
        Normal scores of the quantiles, increasing.
    values : tuple of float, unit of the parameter
        Quantiles, increasing.
    source : str, optional
        Origin of the sample, for messages.

    Examples
    --------
    >>> import numpy as np
    >>> import ridgebayes as rb
    >>> draws = np.random.default_rng(1).normal(2.0, 0.1, 1000)
    >>> bool(abs(rb.Empirical.of(draws).value_at(0.0) - 2.0) < 0.02)  # the median
    True
    """

    scores: tuple[float, ...]
    values: tuple[float, ...]
    source: str = "a sample"
    kind: ClassVar[str] = "empirical"
    is_stackable: ClassVar[bool] = False

    def __post_init__(self) -> None:
        for name in ("scores", "values"):
            object.__setattr__(self, name, tuple(map(float, getattr(self, name))))
        knots = np.array([self.scores, self.values])
        if knots.shape[1] < 3 or not (np.isfinite(knots).all() and (np.diff(knots) > 0).all()):
            raise InputError(
                "empirical distribution: expected three or more finite, increasing quantiles"
            )

    @classmethod
    def of(cls, sample: FloatArray, source: str = "a sample") -> "Empirical":
        """Return the distribution of a sample.

        Parameters
        ----------
        sample : ndarray of float, shape (n,), unit of the parameter
            At least ten finite values.
        source : str, optional
            Origin of the sample, for messages.

        Raises
        ------
        InputError
            If there are fewer values, one is not finite, or nearly all are equal.

        Examples
        --------
        >>> found = Empirical.of(np.linspace(1.0, 3.0, 101))
        >>> round(float(found.value_at(0.0)), 12)
        2.0
        """
        with refusing(source, OverflowError, TypeError, ValueError, rule="; expected numbers"):
            sample = np.asarray(sample, dtype=float)
        n = sample.size
        if n < LEAST_SAMPLE or not np.isfinite(sample).all():
            raise InputError(f"{source}: expected {LEAST_SAMPLE} finite values or more, got {n}")
        last = min(-special.ndtri(0.5 / n), _MAX_SCORE)
        scores = np.linspace(-last, last, int(np.clip(n // 10, *_N_KNOTS)) | 1)  # odd: one is 0
        values = np.quantile(sample, special.ndtr(scores), method="hazen")
        new = np.diff(values, prepend=-np.inf) > 0
        if new.sum() < 3:
            raise InputError(f"{source}: expected values that differ, got nearly equal ones")
        return cls(tuple(scores[new]), tuple(values[new]), source)

    @property
    def _is_log(self) -> bool:
        return self.values[0] > 0

    @property
    def support(self) -> tuple[float, float]:
        return 0.0 if self._is_log else -math.inf, math.inf

    @property
    def words(self) -> str:
        low, middle, high = self.value_at(special.ndtri([0.05, 0.5, 0.95]))
        return f"{self.source}, median {middle:.4g}, 90 % between {low:.4g} and {high:.4g}"

    @cached_property
    def _curve(self) -> CubicHermiteSpline:
        u, y = np.array(self.scores), np.array(self.values)
        y = np.log(y) if self._is_log else y
        slope = PchipInterpolator(u, y)(u, 1)
        # The slope at the ends may be 0, which would make the density infinite.
        slope[[0, -1]] = np.diff(y)[[0, -1]] / np.diff(u)[[0, -1]]
        return CubicHermiteSpline(u, y, slope)

    def _clipped_score(self, u: FloatArray) -> FloatArray:
        return np.clip(u, self.scores[0], self.scores[-1])

    def _line_at(self, u: FloatArray) -> FloatArray:
        inside = self._clipped_score(u)
        return np.asarray(self._curve(inside) + self._curve(inside, 1) * (u - inside))

    def log_pdf(self, x: FloatArray) -> FloatArray:
        x = np.asarray(x, dtype=float)
        is_in = np.greater(x, self.support[0])
        u = self.score(np.where(is_in, x, self.values[0]))
        value = -0.5 * (u * u + LOG_2PI) - np.log(self.slope_at(u, np.where(is_in, x, 1.0)))
        return np.where(is_in, value, -np.inf)

    def value_at(self, u: FloatArray | float) -> FloatArray:
        line = self._line_at(np.asarray(u, dtype=float))
        with np.errstate(over="ignore"):
            return np.exp(line) if self._is_log else line

    def score(self, x: FloatArray | float) -> FloatArray:
        y = np.log(x) if self._is_log else np.asarray(x, dtype=float)
        ends = np.array([self.scores[0], self.scores[-1]])
        low, high = self._curve(ends)
        inside = elementwise.find_root(
            lambda u, y: self._curve(u) - y, tuple(ends), args=(np.clip(y, low, high),)
        ).x
        # The curve is linear beyond the ends.
        beyond = np.minimum(y - low, 0) + np.maximum(y - high, 0)
        return np.asarray(inside + beyond / self._curve(inside, 1))

    def slope_at(self, u: FloatArray | float, x: FloatArray) -> FloatArray:
        slope = self._curve(self._clipped_score(np.asarray(u, dtype=float)), 1)
        return np.asarray(slope * x if self._is_log else slope)


def read_sample(path: Path, column: str, number: Callable[[str], float]) -> FloatArray:
    """Read a column of a CSV file.

    Parameters
    ----------
    path : Path
        File with a header line.
    column : str
        Name of the column.
    number : callable
        Converts the text of a cell to a number; raises ValueError.

    Returns
    -------
    ndarray of float, shape (n,)
        Values of the column.

    Raises
    ------
    InputError
        If the file cannot be read, the column is missing, or a cell is not a finite number.
    """
    reader = csv.DictReader(read_text(path, LARGEST_TEXT).splitlines())
    with refusing(f"{path}: not a CSV file", csv.Error):
        names, rows = list(reader.fieldnames or ()), list(reader)
    if column not in names:
        raise InputError(f"{path}: expected a column {clipped(column)}, got {', '.join(names)}")
    values = np.empty(len(rows))
    for i, row in enumerate(rows):
        cell = row[column] or ""
        try:
            values[i] = number(cell.strip())
        except ValueError:
            values[i] = math.nan
        if not math.isfinite(values[i]):
            raise InputError(
                f"{path}, row {i + 2}, {column}: expected a finite number, got {clipped(cell)}"
            )
    return values
