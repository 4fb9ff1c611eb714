"""Draws of manufactured widths, body and load of a design."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from ridgebayes._types import BoolArray, FloatArray
from ridgebayes.contact.scaling import Texture
from ridgebayes.errors import InputError
from ridgebayes.runtime.randomness import stream
from ridgebayes.runtime.text import clipped
from ridgebayes.scene.draws import draw_scene
from ridgebayes.scene.scene import Scene
from ridgebayes.scene.typed import over_radius
from ridgebayes.scene.units import NO_UNITS, Body

_MAX_SCORE = 4.9  # standard deviations: widths stay above 0 for an sd of 20 %
_MAX_TOLERANCE = 0.2  # over the width


@dataclass(frozen=True)
class Tolerance:
    """Manufacturing tolerance of ridge and groove widths.

    Parameters
    ----------
    size : float
        Standard deviation of each width, over the width or over R; widths are independent.
    is_length : bool, optional
        Whether `size` is a length over R.
    is_worst : bool, optional
        Whether `size` bounds the widths instead; the worst corner of the bounds counts.
    """

    size: float = 0.0
    is_length: bool = False
    is_worst: bool = False

    @classmethod
    def parse(cls, text: "str | Tolerance | None", body: Body = NO_UNITS) -> "Tolerance":
        """Parse a tolerance: ``5 %``, ``worst 5 %`` or a length.

        Parameters
        ----------
        text : str, Tolerance or None
            Tolerance; None for exact widths.
        body : Body, optional
            Body whose radius converts a text such as ``10 um`` to a length over R.

        Raises
        ------
        InputError
            If the text is not a tolerance, or is above 20 %.

        Examples
        --------
        >>> Tolerance.parse("worst 5 %")
        Tolerance(size=0.05, is_length=False, is_worst=True)
        """
        if text is None or isinstance(text, Tolerance):
            return text or cls()
        where = f"tolerance {clipped(str(text))}"
        words = re.fullmatch(r"\s*(worst\s+)?(\S.*?)\s*(%?)\s*", str(text))
        try:
            if words is None:
                raise ValueError(text)
            size = float(words[2]) / 100 if words[3] else over_radius(words[2], body)
        except InputError as error:
            raise InputError(f"{where}: {error}") from None
        except ValueError:
            raise InputError(
                f"{where}: expected a tolerance such as '5 %', 'worst 5 %' or '10 um'"
            ) from None
        if not 0 <= size < np.inf or (words[3] and size > _MAX_TOLERANCE):
            raise InputError(f"{where}: expected 0 to {_MAX_TOLERANCE:.0%}")
        return cls(size, not words[3], bool(words[1]))

    def check(self, least: float) -> None:
        """Refuse a length above a fifth of `least`, the smallest width."""
        if least < self.least_width:
            raise InputError(
                f"tolerance: expected at most {_MAX_TOLERANCE:.0%} of the smallest width, "
                f"{least:.4g} R, got {self.size:.4g} R"
            )

    @property
    def least_width(self) -> float:
        """Smallest width that may have this tolerance: five times a length."""
        return self.size / _MAX_TOLERANCE if self.is_length else 0.0

    @property
    def corners(self) -> tuple[tuple[float, float], ...]:
        """Scores of both widths at the middle and the corners of the bounds."""
        if not self.is_worst or not self.size:
            return ((0.0, 0.0),)
        return ((0.0, 0.0), *product((-1.0, 1.0), (-1.0, 1.0)))

    def made(self, width: float, score: FloatArray | float) -> FloatArray | float:
        """Return manufactured widths at scores, in standard deviations."""
        return width + (self.size if self.is_length else self.size * width) * score


def uncertain_widths(scene: Scene) -> list[str]:
    """Return the names of a scene's widths that are distributions."""
    return [name for name in scene.uncertain_names if name.endswith("_width")]


