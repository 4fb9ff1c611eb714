"""ridgebayes: how many ridges a soft body touches, how sure that is, and which model to believe.

The whole pipeline, from the embedded sweep to a band on Q and a Bayes factor:

>>> import ridgebayes as rb
>>> table = rb.generate(rb.Scene.paper())
>>> fit = rb.calibrate(table, rb.Hybrid(), rng=1)
>>> q = fit.predict(a_over_R=0.022, b_over_R=0.02, p_over_E=0.009)
>>> int(q.median()), [int(bound) for bound in q.interval(0.9)]
(8, [8, 8])

Names load on first use: `import ridgebayes` itself costs next to nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

_HOME = {
    "ComputationError": "errors",
    "InputError": "errors",
    "RidgebayesError": "errors",
    "Scene": "scene",
    "generate": "generation",
    "contact_at_loads": "responses",
    "ridge_forces": "responses",
    "ContactTable": "table",
    "read_table": "table",
    "paper_sweep": "datafiles",
    "reference_fe": "datafiles",
    "Classic": "forms",
    "HalfPlane": "forms",
    "Hybrid": "forms",
    "Modified": "forms",
    "PowerLaw": "forms",
    "HalfNormal": "priors",
    "LogNormal": "priors",
    "Normal": "priors",
    "Fit": "fit",
    "calibrate": "fit",
    "SampleSettings": "sample",
    "QDistribution": "qdistribution",
    "LoadDistribution": "loads",
    "Comparison": "comparison",
    "compare": "comparison",
    "write_report": "report",
}
__all__ = ["__version__", *_HOME]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'ridgebayes' has no attribute {name!r}")
    value = getattr(import_module(f"ridgebayes.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)


if TYPE_CHECKING:
    from ridgebayes.comparison import Comparison, compare
    from ridgebayes.datafiles import paper_sweep, reference_fe
    from ridgebayes.errors import ComputationError, InputError, RidgebayesError
    from ridgebayes.fit import Fit, calibrate
    from ridgebayes.forms import Classic, HalfPlane, Hybrid, Modified, PowerLaw
    from ridgebayes.generation import generate
    from ridgebayes.loads import LoadDistribution
    from ridgebayes.priors import HalfNormal, LogNormal, Normal
    from ridgebayes.qdistribution import QDistribution
    from ridgebayes.report import write_report
    from ridgebayes.responses import contact_at_loads, ridge_forces
    from ridgebayes.sample import SampleSettings
    from ridgebayes.scene import Scene
    from ridgebayes.table import ContactTable, read_table
