"""``python -m tests.wheel PYTHON DIST``: the wheel alone, in an empty environment, does its work.

With ``--lowest`` every dependency comes in the lowest version that pyproject.toml allows.
Checks its size, the main job, a run on a table, and each optional extra with and without: what
needs one says so, and works once it is there.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import ridgebayes as rb

LARGEST_WHEEL = 1_000_000  # bytes
# What asks for an extra; without it exit code 2 and a message that names it.
EXTRAS = {
    "parquet": "generate --texture 0.022,0.02 -o loads.parquet",
    "excel": "import table.xlsx -o imported.csv",
    "dask": "generate --texture 0.022,0.02 --scheduler tcp://127.0.0.1:1 -o far.csv",
}


def main() -> None:
    """Make the environment, and run."""
    python, dist, lowest = sys.argv[1], Path(sys.argv[2]).resolve(), "--lowest" in sys.argv
    (wheel,) = dist.glob("*.whl")
    assert wheel.stat().st_size < LARGEST_WHEEL, f"{wheel.stat().st_size} bytes"
    with tempfile.TemporaryDirectory() as folder:
        check(python, wheel, Path(folder), "lowest-direct" if lowest else "highest")
    among = " among the lowest versions" if lowest else ""
    print(f"{python}: {wheel.name}, {wheel.stat().st_size // 1000} kB, does its work{among}")


def check(python: str, wheel: Path, folder: Path, resolution: str) -> None:
    """Run the wheel in an environment of its own inside a folder."""
    uv = shutil.which("uv", path=Path(sys.executable).parent) or "uv"
    inside = folder / "env" / "bin" / "python"

    def install(what: str) -> None:
        choice = ["--python", inside, "--resolution", resolution]
        subprocess.run([uv, "pip", "install", "-q", *choice, what], check=True)

    def ridgebayes(line: str) -> subprocess.CompletedProcess[str]:
        words = [inside.parent / "ridgebayes", *line.split()]
        clean = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
        return subprocess.run(words, cwd=folder, env=clean, capture_output=True, text=True)

    subprocess.run([uv, "venv", "-q", "--python", python, folder / "env"], check=True)
    install(str(wheel))
    table = rb.paper_sweep().frame
    table.to_csv(folder / "mine.csv", index=False)
    table.to_excel(folder / "table.xlsx", index=False)
    for line in ("run --accuracy quick -o first", "run --accuracy quick --table mine.csv -o mine"):
        done = ridgebayes(line)
        assert done.returncode == 0, done.stderr
    assert (folder / "first" / "report.html").is_file()
    for extra, line in EXTRAS.items():
        without = ridgebayes(line)
        assert without.returncode == 2, (extra, without)
        assert f"ridgebayes[{extra}]" in without.stderr, (extra, without.stderr)
        install(f"{wheel}[{extra}]")
        there = ridgebayes(line)
        assert f"ridgebayes[{extra}]" not in there.stderr, (extra, there.stderr)
        assert extra == "dask" or there.returncode == 0, (extra, there.stderr)


if __name__ == "__main__":
    main()
