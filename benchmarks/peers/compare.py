"""Run the same posteriors through other samplers: ``python benchmarks/peers/compare.py -o OUT``.

The 41 calibration rows of the embedded sweep, with three posteriors (see `target.py`), go through
every peer. Each has an environment of its own, made on the way, and a script ``with_*.py`` that
states its settings and why. Writes ``peers.csv`` and ``peers.png``. Measures, asserts nothing.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import json
import math
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from environments import OWN, Environments, NoEnvironmentError, one_thread
from figure import plot_peers
from target import FORMS, Target
from with_ridgebayes import MODELS

import ridgebayes as rb
from ridgebayes.drawing.style import as_bytes
from ridgebayes.inference.importance import Effort, importance_sample
from ridgebayes.inference.latent import LatentIntegral
from ridgebayes.inference.posterior import posterior_of
from ridgebayes.inference.target import ModelTarget
from ridgebayes.model.model import Model
from ridgebayes.model.noise import Noise
from ridgebayes.model.observations import Observations
from ridgebayes.runtime.quiet import import_arviz

HERE = Path(__file__).resolve().parent
COLUMNS = (
    "form",
    "peer",
    "status",
    "versions",
    "rounds",
    "cpu_s",
    "wall_s",
    "import_cpu_s",
    "compile_cpu_s",
    "draws",
    "ess",
    "ess_per_cpu_s",
    "parameters",
    "means",
    "sds",
    "mean_off",
    "mean_off_in_errors",
    "sd_off",
    "ln_Z",
    "ln_Z_se",
    "ln_Z_off",
    "ln_Z_cpu_s",
    "ln_Z_reference",
    "reference",
)
LONGEST = 1_200  # seconds after which a run is given up
N_REFERENCE = 163_840  # draws of each of the four proposals that the reference is made of


@dataclass(frozen=True)
class Peer:
    """A script, the environment that it runs in, and which of its settings."""

    name: str
    script: str
    environment: str
    variant: str = ""


PEERS = {
    peer.name: peer
    for peer in (
        Peer("ridgebayes", "with_ridgebayes.py", OWN),
        Peer("emcee", "with_emcee.py", "emcee", "plain"),
        Peer("emcee-vectorised", "with_emcee.py", "emcee", "vectorised"),
        Peer("emcee-de", "with_emcee.py", "emcee", "de"),
        Peer("emcee-de-128", "with_emcee.py", "emcee", "de-128"),
        Peer("zeus", "with_zeus.py", "zeus"),
        Peer("pymc", "with_pymc.py", "pymc"),
        Peer("nutpie", "with_nutpie.py", "nutpie", "diagonal"),
        Peer("nutpie-low-rank", "with_nutpie.py", "nutpie", "low-rank"),
        Peer("dynesty", "with_dynesty.py", "dynesty"),
        Peer("ultranest", "with_ultranest.py", "ultranest"),
        Peer("nautilus", "with_nautilus.py", "nautilus"),
        Peer("bilby", "with_bilby.py", "bilby"),
    )
}


@dataclass(frozen=True)
class Reference:
    """What a peer's posterior and evidence are held against."""

    names: tuple[str, ...]
    mean: np.ndarray
    sd: np.ndarray
    ln_Z: float
    ln_Z_se: float
    method: str


