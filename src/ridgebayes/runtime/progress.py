"""Progress of a long command, and the duration of each stage."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar, Token
from dataclasses import dataclass, field
from typing import Any, TextIO

from ridgebayes.runtime.text import duration

# Detail of progress: -1 none, 0 stages, 1 also progress within stages without a terminal. It is
# set for the duration of a command, so that functions need not pass it on.
VERBOSITY: ContextVar[int] = ContextVar("VERBOSITY", default=0)
_CURRENT: ContextVar["Progress | None"] = ContextVar("_CURRENT", default=None)
# Seconds between lines about a long stage if there is no terminal.
_EVERY_S, _EVERY_S_DETAILED = 30.0, 2.0


@dataclass
class Progress:
    """Timer of stages that reports them: by a bar on a terminal, else by plain lines.

    Parameters
    ----------
    n_stage : int
        Number of stages, for the bar.
    out : text file
        Stream of the reports; standard error by default, so that reports never mix with output.
    name : str
        Name of counted work outside of stages.
    began : float, optional
        Start of the program by `time.perf_counter`; the time since then is the first stage.

    Examples
    --------
    >>> import io
    >>> with Progress(1, io.StringIO()) as progress, progress.stage("add"):
    ...     _ = 1 + 1
    >>> [stage["name"] for stage in progress.stages]
    ['add']
    """

    n_stage: int
    out: TextIO = field(default_factory=lambda: sys.stderr)
    name: str = ""
    began: float | None = None
    stages: list[dict[str, Any]] = field(default_factory=list)
    _bar: Any = None
    _task: Any = None
    _began: float = 0.0
    _reported: float = 0.0
    _token: "Token[Progress | None] | None" = None

    def __enter__(self) -> "Progress":
        self._token = _CURRENT.set(self)
        self._began = self._reported = time.perf_counter()
        if self.out.isatty() and VERBOSITY.get() >= 0:
            # Imported for a terminal only: scripts never show a bar.
            from rich.console import Console
            from rich.progress import BarColumn, TextColumn, TimeElapsedColumn
            from rich.progress import Progress as Bar

            self._bar = Bar(
                BarColumn(bar_width=24),
                TimeElapsedColumn(),
                TextColumn("{task.description}", markup=False),
                console=Console(file=self.out),
                transient=True,
            )
            self._bar.start()
            self._task = self._bar.add_task("", total=self.n_stage)
        if self.began is not None:
            self._ended("start", time.perf_counter() - self.began, time.process_time())
        return self

    def __exit__(self, *error: object) -> None:
        if self._token is not None:
            _CURRENT.reset(self._token)
        if self._bar is not None:
            self._bar.stop()
            self._bar = None

    @contextmanager
    def stage(self, name: str) -> Iterator[Callable[[float], None]]:
        """Time the block as one stage, and append its times to `stages`.

        Parameters
        ----------
        name : str
            Name of the stage in reports.

        Yields
        ------
        callable
            Function that adds CPU seconds of workers to the stage.
        """
        if self._bar is not None:
            self._bar.update(self._task, description=name)
        # CPU time of this thread only, because stages may run on several threads at once.
        wall, cpu, elsewhere = time.perf_counter(), time.thread_time(), list[float]()
        self.name, self._began, self._reported = name, wall, wall
        try:
            yield elsewhere.append
        finally:
            cpu = time.thread_time() - cpu + sum(elsewhere)
            # Workers may start before the stage, so that their CPU time can exceed its wall time.
            note = f" (and {sum(elsewhere):.2f} s of CPU on workers)" if elsewhere else ""
            self._ended(name, time.perf_counter() - wall, cpu, note)
            self.name = ""

    def _ended(self, name: str, wall: float, cpu: float, note: str = "") -> None:
        self.stages.append({"name": name, "wall_s": wall, "cpu_s": cpu})
        if self._bar is not None:
            self._bar.update(self._task, completed=len(self.stages))
        elif VERBOSITY.get() >= 0:
            print(f"{name}: {wall:.2f} s{note}", file=self.out, flush=True)

    def detail(self, text: str) -> None:
        """Report the state of a stage: at once on a terminal, else as a line now and then."""
        if self._bar is not None:
            self._bar.update(self._task, description=text)
            return
        now, every = time.perf_counter(), _EVERY_S_DETAILED if VERBOSITY.get() else _EVERY_S
        if VERBOSITY.get() >= 0 and now >= self._reported + every:
            self._reported = now
            print(text, file=self.out, flush=True)

    def count(self, n_done: int, n: int | None) -> None:
        """Report how many parts of a stage are done, and the estimated time left."""
        text = f"{n_done} done" if n is None else f"{n_done} of {n}"
        if n and 0 < n_done < n:
            left = (time.perf_counter() - self._began) * (n - n_done) / n_done
            text += f", about {duration(left)} left"
        if n and self._bar is not None:
            self._bar.update(self._task, completed=len(self.stages) + n_done / n)
        self.detail(f"{self.name}: {text}" if self.name else text)


@contextmanager
def untimed(name: str) -> Iterator[Callable[[float], None]]:
    """Do nothing; replaces `Progress.stage` in library calls."""
    yield lambda seconds: None


def tell_count(n_done: int, n: int | None = None) -> None:
    """Report the number of finished parts to the running command, if there is one."""
    progress = _CURRENT.get()
    if progress is not None:
        progress.count(n_done, n)
