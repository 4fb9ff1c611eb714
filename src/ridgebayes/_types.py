"""Array aliases, the version, shared constants, and the base class of tabular records."""

import math
from abc import ABC, abstractmethod
from html import escape
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:  # slow to import
    import pandas as pd

__version__ = "0.1.0"
LOG_2PI = math.log(2 * math.pi)
BATCH_SIZE = 2**18  # numbers in the largest array of a batch: 2 MB fit in a core's cache

FloatArray: TypeAlias = NDArray[np.float64]
IntArray: TypeAlias = NDArray[np.int64]
BoolArray: TypeAlias = NDArray[np.bool_]
Rng: TypeAlias = np.random.Generator | int
Json: TypeAlias = dict[str, Any]
# Terms (share of the shear modulus, exponent) of `contact.cylinder.material.Material`.
Ogden: TypeAlias = tuple[tuple[float, float], ...]
NEO_HOOKEAN: Ogden = ((1.0, 2.0),)

_ROWS_SHOWN = 20


class Tabular(ABC):
    """Base class of records shown in a notebook as a table of their first rows."""

    @abstractmethod
    def to_dataframe(self) -> "pd.DataFrame":
        """Return the record as a table."""

    def _first_rows(self, n: int) -> "pd.DataFrame":
        """Return at most the first `n` rows; overridden if computing rows is slow."""
        return self.to_dataframe().head(n)

    def _repr_html_(self) -> str:
        rows = self._first_rows(_ROWS_SHOWN + 1)
        more = f"<p>the first {_ROWS_SHOWN} rows</p>" if len(rows) > _ROWS_SHOWN else ""
        table = rows.head(_ROWS_SHOWN).to_html(index=False, border=0)
        return f"<p>{escape(repr(self))}</p>{table}{more}"