@dataclass(frozen=True, eq=False)
class Bodies:
    """Draws of the uncertain inputs, each of shape (n,).

    Parameters
    ----------
    tolerance : Tolerance
        Tolerance of the widths.
    score : ndarray of float, shape (2, n)
        Scores of both manufactured widths; unused if the tolerance bounds the widths.
    factor : ndarray of float, shape (2, n)
        Factors on both widths over R, from distributions of the scene's widths and radius.
    nu : ndarray of float
        Poisson's ratio.
    units : mapping of str to ndarray of float
        p/E of a load of 1 in each unit; see `goals.Load`.
    """

    tolerance: Tolerance
    score: FloatArray
    factor: FloatArray
    nu: FloatArray
    units: Mapping[str, FloatArray]

    @classmethod
    def draw(
        cls,
        scene: Scene,
        tolerance: Tolerance,
        n: int,
        seed: int,
        draws: Mapping[str, FloatArray] | None = None,
    ) -> "Bodies":
        """Draw n bodies; `draws` as in `draw_scene`, with scores of widths as ``tolerance``.

        Raises
        ------
        InputError
            As `draw_scene`, or if both a tolerance and distributions of widths are given.
        """
        if tolerance.size and (widths := uncertain_widths(scene)):
            names = f"tolerance, and {', '.join(widths)} of the scene"
            raise InputError(f"{names}: expected only one of the two, got both")
        drawn = draw_scene(scene, n, seed, draws)
        nominal = {name: scene.textures[0].shape[name] for name in ("a", "b")}
        score = (draws or {}).get("tolerance")
        if score is None:
            score = stream(seed, "tolerance").standard_normal((2, n))
        factor = np.stack([drawn.profile[name] / value for name, value in nominal.items()])
        score = np.clip(score, -_MAX_SCORE, _MAX_SCORE)
        units = {"p/E": np.ones_like(drawn.nu), "share": drawn.p_over_E}
        units |= {kind: 1 / load for kind, load in drawn.loads_at_modulus.items()}
        return cls(tolerance, score, factor, drawn.nu, units)

    @property
    def is_certain(self) -> bool:
        """Whether manufactured widths equal nominal widths in all draws."""
        return not self.tolerance.size and not np.ptp(self.factor) and self.factor[0, 0] == 1

    def subset(self, index: slice | BoolArray) -> "Bodies":
        """Return a subset of the draws."""
        units = {unit: p[index] for unit, p in self.units.items()}
        score, factor = self.score[:, index], self.factor[:, index]
        return Bodies(self.tolerance, score, factor, self.nu[index], units)

    def widths(
        self, a: float, b: float, corner: tuple[float, float] = (0.0, 0.0)
    ) -> tuple[FloatArray, FloatArray]:
        """Return the manufactured widths of a texture over R; numbers if they are certain."""
        if self.is_certain:
            return np.asarray(a), np.asarray(b)
        score = np.array(corner)[:, None] if self.tolerance.is_worst else self.score
        made = [self.tolerance.made(width, z) for width, z in zip((a, b), score, strict=True)]
        return made[0] * self.factor[0], made[1] * self.factor[1]

    def ratios(self, textures: Sequence[Texture]) -> tuple[float, float]:
        """Return the range of a/pitch of all manufactured textures."""
        # a/pitch rises with a and falls with b in every draw, so extreme widths suffice.
        ridges, grooves = ((min(x), max(x)) for x in zip(*textures, strict=True))
        ends = []
        for a, b, corner in product(ridges, grooves, self.tolerance.corners):
            ridge, groove = self.widths(a, b, corner)
            ratio = ridge / (ridge + groove)
            ends += [float(ratio.min()), float(ratio.max())]
        return min(ends), max(ends)


def median_units(scene: Scene) -> dict[str, FloatArray]:
    """Return `Bodies.units` at the medians of a scene, each of shape (1,)."""
    return dict(Bodies.draw(scene.at_medians(), Tolerance(), 1, 0).units)
