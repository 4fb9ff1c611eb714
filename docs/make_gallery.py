"""Draw the gallery: ``python docs/make_gallery.py [NAME ...]`` runs scripts, stores their figures.

Each script of docs/gallery ends with one figure open. The site shows what is stored; tests run the
scripts and hold their figures against it.
"""

import runpy
import sys
import time
from pathlib import Path

import matplotlib as mpl

FOLDER = Path(__file__).parent / "gallery"
SCRIPTS = sorted(FOLDER.glob("*.py"))


def draw(script: Path, target: Path) -> None:
    """Run a script and write the one figure that it leaves open."""
    mpl.use("Agg")
    from matplotlib import pyplot as plt

    mpl.rcdefaults()
    plt.close("all")
    runpy.run_path(str(script))
    (number,) = plt.get_fignums()
    plt.figure(number).savefig(target, dpi=110, metadata={"Software": None})
    plt.close("all")


if __name__ == "__main__":
    for path in SCRIPTS:
        if not sys.argv[1:] or path.stem in sys.argv[1:]:
            begun = time.process_time()
            draw(path, path.with_suffix(".png"))
            print(f"{path.stem}: {time.process_time() - begun:.1f} CPU s")
