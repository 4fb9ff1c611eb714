"""Files of a run folder: writing and reading of a comparison."""

import io
import json
import os
from collections.abc import Iterable, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd

from ridgebayes.checks.cost import COST_COLUMNS
from ridgebayes.checks.coverage import COVERAGE_COLUMNS
from ridgebayes.checks.left_out import LEFT_OUT_COLUMNS
from ridgebayes.commands.run_folder import PARTIAL, RUN_JSON, write_csv, write_json
from ridgebayes.comparison.bayes_factors import BAYES_FACTOR_COLUMNS
from ridgebayes.comparison.citations import citations
from ridgebayes.comparison.comparison import Comparison
from ridgebayes.comparison.scores import LOO_COLUMNS
from ridgebayes.errors import InputError, expect
from ridgebayes.evidence.pairs import MIN_FORM_PROBABILITY
from ridgebayes.evidence.prior_sensitivity import SENSITIVITY_COLUMNS
from ridgebayes.evidence.tables import EVIDENCE_COLUMNS, error_model_weights, used_evidence
from ridgebayes.inference.netcdf import read_netcdf, write_netcdf
from ridgebayes.inference.posterior import Posterior
from ridgebayes.inference.presets import Preset
from ridgebayes.model.forms import FORMS
from ridgebayes.model.noise import NUGGET, Noise
from ridgebayes.results import Fit
from ridgebayes.runtime.pool import map_ordered
from ridgebayes.runtime.reading import LARGEST_TEXT, read_bytes, refusing
from ridgebayes.runtime.text import clipped, versions
from ridgebayes.table.table import ContactTable, read_table

EMBEDDED, REFERENCE = "embedded sweep", "reference-fe"
OTHERS = "posteriors"  # sub-folder for posteriors of error models that are not selected
# File and columns of each further table of a comparison, by attribute.
_TABLES = {
    "bayes_factors": ("bayes_factors.csv", BAYES_FACTOR_COLUMNS),
    "loo": ("loo.csv", LOO_COLUMNS),
    "prior_sensitivity": ("prior_sensitivity.csv", SENSITIVITY_COLUMNS),
    "left_out": ("left_out.csv", LEFT_OUT_COLUMNS),
    "coverage": ("coverage.csv", COVERAGE_COLUMNS),
    "cost": ("costs.csv", COST_COLUMNS),
}
# Kinds of the values of run.json that are read.
_KINDS = {
    **dict.fromkeys(("table", "noise", "accuracy", "command"), str),
    **dict.fromkeys(("verdicts", "options"), dict),
    **{"forms": list, "fits": list, "nugget": float, "seed": int},
}
# Commands that write other folders, by a file that identifies the folder.
_OTHER_FOLDERS = {"coverage.json": "coverage", "cost.csv": "cost", "design.json": "design"}
_OPTIONAL_TABLES = ("left_out", "coverage", "cost")
_FORM_COLUMNS = ("form", "form_a", "form_b")  # columns with names of forms
_LABELS = ("noise", "method", "status", "reading", "prior", "leave", "failed", "task", "preset")
_TEXT_COLUMNS = _FORM_COLUMNS + _LABELS


def write_fits(comparison: Comparison, folder: Path, executor: Executor | None = None) -> None:
    """Write the table, all posteriors, their summary and the evidences.

    The posterior file of a form contains draws of prior and predictions unless the run is quick or
    the form has negligible probability.
    """
    comparison.table.write(folder / "table.csv")
    extras, shares = Preset.named(comparison.accuracy).extras, comparison.probabilities
    tasks: list[tuple[Posterior, Path, bool]] = []
    for name, fit in comparison.fits.items():
        selected = replace(fit, others={}, error_model_weights={})
        complete = extras and shares.get(name, 1.0) >= MIN_FORM_PROBABILITY
        tasks.append((selected, folder / f"posterior-{name}.nc", complete))
        for noise, posterior in fit.others.items():
            (folder / OTHERS).mkdir(exist_ok=True)
            tasks.append((posterior, folder / other_file(name, noise), False))
    write_csv(summary_table(comparison.fits.values()), folder / "summary.csv")
    write_csv(comparison.evidence, folder / "evidence.csv")
    for _ in map_ordered(_write_posterior, tasks, executor, name=lambda task: task[1].name):
        pass


def _write_posterior(task: tuple[Posterior, Path, bool]) -> None:
    posterior, path, complete = task
    write_netcdf(posterior, path, complete=complete)


def write_comparison(
    comparison: Comparison, folder: Path, executor: Executor | None = None
) -> None:
    """Write the files of `write_fits`, and Bayes factors, scores and prior sensitivity.

    Left-out scores, coverage and costs are written if the comparison has them. The workers of the
    executor must write to this machine's files.
    """
    write_fits(comparison, folder, executor)
    for name, (file, _) in _TABLES.items():
        frame = getattr(comparison, name)
        if len(frame) or name not in _OPTIONAL_TABLES:
            write_csv(frame, folder / file)
    write_csv(comparison.components, folder / "components.csv")  # derived, never read


