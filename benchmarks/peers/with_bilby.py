"""bilby with dynesty, end to end: `bilby.run_sampler` with the defaults, as its users call it.

The defaults are 500 live points, random walks of two autocorrelation times by bilby's own
proposals, and a stop at a remainder of a tenth of a unit of log evidence. What bilby does around
the sampler is counted: its start-up tests, its result file. The draws are those it hands over.
"""

import bilby
import numpy as np
from harness import Task
from target import Target

N_CHAIN = 4  # by name only: the draws have no order in time


class Likelihood(bilby.Likelihood):
    """The target's likelihood, as bilby wants it."""

    def __init__(self, target: Target) -> None:
        super().__init__()
        self._target = target

    def log_likelihood(self, parameters: dict[str, float]) -> float:
        return self._target.log_likelihood_of_one(
            np.array([parameters[name] for name in self._target.names])
        )


def priors(target: Target) -> dict[str, bilby.core.prior.Prior]:
    """Return bilby's own priors."""
    make = {
        "log-normal": lambda median, sd: bilby.core.prior.LogNormal(np.log(median), sd),
        "normal": lambda mean, sd: bilby.core.prior.Normal(mean, sd),
        "half-normal": lambda sd: bilby.core.prior.HalfNormal(sd),
    }
    return {
        name: make[kind](*fields)
        for name, (kind, *fields) in zip(target.names, target.priors, strict=True)
    }


def main() -> None:
    task = Task.begin()
    target = task.target
    bilby.core.utils.random.seed(task.seed)
    with task.timed():
        found = bilby.run_sampler(
            Likelihood(target),
            priors(target),
            sampler="dynesty",
            outdir="bilby",
            label="peer",
            clean=True,
        )
    posterior = found.posterior[list(target.names)].to_numpy()
    n = len(posterior) // N_CHAIN * N_CHAIN
    shuffled = np.random.default_rng(task.seed).permutation(posterior)[:n]
    task.finish(
        shuffled.reshape(N_CHAIN, -1, target.n),
        ["bilby", "dynesty", "numpy"],
        ln_Z=float(found.log_evidence),
        ln_Z_se=float(found.log_evidence_err),
        n_draw=len(found.nested_samples),
    )


if __name__ == "__main__":
    main()
