"""Time the half-plane solver: ``OMP_NUM_THREADS=1 python benchmarks/halfplane_speed.py``.

Every figure is the best of several repeats with the cache of load tables cleared before each, so
it is the solve that is timed and not the look-up.
"""

import os
import resource
import sys
import time
from collections.abc import Callable

from ridgebayes.contact.halfplane import _table, transition_loads
from ridgebayes.scene.scene import Scene
from ridgebayes.simulate.generation import generate


def best_of(repeats: int, work: Callable[[], object]) -> float:
    """Return the shortest wall time of `work` with a cold cache, in seconds."""
    times = []
    for _ in range(repeats):
        _table.cache_clear()
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times)


def main() -> None:
    scene = Scene.paper()
    generate(scene)  # warm: imports done
    nine = [(t.a_over_R, t.b_over_R) for t in scene.textures[:9]]
    rows = [
        ("paper sweep, generate()", best_of(9, lambda: generate(scene)), "0.050"),
        (
            "nine textures to Q = 20",
            best_of(9, lambda: [transition_loads(*t, 9) for t in nine]),
            "",
        ),
    ]
    for a_over_b in (0.01, 0.4, 3.2, 10.0, 100.0, 1000.0):
        seconds = best_of(3, lambda a=a_over_b: transition_loads(a, 1.0, 9))
        limit = "0.005" if 0.1 < a_over_b < 5.0 else ""
        rows.append((f"Q = 20 at a/b = {a_over_b:g}", seconds, limit))
    for a_over_b in (0.4, 1.0, 3.2):
        seconds = best_of(1, lambda a=a_over_b: transition_loads(a, 1.0, 499))
        ok = transition_loads(a_over_b, 1.0, 499).status.count("ok")
        rows.append((f"499 transitions at a/b = {a_over_b:g} ({ok} ok)", seconds, "10"))

    print(f"threads: OMP_NUM_THREADS={os.environ.get('OMP_NUM_THREADS', 'not set')}")
    print(f"{'what':<48} {'seconds':>9} {'limit':>6}")
    for what, seconds, limit in rows:
        print(f"{what:<48} {seconds:>9.4f} {limit:>6}")
    # ru_maxrss is in bytes on macOS and in KiB elsewhere.
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    print(f"peak memory: {peak / (2**20 if sys.platform == 'darwin' else 2**10):.0f} MiB")


if __name__ == "__main__":
    main()
