"""Draw the README's figure: ``python docs/make_readme_figure.py`` writes docs/images/readme.png.

The Hybrid form is fitted to the nine calibration textures of the embedded sweep. Drawn are a
texture that was fitted and the extreme one that was held out.
"""

from pathlib import Path

import matplotlib as mpl
import numpy as np

import ridgebayes as rb

OUT = Path(__file__).parent / "images" / "readme.png"
PANELS = (((0.022, 0.02), "fitted"), ((0.012, 0.09), "held out"))


def main() -> None:
    """Fit, predict, draw."""
    mpl.use("Agg")
    from matplotlib import pyplot as plt
    from matplotlib.ticker import MaxNLocator, MultipleLocator

    table = rb.paper_sweep()
    fit = rb.calibrate(table, rb.Hybrid(), rng=1, noise="iid")
    rows = table.frame
    plt.rcParams.update({"font.size": 11, "axes.spines.top": False, "axes.spines.right": False})
    figure, axes = plt.subplots(1, 2, figsize=(8, 3.7), layout="constrained", sharey=True)
    for axis, ((a, b), role) in zip(axes, PANELS, strict=True):
        solved = rows[(rows["a_over_R"] == a) & (rows["b_over_R"] == b)]
        loads = np.linspace(1e-5, 1.12 * solved["p_over_E"].max(), 4_000)
        q = fit.predict(a, b, loads)
        lower, upper = q.interval(0.9)
        axis.fill_between(
            loads, lower, upper, color="#9ec9e2", lw=0, label="Hybrid form, 90 % band"
        )
        axis.plot(loads, q.median(), color="#1b6ca8", lw=1.6, label="Hybrid form, median")
        axis.plot(
            solved["p_over_E"],
            solved["Q"],
            "o",
            color="#d1495b",
            ms=6,
            label="half-plane solver: load that reaches Q",
        )
        axis.set_title(f"a/R = {a:g}, b/R = {b:g} ({role})", fontsize=11)
        axis.set_xlabel("load p/E")
        axis.set_xlim(0, loads[-1])
        axis.xaxis.set_major_locator(MaxNLocator(4))
    axes[0].set_ylabel("proximal edges in contact Q")
    axes[0].yaxis.set_major_locator(MultipleLocator(2))
    axes[0].set_ylim(bottom=1.5)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False, fontsize=10)
    OUT.parent.mkdir(exist_ok=True)
    figure.savefig(OUT, dpi=150, metadata={"Software": None})
    print(OUT)


if __name__ == "__main__":
    main()
