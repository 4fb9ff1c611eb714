"""UltraNest: reactive nested sampling, all defaults, many points a call.

The defaults are 400 live points at least, a stop where the remainder is under half a unit of log
evidence, and 400 effective draws. Its error of the log evidence is the most cautious of all here:
it takes into account how the live points were laid out.
"""

import numpy as np
import ultranest
from harness import Task, equally_weighted


def main() -> None:
    task = Task.begin()
    target = task.target
    # The only seed that UltraNest knows.
    np.random.seed(task.seed)  # noqa: NPY002
    with task.timed():
        sampler = ultranest.ReactiveNestedSampler(
            list(target.names), target.log_likelihood, target.from_cube, vectorized=True
        )
        found = sampler.run(show_status=False, viz_callback=False)
    weighted = found["weighted_samples"]
    with np.errstate(divide="ignore"):
        log_weight = np.log(weighted["weights"])
    task.finish(
        equally_weighted(np.asarray(weighted["points"]), log_weight, task.seed),
        ["ultranest", "numpy"],
        ln_Z=float(found["logz"]),
        ln_Z_se=float(found["logzerr"]),
        n_draw=len(log_weight),
    )


if __name__ == "__main__":
    main()
