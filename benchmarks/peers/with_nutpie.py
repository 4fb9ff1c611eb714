"""nutpie: NUTS on the PyMC model, with its default Numba backend.

- ``diagonal``: the default adaptation. ``low-rank``: its option `low_rank_modified_mass_matrix`,
  which learns correlations too; c1 and c2 have one of -0.98.
- 4 chains of 6,000 draws after the default 400 of tuning.
- ``cores=1``, so that chains are not in each other's way on a small machine: the CPU seconds are
  the same. Compilation is told apart.
"""

import nutpie
from harness import Task
from pymc_model import draws_of, pymc_model

N_CHAIN, N_DRAW = 4, 6_000


def main() -> None:
    task = Task.begin()
    with task.timed("compile"):
        compiled = nutpie.compile_pymc_model(pymc_model(task.target))
    with task.timed():
        found = nutpie.sample(
            compiled,
            draws=N_DRAW,
            chains=N_CHAIN,
            cores=1,
            seed=task.seed,
            progress_bar=False,
            low_rank_modified_mass_matrix=task.variant == "low-rank",
        )
    task.finish(draws_of(found, task.target.names), ["nutpie", "pymc", "numba", "numpy"])


if __name__ == "__main__":
    main()
