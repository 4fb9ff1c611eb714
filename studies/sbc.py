"""Long runs of simulation-based calibration, and the record that is kept of them.

    python -m studies.sbc --form hybrid --noise texture+step --n 300 --jobs 2

draws 300 sets of parameters from the prior, simulates the rows of the paper's sweep under each,
fits them with the sampler that `calibrate` runs, and writes into docs/validation/ the ranks (CSV),
their figure (PNG), and when, where and with what it was made (JSON). `--form all --noise all`
takes every combination; `--fit importance` the faster engine.
"""

import argparse
import hashlib
import json
import os
import platform
import time
from concurrent.futures import Executor, ProcessPoolExecutor
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

import ridgebayes as rb
from ridgebayes.drawing.style import as_bytes
from ridgebayes.model.forms import FORMS, form_named
from ridgebayes.model.noise import Noise
from ridgebayes.model.observations import Observations
from studies.calibration_check import SBC, sbc
from studies.uniformity_figure import plot_uniformity

_PACKAGES = ("ridgebayes", "numpy", "scipy", "pandas", "emcee", "arviz", "matplotlib")
_BATCH = 50


def main() -> None:
    options = parsed()
    forms = list(FORMS) if options.form == "all" else options.form.split(",")
    every = [noise.name for noise in Noise.every()]
    noises = every if options.noise == "all" else options.noise.split(",")
    data = Observations.from_table(rb.paper_sweep())
    options.out.mkdir(parents=True, exist_ok=True)
    with ProcessPoolExecutor(options.jobs) as executor:
        for form in forms:
            for noise in noises:
                together(data, form, noise, executor, options)


def together(
    data: Observations, form: str, noise: str, executor: Executor, options: argparse.Namespace
) -> None:
    """Run one combination batch by batch; a run that is broken off leaves what it has done."""
    found, start = None, time.perf_counter()
    for first in range(0, options.n, _BATCH):
        batch = sbc(
            data,
            form_named(form),
            noise,
            n_replicate=min(_BATCH, options.n - first),
            first=first,
            rng=options.seed,
            fit=options.fit,
            executor=executor,
        )
        found = batch if found is None else found + batch
        record(found, options, time.perf_counter() - start)


def parsed() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m studies.sbc")
    parser.add_argument("--form", default="hybrid", help="names with commas between, or all")
    parser.add_argument("--noise", default="texture+step", help="names with commas, or all")
    parser.add_argument("--fit", default="walk", choices=["walk", "importance"])
    parser.add_argument("--n", type=int, default=300, help="simulated sets of rows")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--out", type=Path, default=Path("docs/validation"))
    return parser.parse_args()


def record(found: SBC, options: argparse.Namespace, seconds: float) -> None:
    """Write ranks, figure and circumstances, and say what came of it."""
    stem = f"sbc-{found.form}-{found.noise.replace(':', '-')}-{found.engine}"
    found.ranks.to_csv(options.out / f"{stem}.csv", index=False)
    verdict = found.verdict()
    uniformities = found.uniformity()
    image = as_bytes(plot_uniformity(uniformities), "png")
    (options.out / f"{stem}.png").write_bytes(image)
    about = {
        "form": found.form,
        "noise": found.noise,
        "table": "paper_sweep.csv",
        "engine": found.engine,
        "n_replicate": found.n_replicate,
        "n_draw": int(found.ranks["n_draw"].iloc[0]),
        "seed": options.seed,
        "verdict": str(verdict),
        "p_value": verdict.p_value,
        "p_values": {name: one.p_value for name, one in uniformities.items()},
        "n_failed": verdict.n_failed,
        "p_value_with_failed": found.verdict(unconverged=True).p_value,
        "failures": found.failures.to_dict("records"),
        **circumstances(options.jobs, seconds),
    }
    (options.out / f"{stem}.json").write_text(json.dumps(about, indent=1) + "\n")
    print(f"{stem}: {verdict}, {seconds:.0f} s", flush=True)


def circumstances(jobs: int, seconds: float) -> dict[str, object]:
    """Return when, where and with what a record was made."""
    source = hashlib.sha256()
    home = Path(rb.__file__).parent
    for file in sorted(home.rglob("*.py")):
        source.update(file.relative_to(home).as_posix().encode() + file.read_bytes())
    return {
        "date": datetime.now(UTC).date().isoformat(),
        "seconds": round(seconds),
        "jobs": jobs,
        "machine": f"{platform.system()} {platform.machine()}, {os.cpu_count()} cores",
        "python": platform.python_version(),
        "versions": {name: version(name) for name in _PACKAGES},
        "source_sha256": source.hexdigest(),
    }


if __name__ == "__main__":
    main()
