"""Draw which room uses which: ``python docs/architecture/figure.py`` writes rooms.png beside it.

Each cell counts the imports of the column's room by modules of the row's room, as the code states
them. The order is that of the contract in pyproject.toml: a number above the diagonal would be an
import against it.
"""

import tomllib
from pathlib import Path

import grimp
import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

HERE = Path(__file__).parent
ROOT = HERE.parents[1]


def rooms() -> list[str]:
    """Return the rooms in their order, from the contract that `make lint` checks."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    layers = settings["tool"]["importlinter"]["contracts"][0]["layers"]
    names = [name for layer in reversed(layers) for name in layer.split(" | ")]
    return [name for name in names if name not in ("errors", "_types")]


def counted(names: list[str]) -> np.ndarray:
    """Return how many imports of each room (column) the modules of each room (row) state."""
    graph = grimp.build_graph("ridgebayes")
    place = {name: i for i, name in enumerate(names)}
    counts = np.zeros((len(names), len(names)), dtype=int)
    for importer in graph.modules:
        for imported in graph.find_modules_directly_imported_by(importer):
            pair = [name.split(".")[1] if "." in name else "" for name in (importer, imported)]
            if all(name in place for name in pair):
                counts[place[pair[0]], place[pair[1]]] += 1
    return counts


def main() -> None:
    """Write the figure."""
    names = rooms()
    counts = counted(names)
    figure, axes = plt.subplots(figsize=(7.2, 6.4), layout="constrained")
    shade = np.where(counts > 0, np.log1p(counts), np.nan)
    axes.imshow(shade, cmap="Blues", vmin=0, vmax=1.6 * np.nanmax(shade))
    for i, j in zip(*np.nonzero(counts), strict=True):
        wrong = j > i
        axes.text(
            j,
            i,
            counts[i, j],
            ha="center",
            va="center",
            fontsize=8,
            color="#c0392b" if wrong else "#1a1a1a",
            weight="bold" if wrong else "normal",
        )
    axes.set_xticks(range(len(names)), names, rotation=60, ha="left", rotation_mode="anchor")
    axes.xaxis.tick_top()
    axes.set_yticks(range(len(names)), names)
    axes.set_xlabel("is used by the room of the row (number of imports)")
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)
    figure.savefig(HERE / "rooms.png", dpi=130)


if __name__ == "__main__":
    main()
