"""Import of ArviZ without the announcement that version 0.x prints once a day."""

import os
import warnings
from tempfile import TemporaryDirectory
from types import ModuleType
from unittest.mock import patch

_ANNOUNCEMENT = r"\s*ArviZ is undergoing a major refactor"


def import_arviz() -> ModuleType:
    """Import ArviZ without the announcement of its successor, which does not concern users."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", _ANNOUNCEMENT, FutureWarning)
        try:
            import arviz
        except OSError:  # ArviZ writes the date to the user's cache folder, maybe read-only
            cache = "XDG_CACHE_HOME"
            with TemporaryDirectory() as folder, patch.dict(os.environ, {cache: folder}):
                import arviz
    module: ModuleType = arviz  # some versions of ArviZ have type hints, others do not
    return module