class FailedError(Exception):
    """A run that ended without a result."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="+", choices=PEERS, default=list(PEERS), metavar="NAME")
    parser.add_argument("--form", nargs="+", choices=FORMS, default=list(FORMS), metavar="FORM")
    parser.add_argument(
        "--rounds", type=int, default=1, help="runs with other seeds; medians count"
    )
    parser.add_argument("--keep", type=Path, metavar="ENVDIR", help="keep environments here")
    parser.add_argument("-o", "--out", type=Path, required=True)
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as scratch:
        work = Path(scratch)
        environments = Environments((given.keep or work / "environments").resolve())
        write_rows(work / "rows.npz")
        found = []
        for form in given.form:
            reference = reference_of(form, work / "rows.npz")
            print(
                f"{form}: ln Z = {reference.ln_Z:.6f} +- {reference.ln_Z_se:.1g} by "
                f"{reference.method}",
                flush=True,
            )
            print_heading()
            for name in given.only:
                row = {
                    "form": form,
                    **measured(PEERS[name], form, reference, environments, work, given.rounds),
                }
                print_row(row)
                found.append(row)
                frame = pd.DataFrame(found, columns=list(COLUMNS))
                frame.to_csv(given.out / "peers.csv", index=False)
        (given.out / "peers.png").write_bytes(as_bytes(plot_peers(frame), "png"))


def write_rows(path: Path) -> None:
    """Write the rows that are fitted, for environments that have no ridgebayes."""
    rows = rb.paper_sweep().calibration.frame
    columns = ("a_over_R", "b_over_R", "Q", "p_over_E")
    np.savez(path, **{column: rows[column].to_numpy() for column in columns})


def reference_of(form: str, rows: Path) -> Reference:
    """Return moments and log evidence to better than any peer, after checking the densities."""
    shape, noise = MODELS[form]
    model = Model(Observations.from_table(rb.paper_sweep()), shape, Noise.named(noise))
    target = Target.of(form, rows)
    check_same_density(model, target)
    # Four sets, each of four times as many draws, since the densities are exact.
    found = importance_sample(ModelTarget(model), Effort(n_draw=N_REFERENCE // 4), 0)
    fit, evidence = posterior_of(model, found, 0), found.evidence
    theta = model.to_theta(fit.chains.u[..., : model.n_parameter])
    theta = theta.reshape(-1, model.n_parameter)
    method = f"importance sampling, {len(theta)} draws"
    if not (evidence.se < 0.01 and fit.converged):
        raise SystemExit(f"{form}: no reference: {evidence.status} {fit.convergence_failures}")
    return Reference(
        target.names, theta.mean(axis=0), theta.std(axis=0), evidence.value, evidence.se, method
    )


def check_same_density(model: Model, target: Target) -> None:
    """Stop if the peers' density is not ridgebayes', normalisation included."""
    if model.parameter_names != target.names:
        raise SystemExit(f"parameters: {model.parameter_names} and {target.names}")
    theta = target.prior_draws(200, seed=0)
    u = model.to_scores(theta)
    own = LatentIntegral(model).estimated(u, np.random.default_rng(0), 8).log_density
    own += model.log_prior(theta) - model.log_outer_prior(u)
    one = np.array([target.log_probability_of_one(point) for point in theta])
    for other in (one, target.log_probability(theta)):
        apart = np.abs(other - own) / np.maximum(np.abs(own), 1)
        if not apart.max() < 1e-9:
            raise SystemExit(f"{target.form}: the densities differ by {apart.max():.2g}")


def measured(
    peer: Peer,
    form: str,
    reference: Reference,
    environments: Environments,
    work: Path,
    n_round: int,
) -> dict[str, Any]:
    """Return a peer's row: medians over the rounds."""
    row: dict[str, Any] = {"peer": peer.name, "rounds": n_round}
    try:
        python = environments.python(peer.environment)
        rounds = [one_run(python, peer, form, seed, reference, work) for seed in range(n_round)]
    except NoEnvironmentError as reason:
        return row | {"status": f"skipped: {reason}"}
    except FailedError as reason:
        return row | {"status": f"failed: {reason}"}
    for key, first in rounds[0].items():
        values = [one[key] for one in rounds]
        row[key] = first if isinstance(first, str) else float(np.median(values))
    row["ln_Z_off"] = math.sqrt(np.mean([one["ln_Z_off"] ** 2 for one in rounds]))
    return row | {"status": "ok"}


