"""Import of arviz without the announcement that its 0.x line prints once a day."""

import warnings
from types import ModuleType

_ANNOUNCEMENT = r"\s*ArviZ is undergoing a major refactor"


def import_arviz() -> ModuleType:
    """Import arviz without its announcement of a successor, which is no concern of a run's user."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", _ANNOUNCEMENT, FutureWarning)
        import arviz
    return arviz
