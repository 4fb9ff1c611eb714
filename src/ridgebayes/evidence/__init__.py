"""Log evidence, log of the integral of likelihood times prior, by several independent methods.

| method         | for                          | error                                    |
|----------------|------------------------------|------------------------------------------|
| bridge         | posteriors walked by emcee   | Monte Carlo standard error               |
| importance     | any model, with its draws    | the same, and the weights' Pareto shape  |
| quadrature     | up to four parameters        | change at the last halving of the step   |
| quadrature     | power law, any size          | the same; all K integrated exactly       |
| laplace        | a first look                 | none given                               |
| savage-dickey  | Modified inside Hybrid       | Monte Carlo standard error               |
| dynesty        | any model, minutes to hours  | Monte Carlo standard error, some tenths  |

The densities are of the log loads, so evidences of one table compare across all forms. `tables`
applies every method that suits a `Posterior`, `error_models` weighs every form under every error
model, and `prior_sensitivity` says how far evidences depend on priors and on a smooth offset's
nugget, error models summed out; `weighed_anew` weighs all again under one other prior. The room
knows `inference` and `model`. How each method works: docs/derivations/evidence.md.

>>> from ridgebayes.inference.laplace import fit_laplace
>>> from ridgebayes.model.forms import Modified
>>> from ridgebayes.model.model import Model
>>> from ridgebayes.model.observations import Observations
>>> from ridgebayes.table.datafiles import paper_sweep
>>> model = Model(Observations.from_table(paper_sweep()), Modified())
>>> laplace = fit_laplace(model)
>>> round(quadrature_evidence(model.log_density, laplace).value, 3)
78.863
>>> round(float(laplace_evidence(laplace).value), 3)
78.849
"""

from ridgebayes.evidence.bridge import bridge_evidence
from ridgebayes.evidence.nested import nested_evidence
from ridgebayes.evidence.quadrature import quadrature_evidence
from ridgebayes.evidence.savage_dickey import savage_dickey
from ridgebayes.inference.log_evidence import LogEvidence, laplace_evidence
from ridgebayes.inference.power_law_exact import power_law_evidence

__all__ = [
    "LogEvidence",
    "bridge_evidence",
    "laplace_evidence",
    "nested_evidence",
    "power_law_evidence",
    "quadrature_evidence",
    "savage_dickey",
]
