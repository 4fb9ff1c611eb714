"""The command line: which commands there are, and errors turned into exit codes.

Exit code 0 is done, 1 a computation that failed or did not converge (what was finished is written),
2 bad input or usage (nothing written).

What a command does is the function `command` of the module of its name, loaded when the command is
called: until then nothing heavy is, so that help is quick.
"""

import inspect
import os
import signal
import sys
from collections.abc import Callable
from importlib import import_module
from typing import Any

# One BLAS thread: the matrices are small, and threads only fight. Before numpy is imported.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import typer

from ridgebayes.commands import options
from ridgebayes.errors import ComputationError, InputError

_COMMANDS: dict[str, tuple[str, type[Any]]] = {  # by name: module, and options
    "run": ("run", options.Run),
    "generate": ("generate", options.Generate),
    "fit": ("fit", options.Fit),
    "compare": ("compare", options.Compare),
    "predict": ("predict", options.Predict),
    "coverage": ("coverage", options.Coverage),
    "plan": ("plan", options.Plan),
    "cost": ("cost", options.Cost),
    "import": ("import_", options.Import),
    "export-deck": ("export_deck", options.ExportDeck),
    "report": ("report", options.Report),
}
# What workers of a run import at the same time as this process.
_OF_A_RUN = ("ridgebayes.commands.run", "ridgebayes.report.figures.gallery", "arviz", "corner")
app = typer.Typer(
    help="How many ridges does a soft body touch, how certain is that, and which contact model "
    "does the evidence support?",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)


def _caller(module: str, options_of: type[Any]) -> Callable[..., None]:
    """Return the function of a command, whose parameters are the fields of its options."""

    def call(**given: Any) -> None:
        asked = options_of(**given)
        if module == "run" and asked.scheduler is None and asked.workers != 1:
            # Workers import at the same time as this process, so their server starts first.
            import_module("ridgebayes.runtime.pool").start_server(_OF_A_RUN)
        import_module(f"ridgebayes.commands.{module}").command(asked)

    call.__name__, call.__doc__ = module, options_of.__doc__
    call.__annotations__ = options_of.__annotations__
    call.__signature__ = inspect.signature(options_of)  # type: ignore[attr-defined]
    return call


for _name, _what in _COMMANDS.items():
    app.command(_name)(_caller(*_what))


def main() -> None:
    """Run the command line, with errors as one message on standard error and an exit code."""
    # Typer ends silently on its own KeyboardInterrupt; this one reaches the message below.
    signal.signal(signal.SIGINT, _interrupt)
    try:
        app()
    except InputError as error:
        _stop(error, 2)
    except ComputationError as error:
        _stop(error, 1)
    except OSError as error:
        why = " ".join(str(error.strerror or error).split())
        _stop(f"{error.filename or 'output'}: {why}", 1)
    except _Interrupted:
        _stop("interrupted; continue run, fit or generate with --resume", 130)


class _Interrupted(BaseException):
    """Ctrl-C, past whatever catches exceptions."""


def _interrupt(signum: int, frame: object) -> None:
    raise _Interrupted


def _stop(why: object, code: int) -> None:
    print(f"ridgebayes: {why}", file=sys.stderr)
    sys.exit(code)
