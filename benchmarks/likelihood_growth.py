"""Time a likelihood call against the number of rows: ``python benchmarks/likelihood_growth.py``.

Tables of nine textures with 50 to a million rows, Hybrid, independent noise. A call is
`Model.log_likelihood` on 64 draws, after the table has been read and its rows have been summed up
per texture. Best of many repeats, in microseconds, and the ratio to 50 rows.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import time

import numpy as np

import ridgebayes as rb
from ridgebayes.model.model import Model, Observations

ROWS = (50, 1_000, 10_000, 100_000, 1_000_000)
N_DRAW, REPEATS, CALLS = 64, 15, 200


def observations(n: int, rng: np.random.Generator) -> Observations:
    """Return n noisy loads spread over the nine textures of the embedded sweep."""
    textures = rb.paper_sweep().calibration.textures
    index = np.arange(n) % len(textures)
    Q = 4 + 2 * rng.integers(0, 5, n)
    a, b = np.array(textures)[index].T
    log_load = np.log(rb.Hybrid().load(Q, a, b)) + 0.03 * rng.standard_normal(n)
    labels = tuple(f"texture {j}" for j in range(len(textures)))
    known, bracket, is_count = np.zeros(n), np.full(n, np.nan), np.zeros(n, dtype=bool)
    return Observations(textures, index, Q, log_load, known, bracket, is_count, labels)


def main() -> None:
    rng = np.random.default_rng(0)
    theta = np.array([1.348, 0.016, 0.03]) * (1 + 0.01 * rng.standard_normal((N_DRAW, 3)))
    models = {n: Model(observations(n, rng), rb.Hybrid()) for n in ROWS}
    best = dict.fromkeys(ROWS, np.inf)
    for _ in range(REPEATS):  # in turn, so that a slow moment of the machine hits all alike
        for n, model in models.items():
            start = time.process_time()
            for _ in range(CALLS):
                model.log_likelihood(theta)
            best[n] = min(best[n], (time.process_time() - start) / CALLS)
    print(f"log_likelihood of {N_DRAW} draws, nine textures; wanted: ratio of at most 1.5")
    print(f"{'rows':>9} {'us a call':>10} {'ratio':>6}")
    for n, seconds in best.items():
        print(f"{n:>9} {1e6 * seconds:>10.1f} {seconds / best[ROWS[0]]:>6.2f}")


if __name__ == "__main__":
    main()
