"""nautilus: importance nested sampling with networks, all defaults, many points a call.

The defaults are 2,000 live points and 10,000 effective draws. It states no error of its evidence;
by its documentation that is about one over the square root of the effective draws.
"""

import nautilus
from harness import Task, equally_weighted


def main() -> None:
    task = Task.begin()
    target = task.target
    with task.timed():
        sampler = nautilus.Sampler(
            target.from_cube, target.log_likelihood, target.n, vectorized=True, seed=task.seed
        )
        sampler.run(verbose=False)
        points, log_weight, _ = sampler.posterior()
    task.finish(
        equally_weighted(points, log_weight, task.seed),
        ["nautilus-sampler", "scikit-learn", "numpy"],
        ln_Z=float(sampler.log_z),
        n_draw=len(points),
    )


if __name__ == "__main__":
    main()
