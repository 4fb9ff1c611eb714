"""What a long command says while it works, and how long each stage took."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, TextIO


@dataclass
class Progress:
    """Times stages and tells of them: a bar on a terminal, plain lines anywhere else.

    Parameters
    ----------
    n_stage : int
        Stages to come, for the bar.
    out : text file
        Where to tell; standard error, so that it never mixes with output.

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
    stages: list[dict[str, Any]] = field(default_factory=list)
    _bar: Any = None
    _task: Any = None

    def __enter__(self) -> "Progress":
        if self.out.isatty():
            # Loaded for a terminal only: most runs in scripts never show a bar.
            from rich.console import Console
            from rich.progress import BarColumn, TextColumn, TimeElapsedColumn
            from rich.progress import Progress as Bar

            self._bar = Bar(
                BarColumn(bar_width=24),
                TimeElapsedColumn(),
                TextColumn("{task.description}"),
                console=Console(file=self.out),
                transient=True,
            )
            self._bar.start()
            self._task = self._bar.add_task("", total=self.n_stage)
        return self

    def __exit__(self, *error: object) -> None:
        if self._bar is not None:
            self._bar.stop()
            self._bar = None

    @contextmanager
    def stage(self, name: str) -> Iterator[Callable[[float], None]]:
        """Time the block as one stage; its times go to `stages`.

        Parameters
        ----------
        name : str
            What is told of it.

        Yields
        ------
        callable
            Adds CPU seconds of workers to the stage's own.
        """
        if self._bar is not None:
            self._bar.update(self._task, description=name)
        wall, cpu, elsewhere = time.perf_counter(), time.process_time(), [0.0]
        try:
            yield elsewhere.append
        finally:
            wall, cpu = time.perf_counter() - wall, time.process_time() - cpu + sum(elsewhere)
            self.stages.append({"name": name, "wall_s": wall, "cpu_s": cpu})
            if self._bar is not None:
                self._bar.advance(self._task)
            else:
                print(f"{name}: {wall:.2f} s", file=self.out, flush=True)

    def detail(self, text: str) -> None:
        """Tell how far a stage is; on a terminal only, plain lines tell of whole stages."""
        if self._bar is not None:
            self._bar.update(self._task, description=text)
