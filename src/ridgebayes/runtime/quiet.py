"""Import of arviz without the announcement that its 0.x line prints once a day."""

import os
import warnings
from tempfile import TemporaryDirectory
from types import ModuleType
from unittest.mock import patch

_ANNOUNCEMENT = r"\s*ArviZ is undergoing a major refactor"


def import_arviz() -> ModuleType:
    """Import arviz without its announcement of a successor, which is no concern of a run's user."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", _ANNOUNCEMENT, FutureWarning)
        try:
            import arviz
        except OSError:  # it notes the day in the user's cache folder, which may be read-only
            cache = "XDG_CACHE_HOME"
            with TemporaryDirectory() as folder, patch.dict(os.environ, {cache: folder}):
                import arviz
    module: ModuleType = arviz  # which of its two lines has types, the other none
    return module
