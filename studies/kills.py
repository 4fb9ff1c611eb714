"""The main job killed at random moments and resumed: are the results those of an undisturbed run?

    python -m studies.kills --n 20 --seed 1

runs `ridgebayes run --accuracy quick --noise iid` on three textures of the study, but with
posteriors walked (over 20 autocorrelation times), to its end. Then it kills that (SIGKILL) at `n`
moments drawn evenly from the CPU seconds it took, resumes each with ``--resume``, and compares
every file with those of the undisturbed run. What runs do not share is left out: seconds
(costs.csv, its section of the reports, the stages of run.json). One row a kill goes to
docs/validation/kills.csv: the moment, the last stage that was done, files that were there, chains
that were taken up with their steps, and whether all bytes are the same.
"""

import argparse
import os
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
import pandas as pd

import ridgebayes as rb
from tests.hard_cases.machine import run_contents

TEXTURES = ((0.012, 0.03), (0.022, 0.02), (0.032, 0.01))
# A quick run that walks; it says which chain files a resumed run takes up.
PROGRAM = """
import dataclasses
import sys
from ridgebayes.inference import presets as accuracies
from ridgebayes.commands import cli
from ridgebayes.inference.checkpoint import Checkpoint
accuracies.PRESETS["quick"] = dataclasses.replace(accuracies.QUICK, walks=True, n_tau=20.0)
load = Checkpoint.load
def loading(checkpoint):
    walk = load(checkpoint)
    if walk is not None:
        print(f"TAKEN {checkpoint.path.stem.removeprefix('chains-')} {walk.n_step}",
              file=sys.stderr, flush=True)
    return walk
Checkpoint.load = loading
if __name__ == "__main__":
    cli.main()
"""


def main() -> None:
    options = parsed()
    rows = []
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        (folder / "program.py").write_text(PROGRAM, encoding="utf-8")
        table(folder / "table.csv")
        begun = os.times()
        done = run(folder, "undisturbed")
        ended = os.times()
        assert done.returncode == 0, done.stderr
        whole = ended[2] + ended[3] - begun[2] - begun[3]  # of children
        expected = run_contents(folder / "undisturbed")
        print(f"undisturbed: {whole:.1f} s, {len(expected)} files", flush=True)
        moments = np.random.default_rng(options.seed).uniform(0, whole, options.n)
        for seconds in moments:
            rows.append({"seed": options.seed, **killed(folder, float(seconds), expected)})
            print(rows[-1], flush=True)
            options.out.mkdir(parents=True, exist_ok=True)
            pd.DataFrame(rows).to_csv(options.out / "kills.csv", index=False)
    if not all(row["same_bytes"] for row in rows):
        raise SystemExit("not all the same")


def parsed() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m studies.kills")
    parser.add_argument("--n", type=int, default=20, help="kills")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("docs/validation"))
    return parser.parse_args()


def table(path: Path) -> None:
    frame = rb.paper_sweep().frame
    pairs = zip(frame["a_over_R"], frame["b_over_R"], strict=True)
    rb.ContactTable.from_frame(frame[[pair in TEXTURES for pair in pairs]]).write(path)


def words(out: str) -> list[str]:
    given = ["--table", "table.csv", "--forms", "modified,hybrid", "--noise", "iid"]
    return [sys.executable, "program.py", "run", *given, "--accuracy", "quick", "-o", out]


def run(folder: Path, out: str, *more: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*words(out), *more], cwd=folder, capture_output=True, text=True, check=False
    )


def spent(pid: int) -> float:
    """Return the CPU seconds of a process: a busy machine does not change them."""
    with suppress(FileNotFoundError):
        fields = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    return np.inf


def killed(folder: Path, seconds: float, expected: dict[str, str]) -> dict[str, object]:
    """Kill one run, resume it, and say what came of it."""
    out = folder / "killed"
    with subprocess.Popen(
        words(out.name), cwd=folder, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True
    ) as process:
        while process.poll() is None and spent(process.pid) < seconds:
            time.sleep(0.01)
        process.send_signal(signal.SIGKILL)
        said = process.stderr.read()
        code = process.wait()
    partial = folder / ".killed.partial"
    kept = sorted(path.name for path in partial.iterdir()) if partial.is_dir() else []
    finished = out.exists()  # a busy machine's clock may let a run end first
    told = [line for line in said.splitlines() if ": " in line]
    again = run(folder, out.name, "--resume", *(["--force"] if finished else []))
    assert again.returncode == 0, again.stderr
    taken = [line.split() for line in again.stderr.splitlines() if line.startswith("TAKEN")]
    found = {
        "cpu_seconds": round(seconds, 2),
        "exit_code": code,
        "after_stage": told[-1].partition(":")[0] if told else "start",
        "files_kept": len(kept),
        "chains_resumed": " ".join(f"{form}:{steps}" for _, form, steps in taken) or "none",
        "same_bytes": run_contents(out) == expected,
        "left_behind": len(list(folder.glob(".killed*"))),
    }
    for path in sorted(out.rglob("*"), reverse=True):
        path.rmdir() if path.is_dir() else path.unlink()
    out.rmdir()
    return found


if __name__ == "__main__":
    main()
