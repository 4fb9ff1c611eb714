"""The sliding study's figure: ``python docs/interlocking/sliding.py`` writes a PNG, prints numbers.

Net lateral force on a body off centre, over the load, from finite elements at finite strain
(`data/friction/sliding.csv`) and from the half-plane. Points are sums of the nodes' forces, crosses
differences of the potential.
"""

from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

HERE = Path(__file__).parent
KEYS = ["a_over_R", "b_over_R", "p_over_E"]
ROWS = HERE.parents[1] / "data" / "friction" / "sliding.csv"


def main() -> None:
    """Draw the figure; print how far finite elements and half-plane are apart."""
    rows = pd.read_csv(ROWS)
    still, rubbed = rows[rows["mu"] == 0], rows[rows["mu"] > 0]
    plt.rcParams.update({"axes.spines.top": False, "axes.spines.right": False})
    figure, axes = plt.subplots(1, 2, figsize=(8, 3.2), layout="constrained")
    drawn = [one for _, one in still.groupby([*KEYS, "corner_segments"]) if len(one) > 2]
    for i, one in enumerate(drawn):
        (a, b, p), color, one = one[KEYS].iloc[0], f"C{i}", one.sort_values("offset")
        label = f"({a:g}, {b:g}), p/E = {p:g}"
        axes[0].plot(one["offset"], one["half_plane_over_W"], color=color, lw=1, label=label)
        axes[0].plot(one["offset"], one["lateral_over_W"], "o", color=color, ms=3)
        peak = one["half_plane_over_W"].abs().max()
        print(f"{label}: {len(one)} rows, Q {one['Q'].min()} to {one['Q'].max()}, peak {peak:.2g}")
        for name in ("lateral_over_W", "centroid_over_W"):
            apart = (one[name] - one["half_plane_over_W"]) / peak
            print(f"  {name}: rms {np.sqrt((apart**2).mean()):.1%}, most {apart.abs().max():.1%}")
        way = (a + b) * one["offset"].to_numpy()
        force = -np.diff(one["potential_over_WR"]) / np.diff(way)
        middle = 0.5 * (one["offset"].to_numpy()[1:] + one["offset"].to_numpy()[:-1])
        axes[0].plot(middle, force, "x", color=color, ms=4)

        apart = (force - one["half_plane_over_W"].rolling(2).mean().to_numpy()[1:]) / peak
        print(f"  potential: rms {np.sqrt((apart**2).mean()):.1%}, most {np.abs(apart).max():.1%}")
    axes[0].axhline(0, color="0.7", lw=0.6)
    axes[0].set(xlabel="offset, pitches", ylabel="net force, over W", title="without friction")
    axes[0].legend(frameon=False, fontsize=6)
    for (mu, p), one in rubbed.groupby(["mu", "p_over_E"]):
        one = one.sort_values("offset")
        axes[1].plot(one["offset"], -one["lateral_over_W"], ".-", label=f"mu = {mu:g}, p/E = {p:g}")
        axes[1].axhline(mu, color="0.7", lw=0.6)
        late = -one["lateral_over_W"][one["offset"] > 0.25]
        print(f"mu = {mu:g}: {len(one)} rows to {one['offset'].max():.3f} pitches")
        print(f"  from 0.25 on: {late.mean():.4f}, {late.min():.4f} to {late.max():.4f}")
    axes[1].set(xlabel="moved, pitches", ylabel="resistance, over W", title="with friction")
    if len(rubbed):
        axes[1].legend(frameon=False, fontsize=6)
    figure.savefig(HERE / "sliding.png", dpi=130)


if __name__ == "__main__":
    main()