def other_file(form: str, noise: str) -> str:
    """Return the file name of a posterior whose error model is not selected."""
    return f"{OTHERS}/{form}--{noise.replace(':', '-')}.nc"


def summary_table(fits: Iterable[Fit]) -> pd.DataFrame:
    """Return the summaries of fits as one frame that starts with columns form and noise."""
    parts = {
        (fit.form.name, noise): posterior.summary
        for fit in fits
        for noise, posterior in fit.posteriors.items()
    }
    return pd.concat(parts, names=["form", "noise"]).reset_index(["form", "noise"])


def write_run_json(
    folder: Path,
    comparison: Comparison,
    *,
    command: str,
    seed: int,
    options: dict[str, Any],
    stages: Sequence[dict[str, Any]],
    reference: Comparison | None = None,
    peak_memory: int | None = None,
) -> None:
    """Write run.json with versions, seed, options, stage times, memory and verdicts."""
    content = about_run(command, seed, options, comparison.table) | {
        "forms": [*comparison.fits, *comparison.failures],
        "noise": comparison.noise.name,
        "nugget": comparison.noise.nugget,
        "accuracy": comparison.accuracy,
        "stages": list(stages),
        **verdicts(comparison),
        "peak_memory_bytes": peak_memory,
        "citations": citations(comparison).to_dict("records"),
    }
    if reference is not None:
        content[REFERENCE] = verdicts(reference)
    write_json(content, folder / RUN_JSON)


def about_run(
    command: str, seed: int, options: dict[str, Any], table: ContactTable
) -> dict[str, Any]:
    """Return the provenance of a folder: command, versions, seed, options and table."""
    return {
        "command": command,
        "versions": versions(),
        "seed": seed,
        "options": options,
        "table": table.where,
        "table_digest": table.digest(),
    }


def verdicts(comparison: Comparison) -> dict[str, Any]:
    """Return the machine-readable results of a comparison: verdict, fits and convergence.

    The fits list form, noise, weight, sampler and convergence of every posterior that is used for
    predictions.
    """
    verdict, fits, shares = comparison.verdict, comparison.fits, comparison.probabilities
    used = used_evidence(comparison.evidence).set_index(["form", "noise"])["model_probability"]
    return {
        "verdict": None if verdict is None else verdict.to_dict(),
        "fits": [
            {
                "form": form,
                "noise": noise,
                "weight": float(used.get((form, noise), 0.0)),
                "sampler": posterior.sampler,
                "converged": posterior.converged,
                "why": "; ".join(_failures(posterior, shares.get(form, 1.0))),
            }
            for form, fit in fits.items()
            for noise, posterior in fit.posteriors.items()
        ],
        "verdicts": {
            "complete": comparison.complete,
            "best": comparison.best if shares else None,
            "probabilities": shares,
            "prior_probabilities": comparison.prior_probabilities,
            "converged": {name: fit.converged for name, fit in fits.items()},
            "missing": {
                name: fit.convergence_failures for name, fit in fits.items() if not fit.converged
            },
            "failures": comparison.failures,
            "noise": comparison.noise.name,
            "caution": comparison.noise.caution,
            "n_calibration": len(comparison.table.calibration),
            "n_held_out": len(comparison.table.held_out),
            "n_left_out": len(comparison.table.left_out),
        },
    }


def _failures(posterior: Posterior, share: float) -> tuple[str, ...]:
    """Return the convergence failures, with a note if a negligible form got no more draws."""
    failures = posterior.convergence_failures
    if not failures or share >= MIN_FORM_PROBABILITY:
        return failures
    negligible = f"the form's probability is below {MIN_FORM_PROBABILITY:g}"
    return (*failures, f"no more draws were taken: {negligible}, and nothing rests on it")


def read_run(folder: str | os.PathLike[str]) -> Comparison:
    """Read the comparison of a run folder, with the thinned posteriors of all error models.

    Parameters
    ----------
    folder : path
        Run folder, or its sub-folder ``reference-fe``.

    Returns
    -------
    Comparison
        Comparison; tables that the run did not write are empty.

    Raises
    ------
    InputError
        If the folder is not a run folder, or a file is missing or damaged.

    Examples
    --------
    >>> import tempfile
    >>> import ridgebayes as rb
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     what = {"noise": "iid", "accuracy": "quick", "command": "compare"}
    ...     done = rb.run(rb.paper_sweep(), f"{folder}/out", forms=["modified", "hybrid"], **what)
    ...     again = rb.read_run(f"{folder}/out")
    >>> again.verdict.grade, again.cautions == done.cautions
    ('supports', True)
    """
    expect(str, os.PathLike, folder=folder)
    folder = Path(folder)
    about = _read_about(folder)
    failures, forms = about["verdicts"]["failures"], about["forms"]
    noise = replace(Noise.named(about["noise"]), nugget=about["nugget"])
    evidence = _read_csv(folder / "evidence.csv", EVIDENCE_COLUMNS, forms)
    fits = {
        name: _read_fit(folder, name, noise.name, about["fits"], evidence)
        for name in forms
        if name not in failures
    }
    tables = {
        name: _read_csv(folder / file, columns, forms, optional=True)
        for name, (file, columns) in _TABLES.items()
    }
    return Comparison(
        replace(read_table(folder / "table.csv"), where=about["table"]),
        noise,
        fits,
        evidence,
        failures=failures,
        accuracy=about["accuracy"],
        **tables,
    )


