"""Measure CPU seconds of starting up: ``python benchmarks/startup.py``.

`import ridgebayes`, `ridgebayes --help` and, for comparison, an interpreter that does nothing; each
in a process of its own, user and system time together. Medians of five after one that is thrown
away.
"""

import resource
import shutil
import statistics
import subprocess
import sys
from pathlib import Path

REPEATS = 5


def cpu_seconds(command: list[str]) -> float:
    """Return the CPU seconds of a command, its children included."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def ridgebayes_command() -> str:
    """Return the command of the environment that runs this script."""
    beside = Path(sys.executable).parent / "ridgebayes"
    found = str(beside) if beside.exists() else shutil.which("ridgebayes")
    if found is None:
        raise SystemExit("no `ridgebayes` command: install the package first")
    return found


def main() -> None:
    cases = [
        ("python -c ''", [sys.executable, "-c", ""], None),
        ("import ridgebayes", [sys.executable, "-c", "import ridgebayes"], 0.3),
        ("ridgebayes --help", [ridgebayes_command(), "--help"], 0.5),
    ]
    print(f"{'what':<20} {'CPU s':>6} {'wanted under':>12}")
    for what, command, wanted in cases:
        cpu_seconds(command)
        median = statistics.median(cpu_seconds(command) for _ in range(REPEATS))
        print(f"{what:<20} {median:>6.3f} {'' if wanted is None else wanted:>12}")


if __name__ == "__main__":
    main()
