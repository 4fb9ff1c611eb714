"""Textures that can be made: multiples of a step within bounds."""

import math
from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any

from ridgebayes._types import Json
from ridgebayes.contact.scaling import Texture
from ridgebayes.errors import InputError
from ridgebayes.inference.posterior import Posterior
from ridgebayes.predict.extrapolation import CalibratedRange
from ridgebayes.table.columns import LARGEST_WIDTH, LEAST_WIDTH

_DEFAULT_WIDTHS, _MAX_TEXTURES = 60, 40_000  # widths of the default step; textures in all


def lattice(sizes: Mapping[str, Any], fits: Sequence[Posterior]) -> tuple[list[Texture], Json]:
    """Return the textures within bounds whose widths are multiples of the step, and both."""
    unknown = set(sizes) - {"a", "b", "step"}
    if unknown:
        raise InputError(f"sizes: expected a, b and step, got {sorted(unknown)[0]!r}")
    ranges = [CalibratedRange.of(fit) for fit in fits]
    calibrated = {"a": [fit.ridge for fit in ranges], "b": [fit.groove for fit in ranges]}
    bounds = {}
    for name, pairs in calibrated.items():
        inner = max(low for low, _ in pairs) / 1.5, min(high for _, high in pairs) * 1.5
        low, high = sizes.get(name) or inner
        if not LEAST_WIDTH <= low <= high <= LARGEST_WIDTH:
            raise InputError(f"{name}: expected bounds 0 < LO <= HI over R, got {low:g}:{high:g}")
        bounds[name] = float(low), float(high)
    widest = max(high - low for low, high in bounds.values())
    step = sizes.get("step") or _round_step(widest / _DEFAULT_WIDTHS)
    if not (0 < step < math.inf):
        raise InputError(f"step: expected above 0, got {step!r}")
    ends = [(low / step - 1e-9, high / step + 1e-9) for low, high in bounds.values()]
    spans = [(math.ceil(low), math.floor(high) + 1) for low, high in ends]
    number = math.prod(float(last - first) for first, last in spans)
    if number > _MAX_TEXTURES:  # before the list takes the memory
        raise InputError(
            f"step: expected at most {_MAX_TEXTURES:,} textures, got {number:,.0f}; "
            "a larger step, or closer bounds"
        )
    columns = []
    for (name, (low, high)), span in zip(bounds.items(), spans, strict=True):
        widths = [float(f"{i * step:.12g}") for i in range(*span)]
        columns.append(widths or ([low] if low == high else []))
        if not columns[-1]:
            raise InputError(f"{name}: no multiple of the step {step:g} is within {low:g}:{high:g}")
    about = {name: list(ends) for name, ends in bounds.items()} | {"step": float(step)}
    return [(a, b) for a, b in product(*columns)], about


def _round_step(least: float) -> float:
    """Return the smallest of 1, 2, 5, 10, ... times a power of ten at or above a number."""
    power = 10.0 ** math.floor(math.log10(max(least, LEAST_WIDTH)))
    return float(next(k * power for k in (1, 2, 5, 10) if k * power >= least * (1 - 1e-9)))
