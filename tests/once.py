"""What many tests and examples ask for is made once, whichever worker asks first.

Fits and comparisons are records that nobody changes, and equal requests give equal bytes.
"""

import functools
import hashlib
import os
import pickle

import pytest
from filelock import FileLock

import ridgebayes as rb


def once(tmp_path_factory, request, make):
    """Return what was made at the first such request of this session, in any worker."""
    folder = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        folder = folder.parent  # that of all workers
    path = folder / f"{hashlib.sha256(repr(request).encode()).hexdigest()}.pickle"
    with FileLock(f"{path}.lock"):
        if not path.is_file():
            path.write_bytes(pickle.dumps(make()))
    return pickle.loads(path.read_bytes())


def making(tmp_path_factory, function):
    """Return `calibrate` or `compare`, made once for equal tables, forms and options."""

    @functools.wraps(function)
    def found(table, *forms, **options):
        plain = all(isinstance(value, str | int) for value in options.values())
        if not (plain and isinstance(table, rb.ContactTable)):
            return function(table, *forms, **options)
        request = (function.__name__, table.where, table.digest(), forms, sorted(options.items()))
        return once(tmp_path_factory, request, lambda: function(table, *forms, **options))

    return found


@pytest.fixture
def made_once(tmp_path_factory, monkeypatch):
    """Examples that ask for the same fit or comparison get it without making it again."""
    for name in ("calibrate", "compare"):
        monkeypatch.setattr(rb, name, making(tmp_path_factory, getattr(rb, name)))
