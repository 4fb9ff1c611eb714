"""ridgebayes itself: `calibrate` with its defaults, which gives the evidence beside the draws.

Everything that `calibrate` does is counted: statistics of the rows, mode search, adaptation, draws,
the table of convergence. The package imports much of what it needs at first use: a fit of another
form brings that in, and counts as import.
"""

from harness import Task

import ridgebayes as rb

MODELS = {
    "hybrid": (rb.Hybrid(), "iid"),
    "modified": (rb.Modified(), "iid"),
    "texture+step": (rb.Hybrid(), "texture+step"),
}


def main() -> None:
    task = Task.begin()
    with task.timed("import"):
        rb.calibrate(rb.paper_sweep(), rb.Classic(), rng=task.seed, noise="iid")
    form, noise = MODELS[task.target.form]
    with task.timed():
        fit = rb.calibrate(rb.paper_sweep(), form, noise=noise, rng=task.seed)
    if not fit.converged:
        raise SystemExit(f"not converged: {fit.convergence_failures}")
    # Set, block, draw of a block, parameter.
    theta = fit.model.to_theta(fit.chains.u[..., : fit.model.n_parameter])
    n_step, n_parameter = theta.shape[1], theta.shape[3]
    task.finish(
        theta.swapaxes(1, 2).reshape(-1, n_step, n_parameter),
        ["ridgebayes", "numpy"],
        ln_Z=fit.evidence.value,
        ln_Z_se=fit.evidence.se,
    )


if __name__ == "__main__":
    main()
