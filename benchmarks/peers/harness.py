"""What every peer's script shares: its task, its stopwatch and the line it prints at the end.

CPU seconds are user and system time of the process, all its threads, and the child processes that
it has waited for. What the interpreter and the imports took is told apart, and so is compilation
where there is any: both are paid once, however many tables are fitted.
"""

import argparse
import json
import os
import resource
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path

import numpy as np
from target import FORMS, Target


def cpu_seconds() -> float:
    """Return CPU seconds of this process and its children so far."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in used)


@dataclass
class Task:
    """What one peer has to do, and what it used up.

    Parameters
    ----------
    target : Target
        Posterior.
    seed : int
        Seed.
    variant : str
        Which of a script's settings, where it has several.
    """

    target: Target
    seed: int
    variant: str
    _draws: Path
    _out: int
    _seconds: dict[str, float] = field(default_factory=dict)

    @classmethod
    def begin(cls) -> "Task":
        """Read the command line. Call it after all imports: what was used until now is theirs."""
        imports = cpu_seconds()
        parser = argparse.ArgumentParser()
        parser.add_argument("--form", choices=FORMS, required=True)
        parser.add_argument("--seed", type=int, required=True)
        parser.add_argument("--rows", type=Path, required=True)
        parser.add_argument("--draws", type=Path, required=True)
        parser.add_argument("--variant", default="")
        given = parser.parse_args()
        target = Target.of(given.form, given.rows)
        # What packages print goes to the other stream: the line at the end stands alone.
        out = os.dup(1)
        os.dup2(2, 1)
        return cls(target, given.seed, given.variant, given.draws, out, {"import_cpu_s": imports})

    @contextmanager
    def timed(self, stage: str = "") -> Iterator[None]:
        """Count a block's seconds, as `stage`_cpu_s; without a name those of the job itself."""
        wall, cpu = time.perf_counter(), cpu_seconds()
        yield
        name = f"{stage}_cpu_s" if stage else "cpu_s"
        self._seconds[name] = self._seconds.get(name, 0.0) + cpu_seconds() - cpu
        if not stage:
            self._seconds["wall_s"] = time.perf_counter() - wall

    def finish(
        self,
        draws: np.ndarray,
        packages: Sequence[str],
        *,
        ln_Z: float | None = None,
        ln_Z_se: float | None = None,
        n_draw: int | None = None,
    ) -> None:
        """Write the draws and print what was used.

        Parameters
        ----------
        draws : ndarray of float, shape (n_chain, n_draw, n_parameter)
            After warm-up. An ensemble's walkers are chains.
        packages : sequence of str
            Distributions whose versions are told.
        ln_Z, ln_Z_se : float, optional
            Log evidence and the error that the sampler states.
        n_draw : int, optional
            How many draws were made, where not all of them are handed over.
        """
        np.save(self._draws, np.asarray(draws, dtype=float))
        said = {
            "versions": " ".join(f"{name} {version(name)}" for name in packages),
            "python": sys.version.split()[0],
            **self._seconds,
            "draws": int(np.prod(np.shape(draws)[:2])) if n_draw is None else int(n_draw),
            "ln_Z": ln_Z,
            "ln_Z_se": ln_Z_se,
        }
        with os.fdopen(self._out, "w") as out:
            out.write(json.dumps(said) + "\n")


def equally_weighted(
    draws: np.ndarray, log_weight: np.ndarray, seed: int, n_chain: int = 4
) -> np.ndarray:
    """Return as many draws as weighted ones are worth, shape (n_chain, n, n_parameter).

    Nested samplers give weighted draws, worth 1 / sum of squared weights of equal ones (Kish).
    Resampled to more, copies of one draw would count as independent. They have no order in time:
    what is handed over is shuffled, and its chains are chains by name only.
    """
    weight = np.exp(log_weight - log_weight.max())
    weight /= weight.sum()
    rng = np.random.default_rng(seed)
    n = int(1 / np.sum(weight**2)) // n_chain * n_chain
    # Systematic resampling adds the least noise.
    at = (np.arange(n) + rng.random()) / n
    chosen = np.minimum(np.searchsorted(np.cumsum(weight), at), len(weight) - 1)
    return draws[rng.permutation(chosen)].reshape(n_chain, -1, draws.shape[1])
