"""Optional packages, imported where they are needed."""

from importlib import import_module
from typing import Any

from ridgebayes.errors import InputError


def extra(module: str, name: str, needed: str) -> Any:
    """Return a module of an optional package.

    Parameters
    ----------
    module : str
        The module.
    name : str
        Of the extra that installs it.
    needed : str
        What the message begins with, such as ``t.parquet: Parquet needs pyarrow``.

    Raises
    ------
    InputError
        If it is not installed.
    """
    try:
        return import_module(module)
    except ImportError:
        raise InputError(f"{needed}: pip install 'ridgebayes[{name}]'") from None
