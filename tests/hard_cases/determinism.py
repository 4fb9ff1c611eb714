"""Edge cases of reproducibility: the same numbers from other runs, processes and machines.

Equal bytes are guaranteed on one machine in one environment, so only runs of one session are
compared byte by byte. On other machines numbers agree within tolerances.
`python -m tests.hard_cases.determinism` from the repository's root writes the reference numbers to
tests/hard_cases/reference/numbers.json.
"""

import functools
import hashlib
import json
import math
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

import ridgebayes as rb
from ridgebayes import generate
from ridgebayes.model.forms import form_named
from ridgebayes.model.model import Model
from ridgebayes.model.observations import Observations
from ridgebayes.runtime.pool import workers
from tests.hard_cases.case import hard_case
from tests.hard_cases.likelihood import weighed
from tests.hard_cases.machine import ROOT, run_contents

REFERENCE = Path(__file__).parent / "reference" / "numbers.json"
FORMS = ("classic", "modified", "hybrid")
TEXTURES = ((0.012, 0.03), (0.022, 0.02), (0.032, 0.01))
SCENE = rb.Scene.of(list(TEXTURES), p_over_E=0.01)
SETTINGS = rb.SampleSettings(n_walker=32, n_step_max=3000)
# A whole small pipeline: loads, two posteriors walked, evidences, bands, a report.
PIPELINE = """
import sys
from pathlib import Path
import ridgebayes as rb
from ridgebayes.comparison import compare
from ridgebayes.comparison.bands import bands_table
from ridgebayes.commands.run_folder import write_csv
from ridgebayes.evidence import prior_sensitivity
prior_sensitivity.scale_factors = lambda prior: (1.0, 1.8)
textures = [(0.012, 0.03), (0.022, 0.02), (0.032, 0.01)]
rb.generate(rb.Scene.of(textures, p_over_E=0.01)).write("t.csv")
settings = rb.SampleSettings(n_walker=16, n_step_max=300)
what = {"forms": ["modified", "hybrid"], "noise": "iid", "settings": settings}
done = rb.run("t.csv", "out", rng=3, command="compare", **what)
write_csv(bands_table(done), Path("out", "bands.csv"))
rb.write_report(done, "out/report.md")
"""


THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")
PLAIN = {"PYTHONHASHSEED": "1", "TZ": "UTC", "LC_ALL": "C"} | dict.fromkeys(THREADS, "1")
OTHER = {"PYTHONHASHSEED": "4242", "TZ": "Pacific/Chatham", "LC_ALL": "C.UTF-8", "LANG": "de_DE"}
OTHER |= dict.fromkeys(THREADS, "2")


