"""PyMC: NUTS as `pm.sample` sets it up, 4 chains of 3,500 draws after the default 1,000 of tuning.

- The initial points and the step method are made first, by `pm.init_nuts` with the default
  ``jitter+adapt_diag``, so that compilation can be told apart from sampling.
- ``cores=1``: the same CPU seconds in one process, where they are counted without doubt.
- The convergence checks after sampling are left out: on a posterior this small they would be a
  good part of the time, and other peers make none.
"""

import pymc as pm
from harness import Task
from pymc_model import draws_of, pymc_model

N_CHAIN, N_TUNE, N_DRAW = 4, 1_000, 3_500


def main() -> None:
    task = Task.begin()
    with task.timed("compile"):
        model = pymc_model(task.target)
        points, step = pm.init_nuts(
            init="jitter+adapt_diag",
            chains=N_CHAIN,
            model=model,
            random_seed=task.seed,
            tune=N_TUNE,
            progressbar=False,
        )
    with task.timed(), model:
        found = pm.sample(
            N_DRAW,
            tune=N_TUNE,
            chains=N_CHAIN,
            cores=1,
            step=step,
            initvals=points,
            random_seed=task.seed,
            progressbar=False,
            compute_convergence_checks=False,
        )
    task.finish(draws_of(found, task.target.names), ["pymc", "pytensor", "numpy"])


if __name__ == "__main__":
    main()
