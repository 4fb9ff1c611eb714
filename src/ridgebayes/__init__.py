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

from importlib import import_module
from typing import TYPE_CHECKING, Any

_HOME = {
    "__version__": "_types",
    "CautionWarning": "errors",
    "ComputationError": "errors",
    "InputError": "errors",
    "RidgebayesError": "errors",
    "import_table": "fea.read",
    "export_deck": "fea.deck_text",
    "Scene": "scene.scene",
    "plan": "scene.estimates",
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
    "Noise": "model.noise",
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
    "coverage": "checks.coverage",
    "cost": "checks.cost",
    "friction_inputs": "friction.inputs",
    "Design": "texture_design.record",
    "design": "texture_design.design",
    "FrictionModel": "friction.friction_model",
    "FrictionBands": "friction.bands",
    "FrictionTable": "friction.table",
    "read_friction_table": "friction.table",
    "FrictionFit": "friction.calibration",
    "calibrate_friction": "friction.calibration",
    "run": "commands.run",
    "read_run": "commands.run_files",
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


if TYPE_CHECKING:  # "as" marks a name as re-exported for type checkers
    from ridgebayes._types import __version__ as __version__
    from ridgebayes.checks.cost import cost as cost
    from ridgebayes.checks.coverage import coverage as coverage
    from ridgebayes.commands.run import run as run
    from ridgebayes.commands.run_files import read_run as read_run
    from ridgebayes.comparison.citations import citations as citations
    from ridgebayes.comparison.compare import compare as compare
    from ridgebayes.comparison.comparison import Comparison as Comparison
    from ridgebayes.distributions.bounded import Truncated as Truncated
    from ridgebayes.distributions.bounded import Uniform as Uniform
    from ridgebayes.distributions.distribution import Gamma as Gamma
    from ridgebayes.distributions.distribution import HalfNormal as HalfNormal
    from ridgebayes.distributions.distribution import LogNormal as LogNormal
    from ridgebayes.distributions.distribution import Normal as Normal
    from ridgebayes.distributions.empirical import Empirical as Empirical
    from ridgebayes.errors import CautionWarning as CautionWarning
    from ridgebayes.errors import ComputationError as ComputationError
    from ridgebayes.errors import InputError as InputError
    from ridgebayes.errors import RidgebayesError as RidgebayesError
    from ridgebayes.fea.deck_text import export_deck as export_deck
    from ridgebayes.fea.read import import_table as import_table
    from ridgebayes.friction.bands import FrictionBands as FrictionBands
    from ridgebayes.friction.calibration import FrictionFit as FrictionFit
    from ridgebayes.friction.calibration import calibrate_friction as calibrate_friction
    from ridgebayes.friction.friction_model import FrictionModel as FrictionModel
    from ridgebayes.friction.inputs import friction_inputs as friction_inputs
    from ridgebayes.friction.table import FrictionTable as FrictionTable
    from ridgebayes.friction.table import read_friction_table as read_friction_table
    from ridgebayes.inference.chains import SampleSettings as SampleSettings
    from ridgebayes.inference.mixture import PosteriorMixture as PosteriorMixture
    from ridgebayes.model.forms import Classic as Classic
    from ridgebayes.model.forms import HalfPlane as HalfPlane
    from ridgebayes.model.forms import Hybrid as Hybrid
    from ridgebayes.model.forms import Modified as Modified
    from ridgebayes.model.forms import PowerLaw as PowerLaw
    from ridgebayes.model.noise import Noise as Noise
    from ridgebayes.predict.load_distribution import LoadDistribution as LoadDistribution
    from ridgebayes.predict.q_distribution import QDistribution as QDistribution
    from ridgebayes.report import write_report as write_report
    from ridgebayes.results import Fit as Fit
    from ridgebayes.results import calibrate as calibrate
    from ridgebayes.scene.estimates import plan as plan
    from ridgebayes.scene.scene import Scene as Scene
    from ridgebayes.simulate.generation import generate as generate
    from ridgebayes.simulate.responses import contact_at_loads as contact_at_loads
    from ridgebayes.simulate.responses import edge_forces as edge_forces
    from ridgebayes.simulate.responses import ridge_forces as ridge_forces
    from ridgebayes.table.datafiles import paper_sweep as paper_sweep
    from ridgebayes.table.datafiles import reference_fe as reference_fe
    from ridgebayes.table.table import ContactTable as ContactTable
    from ridgebayes.table.table import read_table as read_table
    from ridgebayes.texture_design.design import design as design
    from ridgebayes.texture_design.record import Design as Design
