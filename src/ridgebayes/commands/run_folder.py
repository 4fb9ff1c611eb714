"""The folder of one run: what is in it, how it is written whole or not at all, and read back."""

import io
import json
import os
import platform
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import pandas as pd

from ridgebayes.checks.cost.measured import SHORT_COLUMNS
from ridgebayes.checks.coverage import COVERAGE_COLUMNS
from ridgebayes.checks.left_out import LEFT_OUT_COLUMNS
from ridgebayes.comparison.bayes_factors import BAYES_FACTOR_COLUMNS
from ridgebayes.comparison.comparison import Comparison
from ridgebayes.comparison.scores import LOO_COLUMNS
from ridgebayes.errors import InputError, OutputError, RidgebayesError
from ridgebayes.evidence.prior_sensitivity import SENSITIVITY_COLUMNS
from ridgebayes.evidence.tables import EVIDENCE_COLUMNS
from ridgebayes.model.forms import FORMS
from ridgebayes.model.noise import Noise
from ridgebayes.results import Fit
from ridgebayes.runtime.atomic import exclusive_lock, replacing
from ridgebayes.runtime.reading import LARGEST_TEXT, read_bytes
from ridgebayes.runtime.text import clipped, one_line_message
from ridgebayes.table.table import read_table

RUN_JSON = "run.json"
REFERENCE = "reference-fe"
LEFT_OUT, COVERAGE, COST = "left_out.csv", "coverage.csv", "costs.csv"
CHAINS = "chains-*.h5"
_FORM = ("form", "form_a", "form_b")  # columns of forms of the run
_TEXT = (*_FORM, "noise", "method", "status", "reading", "prior", "leave", "failed", "task")
_PACKAGES = ("ridgebayes", "numpy", "scipy", "pandas", "emcee", "arviz", "xarray", "matplotlib")


