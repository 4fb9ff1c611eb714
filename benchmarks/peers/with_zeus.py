"""zeus: ensemble slice sampling, 32 walkers, its default differential move, all in one call.

Walkers start near the prior's centre, as emcee's do (see `target.py`). A slice step takes some five
calls of the density. 300 steps of burn-in, in which it tunes its scale: with five parameters the
last walkers take 200 to arrive. 3,000 steps more.
"""

import numpy as np
import zeus
from harness import Task

N_WALKER, N_BURN, N_STEP = 32, 300, 3_000


def main() -> None:
    task = Task.begin()
    target = task.target
    # The only seed that zeus knows.
    np.random.seed(task.seed)  # noqa: NPY002
    start = target.start(N_WALKER, task.seed)
    with task.timed():
        sampler = zeus.EnsembleSampler(
            N_WALKER, target.n, target.log_probability, vectorize=True, verbose=False
        )
        sampler.run_mcmc(start, N_BURN + N_STEP, progress=False)
        draws = sampler.get_chain(discard=N_BURN)
    task.finish(draws.swapaxes(0, 1), ["zeus-mcmc", "numpy"])


if __name__ == "__main__":
    main()
