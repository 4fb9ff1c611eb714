"""Uncertain values of a scene, and their joint draws."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from scipy import special

from ridgebayes._types import FloatArray, Json
from ridgebayes.distributions.distribution import Distribution
from ridgebayes.distributions.grammar import parse_distribution
from ridgebayes.errors import InputError
from ridgebayes.runtime.randomness import Streams, stream, streams
from ridgebayes.scene.units import Dimension, over_body, to_si, with_error

_NEGLIGIBLE_PROBABILITY = 1e-9  # a probability too small to occur among a million draws
_MEDIAN_DRAWS = 1_001  # draws of a callable


@dataclass(frozen=True, eq=False)
class Source:
    """Source of the draws of one value.

    Parameters
    ----------
    origin : object
        A `Distribution`, a frozen distribution of scipy.stats, an array of draws, or a callable of
        a numpy generator that returns one draw.
    text : str
        Value as written.
    has_unit : bool or None
        Whether it has units; None if that is not known, as for Python objects.
    """

    origin: Any
    text: str
    has_unit: bool | None

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Source) and _content(self.origin) == _content(other.origin)

    @property
    def has_quantiles(self) -> bool:
        """Whether a draw is a function of a normal score, as correlation requires."""
        return not callable(self.origin) or hasattr(self.origin, "ppf")

    def draw(self, score: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Return draws at standard normal scores, shape (n,)."""
        if isinstance(self.origin, Distribution):
            return np.asarray(self.origin.value_at(score), dtype=np.float64)
        if hasattr(self.origin, "ppf"):
            return np.asarray(self.origin.ppf(special.ndtr(score)), dtype=np.float64)
        if callable(self.origin):
            return np.array([self._called(rng) for _ in score])
        place = (special.ndtr(score) * len(self.origin)).astype(np.int64)
        return np.asarray(self.origin[np.minimum(place, len(self.origin) - 1)])

    def _called(self, rng: np.random.Generator) -> float:
        value = self.origin(rng)
        try:
            return float(value)
        except (TypeError, ValueError):
            raise InputError(f"expected a callable that returns a number, got {value!r}") from None

    @cached_property
    def median(self) -> float:
        """Median; for a callable, the median of 1,001 draws."""
        if isinstance(self.origin, np.ndarray):
            return float(np.median(self.origin))
        n = 1 if self.has_quantiles else _MEDIAN_DRAWS
        return float(np.median(self.draw(np.zeros(n), stream(0, "median"))))

    @property
    def ends(self) -> list[float]:
        """Quantiles beyond which draws are not expected; the median of a callable."""
        if not self.has_quantiles:
            return [self.median]
        scores = special.ndtri([_NEGLIGIBLE_PROBABILITY, 1 - _NEGLIGIBLE_PROBABILITY])
        return [float(value) for value in self.draw(scores, stream(0, "ends"))]


