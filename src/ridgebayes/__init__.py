"""ridgebayes: count the ridges that a soft body touches, with uncertainty and model comparison.

The pipeline, from a generated sweep to a band on Q:

>>> import ridgebayes as rb
>>> table = rb.generate(rb.Scene.paper())
>>> fit = rb.calibrate(table, rb.Hybrid(), rng=1)
>>> q = fit.predict(a_over_R=0.022, b_over_R=0.02, p_over_E=0.009)
>>> int(q.median()), [int(bound) for bound in q.interval(0.9)]
(8, [8, 8])

Names are imported on first use, so `import ridgebayes` is fast.
"""

import ast
from importlib import import_module
from pathlib import Path
from typing import Any

_STUB = Path(__file__).with_suffix(".pyi")  # which type checkers read instead of this file
# Module of each public name.
_HOME = {
    name.name: node.module
    for node in ast.parse(_STUB.read_text(encoding="utf-8")).body
    if isinstance(node, ast.ImportFrom)
    for name in node.names
}
__all__ = list(_HOME)


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'ridgebayes' has no attribute {name!r}")
    value = getattr(import_module(str(_HOME[name])), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
