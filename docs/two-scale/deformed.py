"""Draw a finger pressed hard, by finite elements: deformed.png.

``python docs/two-scale/deformed.py``. The smooth cylinder whose contact width two scales take from
here, between flat plates at p/E = 0.33: 5 N on 12 mm of a finger of radius 8 mm and 80 kPa.
"""

from pathlib import Path

import matplotlib as mpl

from ridgebayes.contact.cylinder.cylinder import Cylinder
from ridgebayes.report.figures.bodies import plot_deformed

LOAD = 0.33
EDGES = 8.0


def main() -> None:
    """Compute and draw."""
    mpl.use("Agg")
    body = Cylinder(None, p_max=LOAD, edges=EDGES)
    state = body.unloaded()
    for load in (0.05, 0.15, LOAD):
        state = body.at_load(load, state)
    figure = plot_deformed(body, state)
    figure.savefig(Path(__file__).with_suffix(".png"), dpi=110, metadata={"Software": None})


if __name__ == "__main__":
    main()
