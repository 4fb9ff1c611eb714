"""Array aliases for signatures, and the version: what every room may know."""

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

__version__ = "0.1.0"

FloatArray: TypeAlias = NDArray[np.float64]
IntArray: TypeAlias = NDArray[np.int64]
BoolArray: TypeAlias = NDArray[np.bool_]
Rng: TypeAlias = np.random.Generator | int
Json: TypeAlias = dict[str, Any]
