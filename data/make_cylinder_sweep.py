"""Make `fea/cylinder_sweep.csv`: the study's nine textures to p/E 0.02 by finite elements.

Run it from anywhere: ``python data/make_cylinder_sweep.py``. Neo-Hookean at finite strain,
Poisson's ratio 0.5, the default mesh; some minutes on one processor. It replaces the file.
"""

from pathlib import Path

import pandas as pd

from ridgebayes.scene.scene import Scene
from ridgebayes.simulate.generation import generate
from ridgebayes.table.table import ContactTable

if __name__ == "__main__":
    paper, curves = Scene.paper(), []
    for texture in paper.textures:
        if texture.role == "calibration":
            one = generate(paper.model_copy(update={"textures": (texture,)}), solver="cylinder-fe")
            curves.append(one.frame)
            print(one.frame[["texture", "Q", "p_over_E", "status"]].to_string(), flush=True)
    sweep = ContactTable.from_frame(pd.concat(curves, ignore_index=True), where="cylinder-fe")
    sweep.write(Path(__file__).parent / "fea" / "cylinder_sweep.csv")
