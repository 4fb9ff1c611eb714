"""Compare bridge with deterministic evidences: ``benchmarks/bridge_accuracy.py [SEEDS] [few]``.

Every form of at most four parameters on the two tables that ship with the package, and the power
law on both, whose evidence is exact but for an integral over sigma. With ``few``: Modified, Hybrid
and the power law on 3, 5 and 8 rows of the sweep, all of one texture or each of another one, where
sigma may be next to zero. For each, 20 seeds (or SEEDS):
sample, bridge, subtract the deterministic value. If the quoted standard errors are right, the
differences have mean zero (in units of the mean's own error) and a root mean square of one quoted
error.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import sys

import numpy as np

import ridgebayes as rb
from ridgebayes.evidence import bridge_evidence, power_law_evidence, quadrature_evidence
from ridgebayes.inference.laplace import fit_laplace
from ridgebayes.runtime.randomness import stream

WANTED = "wanted: rms of difference / quoted se from 0.7 to 1.4, largest difference under 0.01"


def differences(table: rb.ContactTable, form: object, n_seed: int) -> tuple[list, list]:
    """Return bridge minus reference, and the quoted standard errors, one per seed."""
    apart, quoted = [], []
    reference = None
    for seed in range(n_seed):
        fit = rb.calibrate(table, form, rng=seed, noise="iid")
        laplace = fit_laplace(fit.model)
        if reference is None:
            found = (
                power_law_evidence(fit.model, tol=1e-8)
                if form.name == "power-law"
                else quadrature_evidence(fit.model.log_density, laplace)
            )
            if not found.ok:
                print(f"  {form.name}: no reference: {found.status}")
                return [], []
            reference = found.value
        bridge = bridge_evidence(
            fit.model.log_density, fit.chains, laplace, rng=stream(fit.seed, "bridge")
        )
        if not (fit.converged and bridge.ok):
            print(f"  {form.name}, seed {seed}: {fit.convergence_failures} {bridge.status}")
        apart.append(bridge.value - reference)
        quoted.append(bridge.se)
    return apart, quoted


def few_rows() -> dict[str, tuple[rb.ContactTable, list]]:
    """Return tables of 3, 5 and 8 rows by name, with the forms that they are fitted by."""
    rows = rb.paper_sweep().calibration.frame
    place = rows.groupby("texture", sort=False).cumcount()
    cases = {}
    for n in (3, 5, 8):
        for label, some in (("one row each", rows[place == 0]), ("one texture", rows)):
            table = rb.ContactTable.from_frame(some.head(n).reset_index(drop=True))
            cases[f"{n} rows, {label}"] = table, [rb.PowerLaw(), rb.Modified(), rb.Hybrid()]
    return cases


def main() -> None:
    n_seed = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    closed = [rb.Classic(), rb.Modified(), rb.Hybrid(), rb.PowerLaw()]
    cases = {
        "paper sweep": (rb.paper_sweep(), closed),
        "finite elements": (rb.reference_fe(), [*closed, rb.HalfPlane()]),
    }
    if "few" in sys.argv:
        cases = few_rows()
    print(f"bridge - reference, {n_seed} seeds; {WANTED}")
    print(
        f"{'table':<20} {'form':<11} {'mean':>10} {'mean/its se':>11} {'rms':>9} "
        f"{'quoted se':>10} {'rms of ratio':>12} {'largest':>9}"
    )
    ratios = []
    for label, (table, forms) in cases.items():
        for form in forms:
            apart, quoted = map(np.asarray, differences(table, form, n_seed))
            if not len(apart):
                continue
            ratio = apart / quoted
            ratios.append(ratio)
            t = apart.mean() / (apart.std(ddof=1) / np.sqrt(n_seed))
            print(
                f"{label:<20} {form.name:<11} {apart.mean():>10.6f} {t:>11.2f} "
                f"{np.sqrt(np.mean(apart**2)):>9.6f} {quoted.mean():>10.6f} "
                f"{np.sqrt(np.mean(ratio**2)):>12.2f} {np.abs(apart).max():>9.6f}",
                flush=True,
            )
    every = np.concatenate(ratios)
    print(
        f"all {every.size}: mean of difference / quoted se {every.mean():.3f} "
        f"(its own se {1 / np.sqrt(every.size):.3f}), rms {np.sqrt(np.mean(every**2)):.3f}"
    )


if __name__ == "__main__":
    main()