def elsewhere(environment: dict[str, str]) -> dict[str, str]:
    path = os.pathsep.join([str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])])
    given = {**os.environ, "PYTHONPATH": path, **environment}
    with tempfile.TemporaryDirectory() as scratch:
        command = [sys.executable, "-c", PIPELINE]
        done = subprocess.run(
            command, cwd=scratch, env=given, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
        digest = hashlib.sha256(Path(scratch, "t.csv").read_bytes()).hexdigest()
        return {"t.csv": digest, **run_contents(Path(scratch, "out"))}


@hard_case(
    "The same seed with another hash seed, time zone, locale and number of BLAS threads",
    why="The order of sets, the decimal comma and the time zone differ between processes. They "
    "can change sums, texts and file names. A sum over threads adds in another order.",
    expected="Every file of loads, posteriors, evidences, bands and report has the same bytes "
    "(exact, apart from times): the matrices are too small for threads.",
    long=True,
)
def environments():
    first, other = elsewhere(PLAIN), elsewhere(OTHER)
    assert first == other
    return f"{len(first)} files, the same bytes"


@hard_case(
    "One process and two workers",
    why="Workers finish in any order, each with its own random state.",
    expected="The table of loads has the same bytes from this process, one worker and two (exact).",
)
def shared_out(folder):
    scene = rb.Scene.of([(0.012 + 0.002 * i, 0.03 - 0.001 * i) for i in range(8)], p_over_E=0.006)
    found = []
    generate(scene).write(folder / "0.csv")
    for n in (1, 2):
        with workers(n) as pool:
            generate(scene, executor=pool).write(folder / f"{n}.csv")
    found = {(folder / f"{n}.csv").read_bytes() for n in range(3)}
    assert len(found) == 1
    return "three tables, the same bytes"


@hard_case(
    "A run in one process and with two workers",
    why="Workers get pickled copies. Arrays then have another memory layout, caches are empty, "
    "and sums over other strides differ in the last digit.",
    expected="Every file has the same bytes: posteriors, bands, figures and reports (exact, apart "
    "from times).",
    long=True,
)
def run_shared_out(folder):
    generate(SCENE).write(folder / "t.csv")
    found = {}
    for n in (1, 2):
        # With shared offsets, which is where factors are kept.
        what = {"forms": ["modified", "hybrid"], "noise": "step-smooth", "accuracy": "quick"}
        rb.run(folder / "t.csv", folder / str(n), workers=n, **what)
        found[n] = run_contents(folder / str(n))
    assert found[1] == found[2]
    return f"{len(found[1])} files, the same bytes"


@hard_case(
    "Forms and textures in another order",
    why="If parts share one random stream, or sums follow the order given, a comparison depends "
    "on the order of its parts.",
    expected="Draws and evidences of each form are the same to the last bit, and so are the loads "
    "of each texture.",
    long=True,
)
def other_order():
    table = generate(SCENE)
    one, other = (
        rb.compare(
            table, [form_named(name) for name in names], rng=7, settings=SETTINGS, noise="iid"
        )
        for names in (("classic", "modified"), ("modified", "classic"))
    )
    for name in one.fits:
        assert one.fits[name].draws.tobytes() == other.fits[name].draws.tobytes()
        mine, theirs = (
            done.evidence[done.evidence["form"] == name]["log_evidence"].tolist()
            for done in (one, other)
        )
        assert mine == theirs
    back = generate(rb.Scene.of(list(TEXTURES[::-1]), p_over_E=0.01)).frame
    keys = ["a_over_R", "b_over_R", "Q"]
    mine, theirs = (
        frame.sort_values(keys)["p_over_E"].to_numpy().tobytes() for frame in (table.frame, back)
    )
    assert mine == theirs
    return f"{len(one.fits)} forms and {len(TEXTURES)} textures, the same bits"


# --- other machines -------------------------------------------------------------------------------


@functools.cache
def numbers() -> dict[str, object]:
    """Compute what the reference file holds."""
    table = generate(SCENE)
    data = Observations.from_table(rb.paper_sweep())
    evidences = {}
    for name in FORMS:
        model = Model(data, form_named(name))
        found = weighed(model)
        evidences[name] = found.value, found.se
    fit = rb.calibrate(rb.paper_sweep(), rb.Hybrid(), rng=11, settings=SETTINGS, noise="iid")
    columns = ("mean", "sd", "mcse_mean")
    return {
        "loads": table.column("p_over_E").tolist(),
        "evidences": evidences,
        "summary": {
            row["parameter"]: {name: float(row[name]) for name in columns}
            for row in fit.summary.to_dict("records")
        },
    }


def reference() -> dict:
    return json.loads(REFERENCE.read_text(encoding="utf-8"))


@hard_case(
    "Loads and evidences on other machines and other versions of Python and NumPy",
    why="Another processor or linear-algebra library adds in another order. A solver that stops "
    "at a tolerance may then stop a step earlier.",
    expected="Loads are within a relative 2e-8 of the committed file, and log evidences "
    "within 6 standard errors of both.",
)
def other_machines():
    kept, here = reference(), numbers()
    loads = np.abs(np.array(here["loads"]) / np.array(kept["loads"]) - 1)
    assert loads.max() < 2e-8
    for name in FORMS:
        (mine, se), (other, other_se) = here["evidences"][name], kept["evidences"][name]
        assert abs(mine - other) < 6 * math.hypot(se, other_se) < 0.1
    return f"{len(loads)} loads within 2e-8, {len(FORMS)} log evidences"


@hard_case(
    "Chains on other machines and other versions of Python and NumPy",
    why="The last digit of a logarithm can make one machine accept a move that another rejects. "
    "From there on the chains differ, so equal bytes cannot be guaranteed.",
    expected="Means and sds of the committed file and of these chains agree within 6 Monte Carlo "
    "standard errors of both.",
)
def other_chains():
    kept, here = reference(), numbers()
    assert here["summary"].keys() == kept["summary"].keys()
    for name, mine in here["summary"].items():
        other = kept["summary"][name]
        error = np.hypot(mine["mcse_mean"], other["mcse_mean"])
        assert abs(mine["mean"] - other["mean"]) <= 6 * error
        # An sd is uncertain by sd / sqrt(2 n), n = (sd / mcse)^2 draws that count.
        assert abs(mine["sd"] - other["sd"]) <= 6 * error / math.sqrt(2)
    return f"{len(here['summary'])} parameters"


def main() -> None:
    """Write the reference file."""
    REFERENCE.parent.mkdir(exist_ok=True)
    REFERENCE.write_text(json.dumps(numbers(), indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
