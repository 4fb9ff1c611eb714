"""Measure what the main job costs: ``python benchmarks/run_cost.py``.

`ridgebayes run` on the embedded sweep, into a temporary folder, in a process of its own: wall
seconds, and as the run itself recorded them the peak memory of all its processes (proportional set
sizes; Linux only) and the seconds of each stage.
"""

import json
import subprocess
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
        told = json.loads((out / "run.json").read_text(encoding="utf-8"))
        size = sum(path.stat().st_size for path in out.rglob("*") if path.is_file())
    peak = told["peak_memory_bytes"]
    print(f"ridgebayes run: exit code {done.returncode}")
    print(f"{'what':<16} {'measured':>10} {'wanted under':>13}")
    print(f"{'wall':<16} {wall:>8.1f} s {'60 s':>13}")
    if peak is not None:
        print(f"{'peak memory':<16} {peak / 2**20:>6.0f} MiB {'1024 MiB':>13}")
    print(f"{'run folder':<16} {size / 2**20:>6.1f} MiB")
    print()
    print(f"{'stage':<44} {'wall s':>7}")
    for stage in told["stages"]:
        print(f"{stage['name']:<44} {stage['wall_s']:>7.2f}")


if __name__ == "__main__":
    main()
