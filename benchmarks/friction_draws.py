"""Time joint draws for friction models: ``python benchmarks/friction_draws.py [N ...]``.

N draws (10,000, 100,000 and a million unless given) of an uncertain fingertip at 20 loads, streamed
to Parquet: CPU seconds, the process's largest memory so far, size of the file.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import resource
import sys
import tempfile
import time
from pathlib import Path

import ridgebayes as rb
from ridgebayes.friction.files import write_inputs
from ridgebayes.friction.inputs import InputDraws

SCENE = """
[body]
radius = "normal(8 mm, 5 %)"
youngs_modulus = "lognormal(60 kPa, 20 %)"
poissons_ratio = 0.45
[texture]
ridge_width = "0.18 mm"
groove_width = "normal(0.16 mm, 3 %)"
[load]
max = "lognormal(0.6 kPa, 10 %)"
"""


def main() -> None:
    """Print a line for each number of draws."""
    sizes = [int(n) for n in sys.argv[1:]] or [10_000, 100_000, 1_000_000]
    fit = rb.calibrate(rb.paper_sweep(), rb.Hybrid(), noise="iid", rng=1)
    with tempfile.TemporaryDirectory() as folder:
        scene, target = Path(folder) / "scene.toml", Path(folder) / "draws.parquet"
        scene.write_text(SCENE)
        print("draws      CPU s  largest memory MiB  file MB")
        for n in sizes:
            start = time.process_time()
            write_inputs(InputDraws(fit, scene, 20, n=n, rng=1).blocks(), target)
            spent = time.process_time() - start
            memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
            print(f"{n:9,d}  {spent:5.1f}  {memory:.0f}  {target.stat().st_size / 1e6:.0f}")


if __name__ == "__main__":
    main()
