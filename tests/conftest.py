"""Expensive things that many tests look at and none changes: tables, fits, approximations."""

import functools
import re
import sys
from collections.abc import Mapping
from dataclasses import dataclass

import hypothesis
import numpy as np
import pytest

import ridgebayes as rb
from ridgebayes.commands import cli
from ridgebayes.inference.laplace import Laplace, fit_laplace
from ridgebayes.model.forms import FORMS, form_named
from ridgebayes.model.model import Model
from ridgebayes.model.observations import Observations
from ridgebayes.table.datafiles import CALCULIX_FE, data_path

# No clock in a test; and a test that fails today has to fail tomorrow.
hypothesis.settings.register_profile("steady", deadline=None, derandomize=True, database=None)
hypothesis.settings.load_profile("steady")


class Affine:
    """Whitened coordinates u = mode + factor z: the plainest ones a density can be given."""

    def __init__(self, mode, factor):
        self.mode, self.factor = np.asarray(mode, float), np.asarray(factor, float)
        self.log_volume = float(np.linalg.slogdet(self.factor)[1])
        self.n_curved = len(self.mode)

    def unwhiten(self, z):
        return self.mode + z @ self.factor.T, np.zeros(z.shape[:-1])

    whitened = Laplace.whitened

    def whiten(self, u):
        return (u - self.mode) @ np.linalg.inv(self.factor).T, np.zeros(u.shape[:-1])


@pytest.fixture(scope="session")
def affine():
    return Affine


def observed(texture, Q, log_load, *, rel_se=0.0, log_lower=np.nan, is_count=False, textures=None):
    """Rows of four textures, of which the first and the last have one a/pitch."""
    everything = ((0.012, 0.03), (0.032, 0.01), (0.022, 0.02), (0.018, 0.045))
    columns = np.broadcast_arrays(texture, Q, log_load, rel_se, log_lower, is_count)
    kinds = (np.int64, np.int64, float, float, float, bool)
    arrays = [column.astype(kind) for column, kind in zip(columns, kinds, strict=True)]
    return Observations(textures or everything[: arrays[0].max() + 1], *arrays)


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


def fits_of(table):
    return Lazy(lambda name: rb.calibrate(table, form_named(name), rng=1))


def laplaces_of(table):
    data = Observations.from_table(table)
    return Lazy(lambda name: fit_laplace(Model(data, form_named(name))))


@pytest.fixture(scope="session")
def fits(paper):
    """A calibrated fit of each printed form on the paper sweep, by name."""
    return fits_of(paper)


@pytest.fixture(scope="session")
def fe_fits(fe_table):
    """A calibrated fit of each form on the finite-element rows, by name."""
    return fits_of(fe_table)


@pytest.fixture(scope="session")
def laplaces(paper):
    return laplaces_of(paper)


@pytest.fixture(scope="session")
def fe_laplaces(fe_table):
    return laplaces_of(fe_table)


@pytest.fixture(scope="session")
def fe_models(fe_table):
    data = Observations.from_table(fe_table)
    return Lazy(lambda name: Model(data, form_named(name)))


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