def read_command(folder: Path) -> tuple[str, dict[str, Any], int]:
    """Return the command, options and seed of a run folder.

    Raises
    ------
    InputError
        If the folder is not a run folder, or run.json is damaged.
    """
    about = _read_about(folder)
    return about["command"], about["options"], about["seed"]


def _read_fit(
    folder: Path, form: str, noise: str, listed: Sequence[dict[str, Any]], evidence: pd.DataFrame
) -> Fit:
    """Read the posteriors of a form: the selected error model, and others with weight."""
    selected = _read_posterior(folder / f"posterior-{form}.nc", form, noise)
    drawn = {noise: selected}
    for other in (entry["noise"] for entry in listed if entry["form"] == form):
        if other not in drawn:
            drawn[other] = _read_posterior(folder / other_file(form, other), form, other)
    return Fit.of(selected, error_model_weights(evidence, form), drawn)


def _read_posterior(path: Path, form: str, noise: str) -> Posterior:
    posterior = read_netcdf(path)
    names = {"form": (posterior.form.name, form), "error model": (posterior.noise.name, noise)}
    for what, (name, expected) in names.items():
        if name != expected:
            raise InputError(f"{path}: holds {what} {name!r}; expected {expected!r}")
    return posterior


def _read_about(folder: Path) -> dict[str, Any]:
    path = folder / RUN_JSON
    if not path.is_file():
        rule = "expected a folder written by ridgebayes run, compare or fit"
        raise InputError(f"{folder}: {_why_no_run(folder)}; {rule}")
    # json raises RecursionError for thousands of nested brackets.
    with refusing(f"{path}: damaged, not JSON", ValueError, RecursionError, rule="; run again"):
        about: dict[str, Any] = json.loads(read_bytes(path, LARGEST_TEXT).decode("utf-8"))
    try:
        about = {"nugget": NUGGET} | about
        is_valid = all(isinstance(about[key], kind) for key, kind in _KINDS.items())
        failures = about["verdicts"]["failures"]
        texts = [*about["forms"], *failures, *failures.values()]
        fits = [(entry["form"], entry["noise"]) for entry in about["fits"]]
    except KeyError as error:
        raise InputError(f"{path}: damaged, key {error} is missing; run again") from None
    except (AttributeError, TypeError):
        is_valid, texts = False, []
    if not is_valid or not all(isinstance(text, str) for text in texts):
        raise InputError(f"{path}: damaged, not what ridgebayes writes; run again")
    # Names of forms and error models become parts of file names, which must stay in the folder.
    for name in [*about["forms"], *(form for form, _ in fits)]:
        if name not in FORMS:
            raise InputError(f"{path}: form {clipped(name)}; expected one of {', '.join(FORMS)}")
    for _, noise in fits:
        Noise.named(str(noise))
    return about


def _why_no_run(folder: Path) -> str:
    """Return the reason why a folder is not the folder of a finished run."""
    named = folder if folder.name else folder.absolute()  # "." has no name
    is_partial = named.name.startswith(".") and named.name.endswith(PARTIAL)
    partial = folder if is_partial else named.parent / f".{named.name}{PARTIAL}"
    if partial.is_dir():
        return f"the run is not finished, its parts are in {partial}; continue it with --resume"
    if not folder.exists():
        return "no such folder"
    if not folder.is_dir():
        return "is a file"
    for name, command in _OTHER_FOLDERS.items():
        if (folder / name).is_file():
            return f"written by ridgebayes {command}, not a run"
    return f"not a run folder, no {RUN_JSON} in it"


def _read_csv(
    path: Path, columns: Sequence[str], forms: Sequence[str], *, optional: bool = False
) -> pd.DataFrame:
    """Read a table of the run folder, and check its columns, their types and the names of forms."""
    if not path.is_file():
        if optional:
            return pd.DataFrame(columns=list(columns))
        raise InputError(f"{path}: missing; run again")
    with refusing(f"{path}: damaged", ValueError, OverflowError, rule="; run again"):
        frame = pd.read_csv(io.BytesIO(read_bytes(path)), dtype=dict.fromkeys(_TEXT_COLUMNS, "str"))
    if list(frame.columns) != list(columns):
        raise InputError(f"{path}: damaged; expected columns {', '.join(columns)}; run again")
    if "failed" in frame:  # an empty cell means no failure
        frame["failed"] = frame["failed"].fillna("")
    for name in columns:
        cells = frame[name]
        if name in _TEXT_COLUMNS:
            bad = cells.isna() if name not in _FORM_COLUMNS else ~cells.isin(forms)
            if bad.any():
                shown = clipped(str(cells[bad].iloc[0]))
                raise InputError(f"{path}: damaged, {name} {shown}; run again")
        elif len(frame) and cells.dtype.kind not in ("b" if name == "used" else "iuf"):
            raise InputError(f"{path}: damaged, {name} is not all numbers; run again")
    return frame
