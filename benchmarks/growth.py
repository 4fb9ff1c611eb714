"""Time how costs grow: ``python benchmarks/growth.py [OUT]``.

CPU seconds against rows, textures, counts, draws and walkers, the best of three runs each, with the
exponent fitted to the upper half of each curve. OUT gets ``growth.csv`` and ``growth.png``.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd

import ridgebayes as rb
from ridgebayes.contact.halfplane import forget_loads, transition_loads
from ridgebayes.drawing.style import new_figure, save, styled
from ridgebayes.inference.chains import SampleSettings
from ridgebayes.inference.importance import Effort, importance_sample
from ridgebayes.inference.latent import LatentIntegral
from ridgebayes.inference.target import ModelTarget
from ridgebayes.model.model import Model
from ridgebayes.model.observations import Observations
from ridgebayes.predict.predict import predict_q, q_places

REPEATS = 3
LONG = 5.0  # seconds: what takes longer runs once


def observations(n_row: int, n_texture: int) -> Observations:
    """Return noisy loads of random textures, rows spread evenly over them."""
    rng = np.random.default_rng(0)
    a, b = rng.uniform(0.005, 0.05, (2, n_texture))
    texture = np.arange(n_row) % n_texture
    Q = 4 + 2 * rng.integers(0, 9, n_row)
    load = rb.Hybrid().load(Q, a[texture], b[texture])
    log_load = np.log(load) + 0.03 * rng.standard_normal(n_row)
    return Observations(
        tuple(zip(a.tolist(), b.tolist(), strict=True)),
        texture,
        Q,
        log_load,
        np.zeros(n_row),
        np.full(n_row, np.nan),
        np.zeros(n_row, dtype=bool),
        tuple(f"texture {i}" for i in range(n_texture)),
    )


def likelihood(n_row: int, n_texture: int) -> Callable[[], object]:
    model = Model(observations(n_row, n_texture), rb.Hybrid())
    rng = np.random.default_rng(0)
    theta = np.array([1.348, 0.016, 0.03]) * (1 + 0.01 * rng.standard_normal((64, 3)))
    integral, u = LatentIntegral(model), model.to_scores(theta)
    return lambda: integral.estimated(u, rng, 8)


def half_plane(Q: int) -> Callable[[], object]:
    def solve() -> object:
        forget_loads()
        return transition_loads(1.0, 1.0, Q // 2 - 1)

    return solve


def importance(n: int) -> Callable[[], object]:
    model = Model(Observations.from_table(rb.paper_sweep()), rb.Hybrid())
    # Four sets, of four times as many draws where densities are exact.
    return lambda: importance_sample(ModelTarget(model), Effort(n_draw=n // 16), 0)


def walk(n_walker: int) -> Callable[[], object]:
    settings = SampleSettings(n_walker=n_walker, tau_change=0.1)
    return lambda: rb.calibrate(
        rb.paper_sweep(), rb.Hybrid(), rng=0, settings=settings, noise="iid"
    )


def bands(n: int) -> Callable[[], object]:
    fit = rb.calibrate(rb.paper_sweep(), rb.Hybrid(), rng=0, noise="iid")
    n_texture = min(1_000, max(1, n // 100))
    a, b = np.random.default_rng(0).uniform(0.01, 0.04, (2, n_texture, 1))
    loads = np.geomspace(5e-4, 0.02, n // n_texture)
    return lambda: predict_q(fit, q_places(a, b, loads))


CURVES: dict[str, tuple[str, tuple[int, ...], Callable[[int], Callable[[], object]]]] = {
    "rows": (
        "a likelihood of 64 draws, nine textures",
        (50, 1_000, 10_000, 100_000, 1_000_000),
        lambda n: likelihood(n, 9),
    ),
    "textures": (
        "a likelihood of 64 draws, ten rows each",
        (1, 10, 100, 1_000, 10_000, 100_000),
        lambda n: likelihood(10 * n, n),
    ),
    "Q": ("half-plane loads up to Q, a = b", (4, 10, 20, 50, 100, 300, 1_000), half_plane),
    "draws": (
        "importance draws, adaptation included",
        (512, 4_096, 32_768, 262_144),
        importance,
    ),
    "walkers": ("a calibration, 4 ensembles", (16, 32, 64, 128, 256, 512, 1_024), walk),
    "places": (
        "bands at textures x loads, nodes",
        (100, 1_000, 10_000, 100_000, 1_000_000),
        bands,
    ),
}


def best_of(work: Callable[[], object]) -> float:
    """Return CPU seconds of a call, of many calls where one is too short to be timed."""
    n_call, found = 1, []
    for _ in range(REPEATS + 1):
        start = time.process_time()
        for _ in range(n_call):
            work()
        seconds = (time.process_time() - start) / n_call
        found.append(seconds)
        n_call = max(1, min(1_000, int(0.05 / max(seconds, 1e-6))))
        if seconds > LONG:
            break
    return min(found)


@styled()
def drawn(frame: pd.DataFrame) -> object:
    figure = new_figure(7.0, 4.2)
    axes = figure.subplots()
    for (of, what), part in frame.groupby(["of", "what"], sort=False):
        power = part["exponent"].iloc[0]
        label = f"{of}: {what} (power {power:.2f})"
        axes.plot(part["n"], part["cpu_s"], marker="o", markersize=3, linewidth=1, label=label)
    axes.set(xscale="log", yscale="log", xlabel="number", ylabel="CPU seconds")
    figure.legend(loc="outside lower center", fontsize=7)
    return figure


def main() -> None:
    rows = []
    print(f"{'of':<16} {'n':>9} {'CPU s':>10}")
    for of, (what, numbers, make) in CURVES.items():
        seconds = []
        for n in numbers:
            seconds.append(best_of(make(n)))
            print(f"{of:<16} {n:>9} {seconds[-1]:>10.2g}", flush=True)
        upper = slice(len(numbers) // 2, None)
        exponent = np.polyfit(np.log(numbers[upper]), np.log(seconds[upper]), 1)[0]
        print(f"{of:<16} power {exponent:.2f} of the upper half: {what}")
        rows += [(of, what, n, s, exponent) for n, s in zip(numbers, seconds, strict=True)]
    frame = pd.DataFrame(rows, columns=["of", "what", "n", "cpu_s", "exponent"])
    if len(sys.argv) > 1:
        out = Path(sys.argv[1])
        out.mkdir(parents=True, exist_ok=True)
        frame.to_csv(out / "growth.csv", index=False, lineterminator="\n")
        save(drawn(frame), out / "growth")


if __name__ == "__main__":
    main()
