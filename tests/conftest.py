"""Expensive things that many tests look at and none changes: tables, fits."""

import functools
import gc
import re
import sys
from collections.abc import Mapping
from dataclasses import dataclass, replace

import hypothesis
import numpy as np
import pandas as pd
import pytest

import ridgebayes as rb
from ridgebayes.commands import cli
from ridgebayes.model.forms import FORMS, form_named
from ridgebayes.model.observations import Observations
from ridgebayes.table.datafiles import CALCULIX_FE, data_path
from tests.once import made_once as made_once
from tests.once import making

# No clock in a test; and a test that fails today has to fail tomorrow.
hypothesis.settings.register_profile("steady", deadline=None, derandomize=True, database=None)
hypothesis.settings.register_profile(
    "short", hypothesis.settings.get_profile("steady"), max_examples=50
)


def pytest_configure(config):
    """Try half the examples where long tests are left out: the same ones are tried each time."""
    is_short = "not long" in config.option.markexpr
    hypothesis.settings.load_profile("short" if is_short else "steady")


# Tests that carry the mark `long` are left to `make test-long`: rare faults, repeats of a claim at
# further settings. Beside them `make fast` leaves out whole folders whose tests run commands, refit
# or draw reports; tests that ask for sampled fits; and modules whose tests start processes.
SLOW_FOLDERS = {
    "__init__.py",
    "checks",
    "commands",
    "comparison",
    "evidence",
    "hard_cases",
    "report",
    "results.py",
    "test_cautions.py",
    "test_notebooks.py",
    "test_pages.py",
    "test_readme.py",
    "test_results.py",
}
SLOW_FIXTURES = {"fits", "fe_fits", "comparison", "reference", "comparisons"}
PROCESS_MODULES = {
    "tests/runtime/test_atomic.py",
    "tests/runtime/test_cluster.py",
    "tests/runtime/test_pool.py",
    "tests/runtime/test_randomness.py",
    "tests/test_package.py",
}


def pytest_sessionstart():
    """Collect no garbage while tests are collected: thousands are made, and all stay."""
    gc.disable()


def pytest_collection_finish():
    gc.freeze()
    gc.enable()


def pytest_collection_modifyitems(items):
    """Mark tests by where they stand and what they ask for; others carry their marks themselves."""
    for item in items:
        path = item.path.relative_to(item.config.rootpath)
        # tests/ROOM/... and tests/test_README.py, or the examples in src/ridgebayes/ROOM/...
        place = path.parts[2] if path.parts[0] == "src" else path.parts[1]
        if place in SLOW_FOLDERS:
            item.add_marker(pytest.mark.slow)
        if SLOW_FIXTURES & set(getattr(item, "fixturenames", ())):
            item.add_marker(pytest.mark.slow)
        if path.as_posix() in PROCESS_MODULES:
            item.add_marker(pytest.mark.process)


def observed(
    texture,
    Q,
    log_load,
    *,
    rel_se=0.0,
    log_lower=np.nan,
    is_count=False,
    textures=None,
    series=None,
):
    """Rows of four textures, of which the first and the last have one a/pitch; of one series."""
    everything = ((0.012, 0.03), (0.032, 0.01), (0.022, 0.02), (0.018, 0.045))
    columns = np.broadcast_arrays(texture, Q, log_load, rel_se, log_lower, is_count)
    kinds = (np.int64, np.int64, float, float, float, bool)
    arrays = [column.astype(kind) for column, kind in zip(columns, kinds, strict=True)]
    data = Observations(textures or everything[: arrays[0].max() + 1], *arrays)
    if series is None:
        return data
    series = np.asarray(series)
    return replace(data, series=series, series_labels=tuple("abcdef"[: series.max() + 1]))


@pytest.fixture(scope="session", name="observed")
def observed_fixture():
    return observed


@pytest.fixture(scope="session")
def paper():
    return rb.paper_sweep()


