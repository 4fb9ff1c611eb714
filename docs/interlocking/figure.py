"""Does Q predict interlocking? ``python docs/interlocking/figure.py`` writes a CSV and a PNG.

Over the sweep's textures and loads: the largest net lateral force over a pitch, which frictionless
edges give, and the sum of G over the proximal edges of one side, both over the line load W.
"""

import math
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from scipy.stats import spearmanr

import ridgebayes as rb
from ridgebayes.scene.scene import Scene, Texture

HERE = Path(__file__).parent
LOADS = (0.001, 0.002, 0.005, 0.01, 0.015)  # up to where small strain holds
OFFSETS = tuple((np.arange(12) + 0.5) / 24)  # half a pitch; the other half is its mirror image


def of_texture(a: float, b: float) -> list[dict[str, float]]:
    """Return both quantities at each load on one texture."""
    centred = rb.edge_forces(Scene.of([(a, b)]), LOADS)
    beside = [
        rb.edge_forces(Scene(textures=(Texture(a_over_R=a, b_over_R=b, offset=o),)), LOADS)
        for o in OFFSETS
    ]
    rows = []
    for p in LOADS:
        edges = centred[centred["p_over_E"] == p]
        assert (edges["status"] == "ok").all()
        one_side = edges[(edges["ridge"] >= 0) & (edges["side"] == -1)]
        Q, load, pitch = 2 * len(one_side), 2 * p, a + b
        net = [abs(each.loc[each["p_over_E"] == p, "lateral_force"].iloc[0]) for each in beside]
        estimate = Q * pitch / math.tan(math.pi * a / (2 * pitch)) / (6 * math.pi)
        rows.append(
            {
                "a_over_R": a,
                "b_over_R": b,
                "p_over_E": p,
                "Q": Q,
                "net_over_W": max(net) / load,
                "one_sided_over_W": one_side["G"].sum() / load,
                "one_sided_estimate": estimate,
            }
        )
    return rows


def main() -> None:
    """Write the table and the figure; print rank correlations."""
    textures = [(t.a_over_R, t.b_over_R) for t in Scene.paper().textures]
    found = pd.DataFrame([row for a, b in textures for row in of_texture(a, b)])
    found.round(8).to_csv(HERE / "interlocking.csv", index=False)
    kinds = {"net_over_W": "net, over W", "one_sided_over_W": "one side's edges, over W"}
    for kind in kinds:
        rho = {x: spearmanr(found[x], found[kind])[0] for x in ("Q", "a_over_R", "b_over_R")}
        print(kind, {x: round(float(r), 2) for x, r in rho.items()})
    plt.rcParams.update({"axes.spines.top": False, "axes.spines.right": False})
    figure, axes = plt.subplots(2, 3, figsize=(8, 4.8), layout="constrained", sharey="row")
    names = {"Q": "Q", "a_over_R": "a/R", "b_over_R": "b/R"}
    for row, (kind, label) in zip(axes, kinds.items(), strict=True):
        for axis, (column, name) in zip(row, names.items(), strict=True):
            axis.scatter(found[column], found[kind], c=found["p_over_E"], s=16, cmap="viridis")
            axis.set(xlabel=name, yscale="log")
        row[0].set_ylabel(label)
    figure.colorbar(axes[0, 0].collections[0], ax=axes, label="p/E")
    figure.savefig(HERE / "interlocking.png", dpi=130)


if __name__ == "__main__":
    main()
