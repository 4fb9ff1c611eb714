"""An output folder that is written whole or not at all, and the text files in it."""

import json
import os
import shutil
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pandas as pd

from ridgebayes.errors import InputError, OutputError, RidgebayesError
from ridgebayes.runtime.atomic import exclusive_lock, replacing, write_text
from ridgebayes.runtime.pool import map_ordered

RUN_JSON = "run.json"
CHAINS = "chains-*.npz"
_CELLS = 250_000  # of a table whose text is made at a time
PARTIAL = ".partial"  # with a dot before it, what a folder is called until it is finished


@contextmanager
def new_folder(
    path: Path, *, force: bool = False, resume: bool | None = None, about: str = RUN_JSON
) -> Iterator[Path]:
    """Give a folder to write into that takes its final name only when all is done.

    Parameters
    ----------
    path : Path
        Final name.
    force : bool, optional
        Whether a run folder of that name may be replaced. It is removed at the very end.
    resume : bool, optional
        Whether to go on in the partial folder that an earlier run left; None where nobody can, so
        that Ctrl-C leaves none behind.
    about : str, optional
        File by which a folder of this kind is known: no other kind is replaced.

    Yields
    ------
    Path
        A folder beside it, ``.<name>.partial``.

    Raises
    ------
    InputError
        If `path` exists and is not to be, or may not be, replaced; if it cannot be created; if
        another process is making it.
    OutputError
        If it cannot be written to on the way, such as on a full disk, or is gone.

    Notes
    -----
    Bad input (InputError) inside the block leaves nothing behind. Any other failure leaves the
    partial folder, whose files are whole, for `resume`.
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
        _refuse_occupied(path, force, about)  # another process may have made it by now
        yield from _fill(path, resume)


def _refuse_occupied(path: Path, force: bool, about: str) -> None:
    if os.path.lexists(path):  # a link that leads nowhere is in the way as well
        if not force:
            raise InputError(f"{path}: exists; use another -o, or --force to replace it")
        if not path.is_dir() or (any(path.iterdir()) and not (path / about).is_file()):
            raise InputError(
                f"{path}: not a run folder (no {about} in it); --force replaces only those"
            )


def _fill(path: Path, resume: bool | None) -> Iterator[Path]:
    """Give the partial folder, and then its name to it: what `new_folder` does under its lock."""
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
    """Give a finished folder its final name, in place of an older folder of that name."""
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
    shutil.rmtree(old, ignore_errors=True)  # also one that a killed process left


def _keep_only_chains(folder: Path) -> None:
    """Remove what an earlier run finished: all but the chains is made again, and the same."""
    for path in sorted(folder.rglob("*"), reverse=True):  # what is in a folder before it
        if path.is_dir() and not path.is_symlink():
            if not any(path.iterdir()):
                path.rmdir()
        elif not path.match(CHAINS):
            path.unlink()


def write_csv(frame: pd.DataFrame, path: Path, executor: Executor | None = None) -> None:
    """Write a frame as CSV, floats in full, probabilities of counts without ".0".

    An executor makes the text of a long one, where digits take longer than the numbers did.
    """
    n = _CELLS // max(frame.shape[1], 1) + 1
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
    """Write plain values as JSON, whole or not at all."""
    write_text(json.dumps(content, indent=2) + "\n", path)