def one_run(
    python: Path, peer: Peer, form: str, seed: int, reference: Reference, work: Path
) -> dict[str, Any]:
    """Run a peer's script once in a folder of its own, and look at its draws."""
    with tempfile.TemporaryDirectory(dir=work) as folder:
        draws = Path(folder) / "draws.npy"
        command = [python, HERE / peer.script, "--form", form, "--seed", str(seed)]
        command += ["--rows", work / "rows.npz", "--draws", draws, "--variant", peer.variant]
        # Compiled code is not found from an earlier run, nor left behind.
        caches = {"PYTENSOR_FLAGS": f"base_compiledir={folder}", "MPLCONFIGDIR": folder}
        try:
            ended = subprocess.run(
                list(map(str, command)),
                cwd=folder,
                env=one_thread() | caches,
                capture_output=True,
                text=True,
                timeout=LONGEST,
            )
        except subprocess.TimeoutExpired:
            raise FailedError(f"not finished after {LONGEST} s") from None
        if ended.returncode or not ended.stdout.strip():
            said = ended.stderr.strip().splitlines() or [f"exit code {ended.returncode}"]
            raise FailedError(said[-1])
        told = json.loads(ended.stdout.strip().splitlines()[-1])
        return looked_at(told, np.load(draws), reference)


def looked_at(told: dict[str, Any], draws: np.ndarray, reference: Reference) -> dict[str, Any]:
    """Add to what a peer told of itself what its draws tell, by one way for all peers.

    Chains are chains to arviz; of an ensemble each walker is one. Laid side by side in one chain,
    walkers would look independent from draw to draw, and the sum over lags would end at once.
    """
    arviz = import_arviz()
    each = [float(arviz.ess(draws[..., i], method="bulk")) for i in range(draws.shape[-1])]
    ess = min(each)
    mean, sd = draws.mean(axis=(0, 1)), draws.std(axis=(0, 1))
    mean_off = (mean - reference.mean) / reference.sd
    has_evidence = told["ln_Z"] is not None
    ln_Z = told["ln_Z"] if has_evidence else np.nan
    return {
        "versions": f"python {told['python']} {told['versions']}",
        "cpu_s": told["cpu_s"],
        "wall_s": told["wall_s"],
        "import_cpu_s": told["import_cpu_s"],
        "compile_cpu_s": told.get("compile_cpu_s", 0.0),
        "draws": told["draws"],
        "ess": ess,
        "ess_per_cpu_s": ess / told["cpu_s"],
        "parameters": " ".join(reference.names),
        "means": listed(mean),
        "sds": listed(sd),
        "mean_off": float(np.abs(mean_off).max()),
        "mean_off_in_errors": float((np.abs(mean_off) * np.sqrt(each)).max()),
        "sd_off": float(np.abs(sd / reference.sd - 1).max()),
        "ln_Z": ln_Z,
        "ln_Z_se": np.nan if told["ln_Z_se"] is None else told["ln_Z_se"],
        "ln_Z_off": ln_Z - reference.ln_Z,
        "ln_Z_cpu_s": told["cpu_s"] + told.get("evidence_cpu_s", 0.0) if has_evidence else np.nan,
        "ln_Z_reference": reference.ln_Z,
        "reference": reference.method,
    }


def listed(values: np.ndarray) -> str:
    return " ".join(f"{value:.6g}" for value in values)


def print_heading() -> None:
    print(
        f"{'peer':<18}{'CPU s':>8}{'wall s':>8}{'compile':>8}{'draws':>9}{'ESS':>8}"
        f"{'ESS/CPU s':>10}"
        f"{'mean off':>9}{'sd off':>8}{'ln Z':>10}{'stated':>8}{'off':>9}{'CPU s':>7}",
        flush=True,
    )


def print_row(row: dict[str, Any]) -> None:
    if row["status"] != "ok":
        print(f"{row['peer']:<18}{row['status']}", flush=True)
        return
    text = (
        f"{row['peer']:<18}{row['cpu_s']:>8.2f}{row['wall_s']:>8.2f}{row['compile_cpu_s']:>8.1f}"
        f"{row['draws']:>9.0f}{row['ess']:>8.0f}{row['ess_per_cpu_s']:>10.0f}"
        f"{row['mean_off']:>9.3f}{row['sd_off']:>8.3f}"
    )
    if not math.isnan(row["ln_Z"]):
        text += f"{row['ln_Z']:>10.4f}{row['ln_Z_se']:>8.4f}{row['ln_Z_off']:>9.5f}"
        text += f"{row['ln_Z_cpu_s']:>7.2f}"
    print(text, flush=True)


if __name__ == "__main__":
    main()
