"""Draw a finger pressed on half-millimetre ridges, by finite elements: deformed.png.

``python docs/two-scale/deformed.py`` (a minute of one thread). Radius 8 mm, ridges of 0.5 mm with
corners of 50 um, grooves of 0.4 mm, p/E = 0.16: 2.5 N on 12 mm at 80 kPa.
"""

from pathlib import Path

import matplotlib as mpl

from ridgebayes.contact.cylinder.cylinder import Cylinder
from ridgebayes.contact.rigid_profile import Profile
from ridgebayes.report.figures.bodies import plot_deformed

LOADS = (0.005, 0.02, 0.04, 0.07, 0.1, 0.13, 0.16)
EDGES = 10


def main() -> None:
    """Compute and draw."""
    mpl.use("Agg")
    # The mesh is that of the hard press, 0.195.
    body = Cylinder(Profile(0.0625, 0.05, corner=0.00625), p_max=0.195, edges=EDGES)
    state = body.unloaded()
    for load in LOADS:
        state = body.at_load(load, state)
    figure = plot_deformed(body, state)
    figure.savefig(Path(__file__).with_suffix(".png"), dpi=110, metadata={"Software": None})


if __name__ == "__main__":
    main()
