"""ridgebayes itself: `calibrate` with its defaults, then the evidence that `compare` would use.

Everything that `calibrate` does is counted: statistics of the rows, mode search, burn-in, sampling
until its stopping rule is met, the table of convergence. The bridge's evidence is counted apart, as
evidence_cpu_s, since other samplers of draws give none. The package imports much of what it needs
at first use: a fit of another form brings that in, and counts as import.
"""

from harness import Task

import ridgebayes as rb
from ridgebayes.evidence import LogEvidence, bridge_evidence
from ridgebayes.inference.laplace import fit_laplace
from ridgebayes.results import Fit
from ridgebayes.runtime.randomness import stream

MODELS = {
    "hybrid": (rb.Hybrid(), "iid"),
    "modified": (rb.Modified(), "iid"),
    "texture+step": (rb.Hybrid(), "texture+step"),
}


def bridge(fit: Fit) -> LogEvidence:
    """Return the evidence as `ridgebayes.comparison.bayes_factors.evidences` does."""
    model = fit.model
    return bridge_evidence(
        model.log_density,
        fit.chains,
        fit_laplace(model),
        rng=stream(fit.seed, "bridge"),
        draws_max=100_000 if model.is_iid_gaussian else 20_000,
    )


def main() -> None:
    task = Task.begin()
    with task.timed("import"):
        bridge(rb.calibrate(rb.paper_sweep(), rb.Classic(), rng=task.seed, noise="iid"))
    form, noise = MODELS[task.target.form]
    with task.timed():
        fit = rb.calibrate(rb.paper_sweep(), form, noise=noise, rng=task.seed)
    with task.timed("evidence"):
        found = bridge(fit)
    if not fit.converged:
        raise SystemExit(f"not converged: {fit.convergence_failures}")
    theta = fit.model.to_theta(fit.chains.u)  # ensemble, step, walker, parameter
    n_step, n_parameter = theta.shape[1], theta.shape[3]
    task.finish(
        theta.swapaxes(1, 2).reshape(-1, n_step, n_parameter),
        ["ridgebayes", "emcee", "numpy"],
        ln_Z=found.value,
        ln_Z_se=found.se,
    )


if __name__ == "__main__":
    main()
