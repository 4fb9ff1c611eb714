"""Log evidence, log of the integral of likelihood times prior, by several independent methods.

| method         | for                          | error                                    |
|----------------|------------------------------|------------------------------------------|
| bridge         | any fit                      | Monte Carlo standard error               |
| quadrature     | up to four parameters        | change at the last halving of the step   |
| quadrature     | power law, any size          | the same; all K integrated exactly       |
| laplace        | a first look                 | none given                               |
| savage-dickey  | Modified inside Hybrid       | Monte Carlo standard error               |
| dynesty        | any model, minutes to hours  | Monte Carlo standard error, some tenths  |

The densities are of the log loads, so evidences of one table compare across all forms.
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