@contextmanager
def new_folder(
    path: Path, *, force: bool = False, resume: bool = False, about: str = RUN_JSON
) -> Iterator[Path]:
    """Give a folder to write into that takes its final name only when all is done.

    Parameters
    ----------
    path : Path
        Final name.
    force : bool, optional
        Whether a run folder of that name may be replaced. It is removed at the very end.
    resume : bool, optional
        Whether to go on in the partial folder that an earlier run left.
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
        yield from _made(path, resume)


def _refuse_occupied(path: Path, force: bool, about: str) -> None:
    if os.path.lexists(path):  # a link that leads nowhere is in the way as well
        if not force:
            raise InputError(f"{path}: exists; use another -o, or --force to replace it")
        if not path.is_dir() or (any(path.iterdir()) and not (path / about).is_file()):
            raise InputError(
                f"{path}: not a run folder (no {about} in it); --force replaces only those"
            )


def _made(path: Path, resume: bool) -> Iterator[Path]:
    """Give the partial folder, and then its name to it: what `new_folder` does under its lock."""
    partial = path.with_name(f".{path.name}.partial")
    try:
        resumed = resume and partial.is_dir()
        if resumed:
            _keep_only_chains(partial)
        elif partial.exists():
            shutil.rmtree(partial)
        partial.mkdir(parents=True, exist_ok=resumed)
    except OSError as error:
        raise InputError(f"{path}: cannot be created ({error.strerror})") from None
    try:
        yield partial
        _name(partial, path)
    except (RidgebayesError, OSError) as error:
        if not partial.is_dir():
            raise OutputError(
                f"{path}: its folder {partial} is gone; leave it alone until the end"
            ) from None
        if isinstance(error, InputError):
            if not resumed:
                shutil.rmtree(partial, ignore_errors=True)
        elif not any(partial.iterdir()):
            partial.rmdir()
        elif isinstance(error, OutputError):
            raise OutputError(f"{error}; what is finished is kept in {partial}") from None
        raise


def _name(partial: Path, path: Path) -> None:
    """Give a folder that is done its final name, in place of one that has it."""
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


def write_csv(frame: pd.DataFrame, path: Path) -> None:
    """Write a frame as CSV, floats in full, whole or not at all."""
    write_text(frame.to_csv(index=False, lineterminator="\n"), path)


def write_text(text: str, path: Path) -> None:
    """Write a text file whole or not at all."""
    with replacing(path) as partial:
        partial.write_text(text, encoding="utf-8", newline="\n")


def write_fits(comparison: Comparison, folder: Path) -> None:
    """Write the table, each posterior and the summary and evidence of all."""
    comparison.table.write(folder / "table.csv")
    for name, fit in comparison.fits.items():
        fit.to_netcdf(folder / f"posterior-{name}.nc")
    write_csv(summary_table(comparison.fits.values()), folder / "summary.csv")
    write_csv(comparison.evidence, folder / "evidence.csv")


def write_comparison(comparison: Comparison, folder: Path) -> None:
    """Write what `write_fits` does, and the Bayes factors, scores and prior sensitivity.

    Left-out scores, coverage and costs are written where there are any.
    """
    write_fits(comparison, folder)
    write_csv(comparison.bayes_factors, folder / "bayes_factors.csv")
    write_csv(comparison.loo, folder / "loo.csv")
    write_csv(comparison.prior_sensitivity, folder / "prior_sensitivity.csv")
    for frame, name in (
        (comparison.left_out, LEFT_OUT),
        (comparison.coverage, COVERAGE),
        (comparison.cost, COST),
    ):
        if len(frame):
            write_csv(frame, folder / name)


def summary_table(fits: Sequence[Fit] | Any) -> pd.DataFrame:
    """Return the summaries of several fits as one frame, form and noise first."""
    parts = []
    for fit in fits:
        part = fit.summary.copy()
        part.insert(0, "noise", fit.noise.name)
        part.insert(0, "form", fit.form.name)
        parts.append(part)
    return pd.concat(parts, ignore_index=True)


def write_run_json(
    folder: Path,
    comparison: Comparison,
    *,
    command: str,
    seed: int,
    options: dict[str, Any],
    stages: Sequence[dict[str, Any]],
    reference: Comparison | None = None,
) -> None:
    """Write versions, seed, options, stage times and verdicts."""
    content = {
        "command": command,
        "versions": versions(),
        "seed": seed,
        "options": options,
        "table": comparison.table.where,
        "table_digest": comparison.table.digest(),
        "forms": [*comparison.fits, *comparison.failures],
        "noise": comparison.noise.name,
        "accuracy": comparison.accuracy,
        "stages": list(stages),
        "verdicts": verdicts(comparison),
    }
    if reference is not None:
        content[REFERENCE] = verdicts(reference)
    write_text(json.dumps(content, indent=2) + "\n", folder / RUN_JSON)


def verdicts(comparison: Comparison) -> dict[str, Any]:
    """Return what a program wants to know of a comparison."""
    return {
        "complete": comparison.complete,
        "best": comparison.best if comparison.probabilities else None,
        "probabilities": comparison.probabilities,
        "converged": {name: fit.converged for name, fit in comparison.fits.items()},
        "missing": {
            name: fit.convergence_failures
            for name, fit in comparison.fits.items()
            if fit.convergence_failures
        },
        "failures": comparison.failures,
        "noise": comparison.noise.name,
        "caution": comparison.noise.caution,
        "n_calibration": len(comparison.table.calibration),
        "n_held_out": len(comparison.table.held_out),
        "n_left_out": len(comparison.table.left_out),
    }


def read_run(folder: Path) -> Comparison:
    """Read a comparison back; its fits hold thinned chains.

    Parameters
    ----------
    folder : Path
        A run folder, or its ``reference-fe``.

    Returns
    -------
    Comparison
        Tables that the run did not write are empty.

    Raises
    ------
    InputError
        If it is not a run folder, or a file in it is missing or damaged.
    """
    about = _read_about(folder)
    failures, forms = about["verdicts"]["failures"], about["forms"]
    fits = {}
    for name in forms:
        if name not in failures:
            path = folder / f"posterior-{name}.nc"
            fits[name] = Fit.from_netcdf(path)
            if fits[name].form.name != name:
                raise InputError(f"{path}: holds form {fits[name].form.name!r}; expected {name!r}")
    return Comparison(
        replace(read_table(folder / "table.csv"), where=about["table"]),
        Noise.named(about["noise"]),
        fits,
        _read_csv(folder / "evidence.csv", EVIDENCE_COLUMNS, forms),
        _read_csv(folder / "bayes_factors.csv", BAYES_FACTOR_COLUMNS, forms, optional=True),
        _read_csv(folder / "loo.csv", LOO_COLUMNS, forms, optional=True),
        _read_csv(folder / "prior_sensitivity.csv", SENSITIVITY_COLUMNS, forms, optional=True),
        failures,
        _read_csv(folder / LEFT_OUT, LEFT_OUT_COLUMNS, forms, optional=True),
        _read_csv(folder / COVERAGE, COVERAGE_COLUMNS, forms, optional=True),
        about["accuracy"],
        _read_csv(folder / COST, SHORT_COLUMNS, forms, optional=True),
    )


def _read_about(folder: Path) -> dict[str, Any]:
    path = folder / RUN_JSON
    if not path.is_file():
        raise InputError(f"{folder}: no {RUN_JSON} in it; expected a folder written by ridgebayes")
    content = read_bytes(path, LARGEST_TEXT)
    try:
        about = json.loads(content.decode("utf-8"))
        named = [about["forms"], about["table"], about["noise"], about["accuracy"]]
        named.append(about["verdicts"]["failures"])
    # Thousands of brackets in each other: RecursionError.
    except (ValueError, RecursionError) as error:
        raise InputError(
            f"{path}: damaged, not JSON ({one_line_message(error)}); run again"
        ) from None
    except KeyError as error:
        raise InputError(f"{path}: damaged, key {error} is missing; run again") from None
    except TypeError:
        raise InputError(f"{path}: damaged, not what ridgebayes writes; run again") from None
    failures = about["verdicts"]["failures"]
    if not all(map(isinstance, named, (list, str, str, str, dict))) or not all(
        isinstance(one, str) for one in (*about["forms"], *failures, *failures.values())
    ):
        raise InputError(f"{path}: damaged, not what ridgebayes writes; run again")
    for name in about["forms"]:  # part of a file's name below, which must not lead elsewhere
        if name not in FORMS:
            raise InputError(f"{path}: form {clipped(name)}; expected one of {', '.join(FORMS)}")
    return about


def _read_csv(
    path: Path, columns: Sequence[str], forms: Sequence[str], *, optional: bool = False
) -> pd.DataFrame:
    """Read a frame that was written here: its columns, of their kinds, on forms of the run."""
    if not path.is_file():
        if optional:
            return pd.DataFrame(columns=list(columns))
        raise InputError(f"{path}: missing or damaged (no such file); run again")
    try:
        frame = pd.read_csv(io.BytesIO(read_bytes(path)), dtype=dict.fromkeys(_TEXT, "str"))
    except (ValueError, OverflowError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(
            f"{path}: missing or damaged ({one_line_message(error)}); run again"
        ) from None
    if list(frame.columns) != list(columns):
        raise InputError(f"{path}: damaged; expected columns {', '.join(columns)}; run again")
    if "failed" in frame:  # no failure is an empty text, not a missing one
        frame["failed"] = frame["failed"].fillna("")
    for name in columns:
        cells = frame[name]
        if name in _TEXT:
            bad = cells.isna() if name not in _FORM else ~cells.isin(forms)
            if bad.any():
                shown = clipped(str(cells[bad].iloc[0]))
                raise InputError(f"{path}: damaged, {name} {shown}; run again")
        elif len(frame) and cells.dtype.kind not in ("b" if name == "used" else "iuf"):
            raise InputError(f"{path}: damaged, {name} is not all numbers; run again")
    return frame


def versions() -> dict[str, str]:
    """Return the versions of Python, this package and those its numbers depend on."""
    found = {"python": platform.python_version()}
    for name in _PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "unknown"
    return found
