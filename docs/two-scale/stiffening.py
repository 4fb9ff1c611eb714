"""Hold two scales against finite elements of stiffening bodies: stiffening.csv.

``python docs/two-scale/stiffening.py`` (some two minutes of one thread), corners of a tenth of a
ridge.
"""

from pathlib import Path

import numpy as np
import pandas as pd

from ridgebayes.contact.contact_solution import load_factor
from ridgebayes.contact.cylinder.cylinder import Cylinder
from ridgebayes.contact.reaching import reaching_loads
from ridgebayes.contact.rigid_profile import Profile
from ridgebayes.contact.two_scale import half_plane_load, load_of, relative_error

TABLE = Path(__file__).with_suffix(".csv")
MILD, STIFF, STIFFEST = ((0.8, 2.0), (0.2, 8.0)), ((0.5, 2.0), (0.5, 12.0)), ((1.0, 20.0),)
# Ridge and groove width, Poisson's ratio, material, edges a ridge, highest load.
RUNS = [
    (0.1, 0.05, 0.5, STIFF, 12, 0.16),
    (0.1, 0.05, 0.45, MILD, 8, 0.24),
    (0.08, 0.08, 0.5, STIFF, 8, 0.2),
    (0.05, 0.05, 0.5, MILD, 8, 0.05),
    (0.08, 0.03, 0.5, STIFFEST, 12, 0.13),
]


def main() -> None:
    """Compute all runs; rows are kept as they come."""
    rows = []
    for a, b, nu, ogden, edges, p_max in RUNS:
        profile = Profile(a, b, corner=0.1 * a)
        factor = load_factor(nu)
        at = float(half_plane_load(p_max, nu, ogden))
        events = reaching_loads(profile, W_max=1.05 * factor * at)
        half_plane = dict(zip(events.Q.tolist(), (events.W / factor).tolist(), strict=True))
        body = Cylinder(profile, p_max=p_max, nu=nu, edges=edges, ogden=ogden)
        for one in body.transitions(p_max):
            p = one.p_over_E
            own, soft = (float(load_of(half_plane[one.Q], nu, *kind)) for kind in ((ogden,), ()))
            mesh = 4e-3 if one.Q == 4 else 1e-3
            rows.append(
                {
                    "a_over_R": a,
                    "b_over_R": b,
                    "nu": nu,
                    "ogden": "; ".join(f"{share:g} {exponent:g}" for share, exponent in ogden),
                    "Q": one.Q,
                    "p_over_E": p,
                    "two_scale_error": own / p - 1,
                    "standard_error": np.hypot(
                        float(relative_error(own, profile, nu, ogden)), mesh
                    ),
                    "neo_hookean_error": soft / p - 1,
                    "half_plane_error": half_plane[one.Q] / p - 1,
                    "edges": edges,
                }
            )
            pd.DataFrame(rows).round(6).to_csv(TABLE, index=False)


if __name__ == "__main__":
    main()