def read_source(dimension: Dimension | None, raw: object, folder: Path) -> Source | None:
    """Return the source of an uncertain value; None for another value, which is not text.

    Raises
    ------
    InputError
        If a text is not a distribution, a unit does not fit, an array is not a row of finite
        numbers, or the median is not finite.
    """
    with_unit: set[bool] = set()

    def number(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            if dimension is None:
                raise
            value = float(to_si(text, dimension))
            with_unit.add(True)
            return value
        with_unit.update({False} if value else ())
        return value

    origin: Any = raw
    if isinstance(raw, str):
        origin = parse_distribution(with_error(raw), number=number, folder=folder)
    elif isinstance(raw, np.ndarray):
        is_row = raw.ndim == 1 and raw.size and raw.dtype.kind in "iuf"
        if not (is_row and np.isfinite(raw).all()):
            shown = f"{raw.dtype.name} of shape {raw.shape}"
            raise InputError(f"expected a row of finite draws, got {shown}")
        origin = np.sort(raw.astype(np.float64))
    elif not (isinstance(raw, Distribution) or callable(raw) or hasattr(raw, "ppf")):
        return None
    if len(with_unit) > 1:
        raise InputError("give units everywhere or nowhere")
    source = Source(origin, str(raw), with_unit.pop() if with_unit and dimension else None)
    if not math.isfinite(source.median):
        raise InputError("must have a finite median")
    return source


@dataclass(frozen=True)
class Uncertain:
    """Uncertain values of a scene.

    Parameters
    ----------
    sources : mapping of str to Source
        Sources by place in a scene file, such as ``body.radius``.
    medians : mapping of str to object
        All values of the file by place, medians among them.
    joint : sequence of Joint
        Groups of values that are drawn together.
    texture : str, optional
        Place of the texture whose values are derived.
    """

    sources: Mapping[str, Source]
    medians: Mapping[str, Any]
    joint: Sequence["Joint"] = ()
    texture: str = "texture[1]"

    @classmethod
    def of(
        cls, sources: Mapping[str, Source], medians: Json, joint: Sequence[Mapping[str, Any]]
    ) -> "Uncertain":
        """Return the uncertain values of a scene file, with its [[joint]] sections.

        Raises
        ------
        InputError
            As `Joint.read`.
        """
        joints = [Joint.read(section, medians, sources) for section in joint]
        seen = [name for entry in joints for name in entry.of]
        if len(set(seen)) < len(seen):
            raise InputError(f"joint: expected each value in one joint only, got {', '.join(seen)}")
        return cls(sources, medians, joints)

    @property
    def texts(self) -> dict[str, str]:
        """Values as written, by place."""
        texts = {name: source.text for name, source in self.sources.items()}
        rows = (entry.of for entry in self.joint if entry.draws is not None)
        return texts | {name: "joint draws" for names in rows for name in names}

    def of_texture(self, number: int) -> "Uncertain":
        """Return the uncertain values of the scene with one texture; `number` counts from 1."""
        return replace(self, texture=f"texture[{number}]")

    def derived(self, drawn: Mapping[str, FloatArray]) -> Json:
        """Return values over R and E from draws by place; see `over_body`."""
        return over_body({**self.medians, **drawn}, self.texture)

    def draw(self, n: int, random: Streams) -> dict[str, FloatArray]:
        """Return the next n draws of the uncertain values, by place."""
        drawn = self.at_scores(self.scores(n, random), random)
        for entry in self.joint:
            if entry.draws is not None:
                rows = entry.rows(n, random("scene", *entry.of))
                drawn |= dict(zip(entry.of, rows.T, strict=True))
        return drawn

    def scores(self, n: int, random: Streams) -> dict[str, FloatArray]:
        """Return the next n independent standard normal scores, by place."""
        return {name: random("scene", name).standard_normal(n) for name in self.sources}

    def at_scores(
        self, score: Mapping[str, FloatArray], random: Streams | None = None
    ) -> dict[str, FloatArray]:
        """Return values at independent normal scores, by place; callables draw from `random`."""
        score, random = dict(score), random or streams(0)
        for entry in self.joint:
            if entry.correlation is not None:
                # Unlike Cholesky's, this root exists for singular matrices (perfect correlation).
                value, vector = np.linalg.eigh(entry.correlation)
                root = vector * np.sqrt(np.maximum(value, 0.0))
                mixed = root @ np.stack([score[name] for name in entry.of])
                score |= dict(zip(entry.of, mixed, strict=True))
        values = {}
        for name, source in self.sources.items():
            values[name] = source.draw(score[name], random("scene", name, "callable"))
        return values


@dataclass(frozen=True, eq=False)
class Joint:
    """Values that are drawn together, by correlated normal scores or as rows.

    Parameters
    ----------
    of : tuple of str
        Places of the values.
    correlation : ndarray of float, shape (k, k), or None
        Correlation of the normal scores.
    draws : object
        Rows (n, k), or a frozen multivariate distribution of scipy.stats; None with correlation.
    """

    of: tuple[str, ...]
    correlation: FloatArray | None
    draws: Any = None

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Joint) and _content(self) == _content(other)

    @classmethod
    def read(
        cls, section: Mapping[str, Any], certain: Json, sources: Mapping[str, Source]
    ) -> "Joint":
        """Parse a [[joint]] section.

        Raises
        ------
        InputError
            If a name is not allowed, a matrix is not a correlation matrix, or rows are not finite
            or have the wrong length.
        """
        names, draws = tuple(section["of"]), section["draws"]
        if (draws is None) == (section["correlation"] is None):
            raise InputError("joint: expected either correlation or draws")
        allowed = [name for name, value in sources.items() if value.has_quantiles]
        if draws is not None:  # replaces plain values
            allowed = [name for name, value in certain.items() if not isinstance(value, str)]
        for name in names:
            if name not in allowed or names.count(name) > 1:
                rule = f"expected names without repeats, of {', '.join(allowed) or 'distributions'}"
                raise InputError(f"joint.of: {rule}, got {name!r}")
        if draws is not None:
            joint = cls(names, None, draws if hasattr(draws, "rvs") else _array(draws))
            joint.rows(1, stream(0, "shape"))
            return joint
        matrix = _array(section["correlation"]).astype(np.float64)
        if (
            matrix.shape != (len(names), len(names))
            or not np.isfinite(matrix).all()
            or not np.allclose(matrix, matrix.T)
            or not np.allclose(np.diag(matrix), 1)
            or np.linalg.eigvalsh(matrix)[0] < -1e-9
        ):
            raise InputError(
                f"joint.correlation: expected a symmetric matrix of {len(names)} rows with ones on "
                f"its diagonal and no negative eigenvalue, got {section['correlation']!r}"
            )
        return cls(names, matrix)

    def rows(self, n: int, rng: np.random.Generator) -> FloatArray:
        """Return n joint draws, shape (n, k)."""
        if hasattr(self.draws, "rvs"):
            values = np.asarray(self.draws.rvs(size=n, random_state=rng), float).reshape(n, -1)
        elif self.draws.ndim == 2 and self.draws.dtype.kind in "iuf" and len(self.draws):
            values = self.draws[rng.integers(len(self.draws), size=n)].astype(np.float64)
        else:
            values = np.empty((n, 0))
        if values.shape[1] != len(self.of) or not np.isfinite(values).all():
            raise InputError(
                f"joint.draws: expected finite rows of {len(self.of)} numbers, or a frozen "
                "multivariate distribution of as many"
            )
        return values


def _content(value: Any) -> object:
    """Return a value that equals another's if both make the same draws, unlike arrays."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, Joint):
        return value.of, _content(value.correlation), _content(value.draws)
    # SciPy's frozen distributions of one variable.
    return (value.dist.name, value.args, value.kwds) if hasattr(value, "dist") else value


def _array(rows: object) -> np.ndarray:
    """Return rows as an array; an empty array if their lengths differ."""
    try:
        return np.asarray(rows)
    except ValueError:
        return np.empty(0)
