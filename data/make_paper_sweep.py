"""Make `paper_sweep.csv`: the study's nine textures to p/E 0.02, the extreme one to 0.045.

Run it from anywhere: ``python data/make_paper_sweep.py``. It computes with `simulate.generation`
and replaces the file beside it.
"""

from pathlib import Path

from ridgebayes.scene.scene import Scene
from ridgebayes.simulate.generation import generate

if __name__ == "__main__":
    generate(Scene.paper()).write(Path(__file__).parent / "paper_sweep.csv")
