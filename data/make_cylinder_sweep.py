"""Make `fea/cylinder_sweep.csv`: the study's nine textures to p/E 0.02 by finite elements.

Run it from anywhere: ``python data/make_cylinder_sweep.py``. Neo-Hookean at finite strain,
Poisson's ratio 0.5, the default mesh; about ten minutes on one processor. It replaces the file.
"""

from pathlib import Path

from ridgebayes.generation import generate
from ridgebayes.scene import Scene

if __name__ == "__main__":
    paper = Scene.paper()
    textures = tuple(one for one in paper.textures if one.role == "calibration")
    sweep = generate(paper.model_copy(update={"textures": textures}), solver="cylinder-fe")
    sweep.write(Path(__file__).parent / "fea" / "cylinder_sweep.csv")
