"""dynesty: static nested sampling with 500 live points, its default, and all other defaults.

In up to nine dimensions these are uniform draws from multiple ellipsoids and a stop where the live
points hold less than about half a unit of log evidence. One point a call: it has no vectorised
interface.
"""

import dynesty
import numpy as np
from harness import Task, equally_weighted

N_LIVE = 500


def main() -> None:
    task = Task.begin()
    target = task.target
    with task.timed():
        sampler = dynesty.NestedSampler(
            target.log_likelihood_of_one,
            target.from_cube,
            target.n,
            nlive=N_LIVE,
            rstate=np.random.default_rng(task.seed),
        )
        sampler.run_nested(print_progress=False)
        found = sampler.results
    task.finish(
        equally_weighted(found.samples, found.logwt, task.seed),
        ["dynesty", "numpy"],
        ln_Z=float(found.logz[-1]),
        ln_Z_se=float(found.logzerr[-1]),
        n_draw=len(found.samples),
    )


if __name__ == "__main__":
    main()
