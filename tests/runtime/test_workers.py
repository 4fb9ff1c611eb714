"""Which options give which executor, and what is said of wrong ones."""

import builtins
import os
import sys

import pytest

from ridgebayes.errors import InputError
from ridgebayes.runtime.workers import executor_for, n_cpu, workers

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def test_executor_for__one_process_is_this_one():
    for n in (None, 1):
        with executor_for(n) as executor:
            assert executor is None
    with executor_for(2) as executor:
        assert executor.n_worker == 2
        assert executor.submit(os.getpid).result() != os.getpid()


def test_workers__have_one_thread_each_and_leave_no_trace(monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "7")
    monkeypatch.delenv("MKL_NUM_THREADS", raising=False)
    with workers(1) as pool:
        assert [pool.submit(os.getenv, name).result() for name in THREADS] == ["1", "1", "1"]
    assert os.environ["OMP_NUM_THREADS"] == "7"
    assert "MKL_NUM_THREADS" not in os.environ


def test_n_cpu__is_what_this_process_may_use():
    assert 1 <= n_cpu() <= os.cpu_count()


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ((0, None), r"^--workers 0: expected at least 1$"),
        ((2, "tcp://127.0.0.1:1"), r"^--workers and --scheduler: expected one of them$, got both"),
        ((None, "tcp://127.0.0.1:1"), r"^--scheduler tcp://127.0.0.1:1: no Dask scheduler answers"),
        ((None, "nowhere"), r"^--scheduler nowhere: .* expected tcp://HOST:PORT"),
        ((None, "http://127.0.0.1:1"), r"not tcp://HOST:PORT"),
        ((None, "tcp://:8786"), r"not tcp://HOST:PORT"),
        ((None, "tcp://127.0.0.1:99999999"), r"no Dask scheduler answers"),
    ],
)
def test_executor_for__refuses_what_it_cannot_give(given, expected):
    with pytest.raises(InputError, match=expected), executor_for(*given):
        pass


def test_executor_for__says_what_to_install(monkeypatch):
    real = builtins.__import__

    def without_dask(name, *rest, **known):
        if name.partition(".")[0] == "distributed":
            raise ModuleNotFoundError(name)
        return real(name, *rest, **known)

    monkeypatch.delitem(sys.modules, "distributed", raising=False)
    monkeypatch.setattr(builtins, "__import__", without_dask)
    expected = r"distributed is not installed; run pip install 'ridgebayes\[dask\]'"
    with pytest.raises(InputError, match=expected), executor_for(None, "tcp://127.0.0.1:1"):
        pass
