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

_HOME = {
    "__version__": "_types",
    "ComputationError": "errors",
    "InputError": "errors",
    "RidgebayesError": "errors",
    "Scene": "scene.scene",
    "generate": "simulate.generation",
    "contact_at_loads": "simulate.responses",
    "edge_forces": "simulate.responses",
    "ridge_forces": "simulate.responses",
    "ContactTable": "table.table",
    "read_table": "table.table",
    "paper_sweep": "table.datafiles",
    "reference_fe": "table.datafiles",
    "Classic": "model.forms",
    "HalfPlane": "model.forms",
    "Hybrid": "model.forms",
    "Modified": "model.forms",
    "PowerLaw": "model.forms",
    "Empirical": "distributions.empirical",
    "Gamma": "distributions.distribution",
    "HalfNormal": "distributions.distribution",
    "LogNormal": "distributions.distribution",
    "Normal": "distributions.distribution",
    "Truncated": "distributions.bounded",
    "Uniform": "distributions.bounded",
    "Fit": "results",
    "calibrate": "results",
    "PosteriorMixture": "inference.mixture",
    "SampleSettings": "inference.chains",
    "QDistribution": "predict.q_distribution",
    "LoadDistribution": "predict.load_distribution",
    "Comparison": "comparison.comparison",
    "citations": "comparison.citations",
    "compare": "comparison.compare",
    "friction_inputs": "friction.inputs",
    "Design": "texture_design.record",
    "design": "texture_design.design",
    "FrictionModel": "friction.friction_model",
    "FrictionBands": "friction.bands",
    "FrictionTable": "friction.table",
    "read_friction_table": "friction.table",
    "FrictionFit": "friction.calibration",
    "calibrate_friction": "friction.calibration",
    "write_report": "report",
}
__all__ = list(_HOME)


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'ridgebayes' has no attribute {name!r}")
    value = getattr(import_module(f"ridgebayes.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)


if TYPE_CHECKING:
    from ridgebayes._types import __version__
    from ridgebayes.comparison.citations import citations
    from ridgebayes.comparison.compare import compare
    from ridgebayes.comparison.comparison import Comparison
    from ridgebayes.distributions.bounded import Truncated, Uniform
    from ridgebayes.distributions.distribution import Gamma, HalfNormal, LogNormal, Normal
    from ridgebayes.distributions.empirical import Empirical
    from ridgebayes.errors import ComputationError, InputError, RidgebayesError
    from ridgebayes.friction.bands import FrictionBands
    from ridgebayes.friction.calibration import FrictionFit, calibrate_friction
    from ridgebayes.friction.friction_model import FrictionModel
    from ridgebayes.friction.inputs import friction_inputs
    from ridgebayes.friction.table import FrictionTable, read_friction_table
    from ridgebayes.inference.chains import SampleSettings
    from ridgebayes.inference.mixture import PosteriorMixture
    from ridgebayes.model.forms import Classic, HalfPlane, Hybrid, Modified, PowerLaw
    from ridgebayes.predict.load_distribution import LoadDistribution
    from ridgebayes.predict.q_distribution import QDistribution
    from ridgebayes.report import write_report
    from ridgebayes.results import Fit, calibrate
    from ridgebayes.scene.scene import Scene
    from ridgebayes.simulate.generation import generate
    from ridgebayes.simulate.responses import contact_at_loads, edge_forces, ridge_forces
    from ridgebayes.table.datafiles import paper_sweep, reference_fe
    from ridgebayes.table.table import ContactTable, read_table
    from ridgebayes.texture_design.design import design
    from ridgebayes.texture_design.record import Design
