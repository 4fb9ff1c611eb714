"""emcee: its default stretch move or differential evolution, one walker or all walkers a call.

- Walkers start near the prior's centre (see `target.py`). 500 steps of burn-in: ten autocorrelation
  times.
- ``plain``: the stretch move, one walker a call, as most people write it, with the 32 walkers of
  emcee's own tutorials. ``vectorised``: the same with all walkers in one call. 10,000 steps, for an
  autocorrelation time of 40 to 70.
- ``de``: all walkers in one call, `DEMove` for nine steps in ten and the stretch move for the
  tenth. The usual partner is `DESnookerMove`, but in emcee 3.1.6 that samples another distribution.
- ``de-128``: the same with 128 walkers and 4,000 steps. Of a vectorised density as cheap as these,
  128 values cost hardly more than 32.
"""

import emcee
import numpy as np
from harness import Task

N_BURN = 500
SIZES = {  # walkers, steps
    "plain": (32, 10_000),
    "vectorised": (32, 10_000),
    "de": (32, 10_000),
    "de-128": (128, 4_000),
}


def main() -> None:
    task = Task.begin()
    target = task.target
    n_walker, n_step = SIZES[task.variant]
    vectorised = task.variant != "plain"
    moves = None
    if task.variant.startswith("de"):
        moves = [(emcee.moves.DEMove(), 0.9), (emcee.moves.StretchMove(), 0.1)]
    start = target.start(n_walker, task.seed)
    with task.timed():
        sampler = emcee.EnsembleSampler(
            n_walker,
            target.n,
            target.log_probability if vectorised else target.log_probability_of_one,
            vectorize=vectorised,
            moves=moves,
        )
        sampler.random_state = np.random.RandomState(task.seed).get_state()
        state = sampler.run_mcmc(start, N_BURN, store=False)
        sampler.run_mcmc(state, n_step)
        draws = sampler.get_chain()
    task.finish(draws.swapaxes(0, 1), ["emcee", "numpy"])


if __name__ == "__main__":
    main()
