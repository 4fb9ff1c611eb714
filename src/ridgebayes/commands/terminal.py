"""Final output of a command: text and tables for people, or one JSON object for programs."""

import json
import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ridgebayes._types import __version__
from ridgebayes.commands.shared_options import Output
from ridgebayes.runtime.progress import VERBOSITY

MOST_SHOWN = 5  # rows shown for a texture (loads) or a form (coefficients, error models)
_MAX_NAMES_LISTED = 16  # files and folders in one line


@dataclass(frozen=True)
class Answer:
    """Result of a command, to be printed.

    Parameters
    ----------
    parts : sequence of str or pandas.DataFrame
        Sentences and tables in the order of printing.
    result : object, optional
        Machine-readable result for --json.
    files : sequence of Path, optional
        Written files.
    details : sequence of str or pandas.DataFrame, optional
        Sentences and tables that are printed with --verbose only.
    warnings : sequence of str, optional
        Warnings to print on standard error.
    early : sequence of str, optional
        Warnings that were already printed before the computation.
    problem : str, optional
        Failures of computation or convergence. If not empty, the exit code is 1.
    """

    parts: Sequence[str | pd.DataFrame] = ()
    result: Any = None
    files: Sequence[Path] = ()
    details: Sequence[str | pd.DataFrame] = ()
    warnings: Sequence[str] = ()
    early: Sequence[str] = ()
    problem: str = ""


def tell(command: str | None, answer: Answer, code: int, error: str, output: Output) -> None:
    """Print the result of a command, its warnings and its error.

    Parameters
    ----------
    command : str or None
        Name of the command, or None if it is unknown.
    answer : Answer
        Result of the command.
    code : int
        Exit code.
    error : str
        Error message; empty if there is none.
    output : Output
        Options for the amount and format of the output.
    """
    sentences = [part for part in answer.parts if isinstance(part, str)]
    if output.as_json:
        content = {
            "command": command,
            "version": __version__,
            "exit_code": code,
            "messages": [*answer.early, *sentences, *answer.warnings],
            "files": answer.files,
            "result": answer.result,
        } | ({"error": error} if error else {})
        print(json.dumps(to_plain(content), indent=2))
    elif not output.quiet:
        for part in (*answer.parts, *(answer.details if output.verbose else ())):
            print(part if isinstance(part, str) else _table_text(part))
        # A single file that a sentence already names is not listed again.
        named = any(str(file) in text for file in answer.files[:1] for text in sentences)
        if answer.files and not (named and len(answer.files) == 1):
            print(f"Written: {_names(answer.files)}")
    print(end="", flush=True)
    if not output.quiet:
        warn(*answer.warnings)
    if error:
        print(f"ridgebayes: {error}", file=sys.stderr)


def warn(*warnings: str) -> tuple[str, ...]:
    """Print warnings on standard error, unless the command is quiet, and return them."""
    for warning in warnings if VERBOSITY.get() >= 0 else ():
        print(f"ridgebayes: warning: {warning}", file=sys.stderr, flush=True)
    return warnings


def files_in(folder: Path) -> list[Path]:
    """Return all files in a folder and its sub-folders."""
    return sorted(path for path in folder.rglob("*") if path.is_file())


def to_plain(value: Any) -> Any:
    """Convert a value to JSON types, with tables as rows and NaN and infinity as null.

    Examples
    --------
    >>> to_plain({"rows": pd.DataFrame({"a": [1.0, float("nan")]}), "file": Path("t.csv")})
    {'rows': [{'a': 1.0}, {'a': None}], 'file': 't.csv'}
    """
    if isinstance(value, pd.DataFrame):
        return to_plain(value.to_dict("records"))
    if isinstance(value, Mapping):
        return {str(key): to_plain(item) for key, item in value.items()}
    if isinstance(value, np.generic | np.ndarray):
        return to_plain(value.tolist())
    if isinstance(value, list | tuple):
        return [to_plain(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if value is None or isinstance(value, str | int) else str(value)


def _table_text(frame: pd.DataFrame) -> str:
    """Format a table, with rules and the width of the terminal, or plainly if output is piped."""
    # rich is imported only if there is a table to print.
    from rich import box
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    ruled = sys.stdout is not None and sys.stdout.isatty()
    table = Table(box=box.SIMPLE_HEAD if ruled else None, pad_edge=False)
    for name, kind in zip(frame.columns, frame.dtypes, strict=True):
        table.add_column(Text(str(name)), justify="right" if kind.kind in "iuf" else "left")
    for row in frame.itertuples(index=False):
        table.add_row(*(Text(f"{x:.4g}" if isinstance(x, float) else str(x)) for x in row))
    console = Console(width=None if ruled else 1_000)
    with console.capture() as text:
        console.print(table)
    return "\n".join(line.rstrip() for line in text.get().splitlines())


def _names(files: Sequence[Path]) -> str:
    """Return a line with the names of files, and sub-folders with their number of files."""
    if len(files) == 1:
        return str(files[0])
    top = min((file.parent for file in files), key=lambda folder: len(folder.parts))
    inner: dict[str, int] = {}
    for file in files:
        name, *deeper = file.relative_to(top).parts if file.is_relative_to(top) else [str(file)]
        key = f"{name}/" if deeper else name
        inner[key] = inner.get(key, 0) + bool(deeper)
    shown = [f"{name} ({n} file{'s' * (n > 1)})" if n else name for name, n in inner.items()]
    if len(shown) > _MAX_NAMES_LISTED:
        shown[_MAX_NAMES_LISTED:] = [f"and {len(shown) - _MAX_NAMES_LISTED} more"]
    return f"{'' if top == Path() else f'{top}: '}{', '.join(shown)}"