@pytest.fixture(scope="session")
def fe_table():
    """Eight rows to fit, of CalculiX, and four held out."""
    return rb.read_table(data_path(CALCULIX_FE))


class Lazy(Mapping):
    """One thing per form, made when it is first asked for."""

    def __init__(self, make):
        self._make = functools.cache(make)

    def __getitem__(self, name):
        return self._make(name)

    def __iter__(self):
        return iter(FORMS)

    def __len__(self):
        return len(FORMS)


def fits_of(table, folders):
    calibrate = making(folders, rb.calibrate)
    return Lazy(lambda name: calibrate(table, form_named(name), rng=1, noise="iid"))


@pytest.fixture(scope="session")
def fits(paper, tmp_path_factory):
    """A calibrated fit of each printed form on the paper sweep, by name."""
    return fits_of(paper, tmp_path_factory)


@pytest.fixture(scope="session")
def fe_fits(fe_table, tmp_path_factory):
    """A calibrated fit of each form on the finite-element rows, by name."""
    return fits_of(fe_table, tmp_path_factory)


@dataclass(frozen=True)
class Said:
    """What a command said, and the exit code it ended with."""

    code: int
    out: str
    err: str


@pytest.fixture
def command(monkeypatch, capsys, tmp_path):
    """Call the program as the shell would, in an empty folder."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")

    def call(*words):
        monkeypatch.setattr(sys, "argv", ["ridgebayes", *map(str, words)])
        with pytest.raises(SystemExit) as stopped:
            cli.main()
        printed = capsys.readouterr()
        err = re.sub(r"\x1b\[[0-9;]*m", "", printed.err)
        return Said(stopped.value.code or 0, printed.out, err)

    return call


@pytest.fixture(scope="session")
def compare(tmp_path_factory):
    return making(tmp_path_factory, rb.compare)


@pytest.fixture(scope="session")
def comparison(compare, paper):
    return compare(paper, rng=0, noise="iid")


@pytest.fixture(scope="session")
def reference(compare, fe_table):
    forms = [rb.Classic(), rb.PowerLaw(), rb.Modified(), rb.Hybrid(), rb.HalfPlane()]
    quick = compare(fe_table, forms, rng=0, noise="iid", accuracy="quick")
    return replace(quick, accuracy="standard")  # its reports have every figure


@pytest.fixture(scope="session")
def odd_table():
    """One texture of a hostile name, loads of its own, rows that failed and rows held out."""
    q = np.arange(4, 18, 2)
    s = (q - 2) / 70 * (1 + 0.02 * np.cos(q))
    frame = pd.DataFrame(
        {
            "a_over_R": 0.02,
            "b_over_R": 0.021,
            "Q": q,
            "p_over_E": s**2,
            "texture": "<script>alert('$x$')</script> & | *",
            "role": ["calibration"] * 5 + ["held-out"] * 2,
            "solver": "my <b>solver</b>",
            "status": "ok",
        }
    )
    failed = frame.tail(1).assign(Q=20, p_over_E=np.nan, status="diverged <i>at</i> step 3")
    return rb.ContactTable.from_frame(pd.concat([frame, failed]), where="/home/me/<odd>.csv")


@pytest.fixture(scope="session")
def odd(compare, odd_table):
    return compare(odd_table, [rb.Modified(), rb.PowerLaw()], rng=3, noise="iid")


@pytest.fixture(scope="session")
def single(odd_table):
    """One form, sampled for too short a time to have converged."""
    settings = rb.SampleSettings(n_step_max=20)
    return rb.compare(odd_table, [rb.Modified()], rng=3, settings=settings, noise="iid")


@pytest.fixture(scope="session")
def faults():
    """Return the function from a figure to its clipped texts and its pairs of overlapping ones."""
    from tests.figure_texts import clipped_and_overlapping  # most tests draw nothing

    return clipped_and_overlapping
