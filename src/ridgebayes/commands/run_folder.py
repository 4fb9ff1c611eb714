"""Output folders that appear only when they are complete, and writers of CSV and JSON files."""

import json
import os
import shutil
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pandas as pd

from ridgebayes._types import BATCH_SIZE
from ridgebayes.errors import InputError, OutputError, RidgebayesError
from ridgebayes.runtime.atomic import exclusive_lock, replacing, write_text
from ridgebayes.runtime.pool import map_ordered

RUN_JSON = "run.json"
CHAINS = "chains-*.npz"
PARTIAL = ".partial"  # suffix of an unfinished folder, whose name also gets a leading dot


@contextmanager
def new_folder(
    path: Path, *, force: bool = False, resume: bool | None = None, about: str = RUN_JSON
) -> Iterator[Path]:
    """Create a partial folder to write into, and rename it to `path` at the end.

    Parameters
    ----------
    path : Path
        Final folder.
    force : bool, optional
        Whether to replace an existing folder of the same kind. It is removed at the very end.
    resume : bool, optional
        Whether to continue in the partial folder of an earlier run. None for a command that cannot
        be resumed, so that Ctrl-C removes the partial folder.
    about : str, optional
        File that identifies folders of this kind; other folders are never replaced.

    Yields
    ------
    Path
        The partial folder ``.<name>.partial`` beside `path`.

    Raises
    ------
    InputError
        If `path` exists and cannot be replaced, cannot be created, or is being created by another
        process.
    OutputError
        If writing fails, for example on a full disk, or the partial folder was removed.

    Notes
    -----
    An InputError inside the block removes a new partial folder. Any other failure keeps the
    partial folder, whose files are complete, for `resume`.
    """
    path = path.absolute()
    _refuse_occupied(path, force, about)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except FileExistsError:
        raise InputError(f"{path}: cannot be created (Not a directory)") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be created ({error.strerror})") from None
    with exclusive_lock(path):
        _refuse_occupied(path, force, about)  # another process may have created it meanwhile
        yield from _fill(path, resume)


def _refuse_occupied(path: Path, force: bool, about: str) -> None:
    if os.path.lexists(path):  # also true for a broken link
        if not force:
            raise InputError(f"{path}: exists; use another -o, or --force to replace it")
        if not path.is_dir() or (any(path.iterdir()) and not (path / about).is_file()):
            raise InputError(
                f"{path}: not a run folder (no {about} in it); --force replaces only those"
            )


def _fill(path: Path, resume: bool | None) -> Iterator[Path]:
    """Yield the partial folder and publish it afterwards; the caller holds the lock."""
    partial = path.with_name(f".{path.name}{PARTIAL}")
    try:
        resumed = bool(resume) and partial.is_dir()
        if resumed:
            _keep_only_chains(partial)
        elif partial.exists():
            shutil.rmtree(partial)
        partial.mkdir(parents=True, exist_ok=resumed)
    except OSError as error:
        raise InputError(f"{path}: cannot be created ({error.strerror})") from None
    try:
        yield partial
        _publish(partial, path)
    except (RidgebayesError, OSError) as error:
        if not partial.is_dir():
            raise OutputError(
                f"{path}: the working folder {partial} was removed during the run"
            ) from None
        if isinstance(error, InputError):
            if not resumed:
                shutil.rmtree(partial, ignore_errors=True)
        elif not any(partial.iterdir()):
            partial.rmdir()
        elif isinstance(error, OutputError):
            raise OutputError(f"{error}; what is finished is kept in {partial}") from None
        raise
    except BaseException as error:
        if resume is None and not isinstance(error, Exception):  # Ctrl-C
            shutil.rmtree(partial, ignore_errors=True)
        raise


def _publish(partial: Path, path: Path) -> None:
    """Rename a finished folder to its final name, and remove an older folder of that name."""
    for chains in partial.rglob(CHAINS):
        chains.unlink()
    old = path.with_name(f".{path.name}.old")
    if path.exists():
        shutil.rmtree(old, ignore_errors=True)
        path.rename(old)
    try:
        partial.rename(path)
    except OSError:
        if old.is_dir():
            old.rename(path)
        raise
    shutil.rmtree(old, ignore_errors=True)  # or the rest of a process that was killed


def _keep_only_chains(folder: Path) -> None:
    """Remove all files of an earlier run except chains; the run computes them again."""
    for path in sorted(folder.rglob("*"), reverse=True):  # contents before their folder
        if path.is_dir() and not path.is_symlink():
            if not any(path.iterdir()):
                path.rmdir()
        elif not path.match(CHAINS):
            path.unlink()


def write_csv(frame: pd.DataFrame, path: Path, executor: Executor | None = None) -> None:
    """Write a frame as CSV, with all digits of floats and probabilities of counts without ".0".

    An executor formats long tables, since formatting can take longer than computing the numbers.
    """
    n = BATCH_SIZE // max(frame.shape[1], 1) + 1
    starts = range(0, len(frame), n)
    parts = (frame.iloc[i : i + n] for i in starts)
    texts = map_ordered(_csv, parts, executor if len(starts) > 1 else None)
    with replacing(path) as partial, partial.open("w", encoding="utf-8", newline="") as file:
        file.write(_csv(frame.iloc[:0], header=True))
        file.writelines(texts)


def _csv(frame: pd.DataFrame, *, header: bool = False) -> str:
    names = frame.columns[frame.columns.str.startswith("p_q_ge_")]
    frame = frame.assign(**{name: np.char.mod("%g", frame[name]) for name in names})
    return str(frame.to_csv(index=False, header=header, lineterminator="\n"))


def write_json(content: object, path: Path) -> None:
    """Write plain values as a JSON file, atomically."""
    write_text(json.dumps(content, indent=2) + "\n", path)
