"""Measure what the main job costs: ``python benchmarks/run_cost.py``.

`ridgebayes run` on the embedded sweep, into a temporary folder, in a process of its own: wall and
CPU seconds, peak memory, and the seconds of each stage as the run itself recorded them.
"""

import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from startup import ridgebayes_command


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "run"
        start = time.perf_counter()
        done = subprocess.run(
            [ridgebayes_command(), "run", "-o", str(out)], stdout=subprocess.DEVNULL, check=False
        )
        wall = time.perf_counter() - start
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        stages = json.loads((out / "run.json").read_text(encoding="utf-8"))["stages"]
        size = sum(path.stat().st_size for path in out.rglob("*") if path.is_file())
    # ru_maxrss is in bytes on macOS and in KiB elsewhere.
    peak = used.ru_maxrss / (2**20 if sys.platform == "darwin" else 2**10)
    print(f"ridgebayes run: exit code {done.returncode}")
    print(f"{'what':<16} {'measured':>10} {'wanted under':>13}")
    print(f"{'wall':<16} {wall:>8.1f} s {'60 s':>13}")
    print(f"{'CPU':<16} {used.ru_utime + used.ru_stime:>8.1f} s")
    print(f"{'peak memory':<16} {peak:>6.0f} MiB {'1024 MiB':>13}")
    print(f"{'run folder':<16} {size / 2**20:>6.1f} MiB")
    print()
    print(f"{'stage':<44} {'wall s':>7} {'CPU s':>7}")
    for stage in stages:
        print(f"{stage['name']:<44} {stage['wall_s']:>7.2f} {stage['cpu_s']:>7.2f}")


if __name__ == "__main__":
    main()
