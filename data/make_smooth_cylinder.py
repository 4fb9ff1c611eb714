"""Make src/ridgebayes/contact/smooth_cylinder.csv: the smooth cylinder's contact at finite strain.

``python data/make_smooth_cylinder.py [EDGES]`` (half an hour of one thread at 64 edges): contact
half-width over Hertz's against load and Poisson's ratio. Half a disk, neo-Hookean, on a flat
without friction; its mid-plane stays flat and may widen, as between two flats.
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd

from ridgebayes.contact import hertz
from ridgebayes.contact.cylinder.cylinder import Cylinder
from ridgebayes.contact.smooth import half_widths

TABLE = Path("src/ridgebayes/contact/smooth_cylinder.csv")
NU = (0.3, 0.35, 0.4, 0.45, 0.49, 0.5)
# Each mesh is made for its largest load.
LOADS = {
    0.0044: (0.002, 0.003, 0.004),
    0.022: (0.006, 0.009, 0.0125, 0.016, 0.02),
    0.11: (0.03, 0.04, 0.05, 0.06, 0.07, 0.08, 0.09, 0.1),
    0.52: (*np.arange(0.125, 0.51, 0.025).tolist(), 0.52),
}


def smooth_rows(nu: float, edges: float) -> list[dict[str, float]]:
    """Press a smooth cylinder by all loads."""
    rows = []
    for p_max, loads in LOADS.items():
        body = Cylinder(None, p_max=p_max, nu=nu, edges=edges)
        for p, width in zip(loads, half_widths(body, loads), strict=True):
            ratio = width / float(hertz.half_width(p, nu=nu))
            rows.append({"nu": nu, "p_over_E": p, "width_over_hertz": ratio})
    return rows


if __name__ == "__main__":
    edges = float(sys.argv[1]) if len(sys.argv) > 1 else 64.0
    found = [row for nu in NU for row in smooth_rows(nu, edges)]
    pd.DataFrame(found).round(6).to_csv(TABLE, index=False)
