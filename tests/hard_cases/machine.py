"""Programs that the edge cases start, stop and limit.

A process imports the package once and forks a child for each program, so that a case costs what it
computes and not the imports: `python -m tests.hard_cases.machine` is that process.
"""

import atexit
import functools
import hashlib
import io
import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

import numpy as np
import xarray as xr

from ridgebayes.commands import cli

ROOT = Path(__file__).parents[2]
_MOST_S = 120.0  # after which something hangs that should not
# What two runs do not share: seconds, and the report's section on them.
TIMES = ("costs.csv",)


@dataclass(frozen=True)
class Ended:
    """How a program ended, and what it said; a negative code is the signal that killed it."""

    code: int
    out: str
    err: str

    @property
    def last(self) -> str:
        """Last line on standard error."""
        return self.err.rstrip("\n").rpartition("\n")[2]

    def refused(self, code: int, *words: str) -> str:
        """Return the one message with which a command ended; it must contain all words."""
        assert self.code == code, (self.code, self.out, self.err)
        assert self.quiet, self.err
        assert self.last.startswith("ridgebayes: "), self.err
        missing = [word for word in words if word not in self.last]
        assert not missing, f"{missing} not in: {self.last}"
        return self.last.removeprefix("ridgebayes: ")

    @property
    def quiet(self) -> bool:
        """Whether it said nothing of Python's own."""
        return "Traceback" not in self.err and "Exception ignored" not in self.err


class Program:
    """A program under way in a session of its own, so that Ctrl-C reaches all its processes."""

    def __init__(self, pid: int, folder: Path, number: int) -> None:
        self.pid, self._folder, self._number = pid, folder, number

    @property
    def err(self) -> str:
        """Standard error so far."""
        return (self._folder / f".err{self._number}").read_text(encoding="utf-8")

    def until(self, reached: Callable[[], bool]) -> "Program":
        """Wait for something; AssertionError if the program ends before."""
        end = time.monotonic() + _MOST_S
        while not reached():
            assert Path(f"/proc/{self.pid}").exists(), self.err
            assert time.monotonic() < end, self.err
            time.sleep(0.005)
        return self

    def send(self, number: int) -> "Program":
        """Send a signal to all its processes."""
        os.killpg(self.pid, number)
        return self

    def end(self) -> Ended:
        """Wait for its end."""
        code = _machine().ask({"wait": self.pid})
        out, err = (self._folder / f".{name}{self._number}" for name in ("out", "err"))
        ended = Ended(code, out.read_text(encoding="utf-8"), self.err)
        out.unlink()
        err.unlink()
        return ended

    def left(self) -> list[str]:
        """Return the processes of its session that are still there some seconds after its end."""
        end = time.monotonic() + 10.0
        while (found := _session(self.pid)) and time.monotonic() < end:
            time.sleep(0.05)
        return found


def started(folder: Path, *words: object, before: str = "", stdout: str | None = None) -> Program:
    """Start a command in a folder.

    Parameters
    ----------
    folder : Path
        Working folder.
    *words : object
        Of the command; none if `before` does it all.
    before : str
        Python that runs in the program first, such as a fault to come.
    stdout : str, optional
        ``closed``: a pipe that nobody reads; or a file to write to.
    """
    number = next(_numbers)
    asked = {
        "folder": str(folder),
        "words": [str(word) for word in words],
        "before": before,
        "out": stdout,
        "number": number,
    }
    return Program(_machine().ask(asked), folder, number)


def ran(folder: Path, *words: object, before: str = "", stdout: str | None = None) -> Ended:
    """Run a command in a folder to its end; see `started`."""
    return started(folder, *words, before=before, stdout=stdout).end()


def contents(folder: Path, without: tuple[str, ...] = ()) -> dict[str, str]:
    """Return the digest of each file below a folder by its name."""
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name not in without
    }


def run_contents(folder: Path) -> dict[str, str]:
    """Return the same of a run folder, without what is told of times and memory."""
    found = contents(folder, TIMES)
    for path in folder.rglob("run.json"):
        about = json.loads(path.read_text(encoding="utf-8"))
        about.pop("peak_memory_bytes")
        names = [stage.pop("name") for stage in about["stages"]]
        about["stages"] = names
        text = json.dumps(about)
        found[path.relative_to(folder).as_posix()] = hashlib.sha256(text.encode()).hexdigest()
    for path in folder.rglob("report.*"):
        text = without_costs(path)
        found[path.relative_to(folder).as_posix()] = hashlib.sha256(text.encode()).hexdigest()
    return found


def without_costs(report: Path) -> str:
    """Return a report's text without the part on what accuracy costs, if it has one."""
    costs = r"(?s)<details><summary>Accuracy and run time</summary>.*?</details>"
    return re.sub(costs, "", report.read_text(encoding="utf-8"))


@contextmanager
def small_disk(folder: Path, size: int) -> Iterator[bool]:
    """Make a folder a disk of so many bytes; gives False where this process may not."""
    mount = ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(folder)]
    try:
        done = subprocess.run(mount, capture_output=True, check=False).returncode == 0
    except OSError:
        done = False
    try:
        yield done
    finally:
        if done:
            subprocess.run(["umount", "-l", str(folder)], check=True)


@contextmanager
def read_only(folder: Path) -> Iterator[str]:
    """Let nothing be written to a folder; gives what a program has to do to itself for that."""
    if os.geteuid() == 0:  # root is kept from nothing by permissions
        yield REFUSING.format(folder=str(folder))
        return
    folder.chmod(0o555)
    try:
        yield ""
    finally:
        folder.chmod(0o755)


REFUSING = """
import errno
_folder = {folder!r}
def _refusing(call):
    def refusing(path, *rest, **known):
        at = os.path.abspath(os.fspath(path)) if not isinstance(path, int) else ""
        writes = call is not os.open or (rest and rest[0] & (os.O_WRONLY | os.O_RDWR | os.O_CREAT))
        if writes and at.startswith(_folder):
            raise OSError(errno.EROFS, os.strerror(errno.EROFS), str(path))
        return call(path, *rest, **known)
    return refusing
os.open, os.mkdir = _refusing(os.open), _refusing(os.mkdir)
_access = os.access
os.access = lambda path, mode, **known: mode != os.W_OK and _access(path, mode, **known)
"""


class _Machine:
    """The process that forks the programs."""

    def __init__(self) -> None:
        threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
        path = os.pathsep.join([str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])])
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.hard_cases.machine"],
            cwd=ROOT,
            env={**os.environ, **threads, "PYTHONPATH": path, "COLUMNS": "200"},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        atexit.register(self._stop)

    def ask(self, request: dict[str, object]) -> int:
        self._process.stdin.write(json.dumps(request) + "\n")
        self._process.stdin.flush()
        return int(self._process.stdout.readline())

    def _stop(self) -> None:
        self._process.stdin.close()
        self._process.wait(10)
        self._process.stdout.close()


_machine = functools.cache(_Machine)
_numbers = iter(range(10**9))


def _session(leader: int) -> list[str]:
    """Return the commands of the processes of a session that are alive."""
    found = []
    for path in Path("/proc").glob("[0-9]*"):
        with suppress(OSError, ValueError):
            state, _, _, session = (path / "stat").read_text().rpartition(")")[2].split()[:4]
            if int(session) == leader and state != "Z":
                found.append((path / "cmdline").read_text().replace("\0", " "))
    return found


def _main() -> None:
    """Import what commands do; fork a child for each request, say its number, and how it ended."""
    for module, _ in cli._COMMANDS.values():
        import_module(f"ridgebayes.commands.{module}")
    for module in (*cli._RUN_MODULES, "emcee"):
        import_module(module)
    # What xarray imports when it writes for the first time.
    xr.Dataset({"x": ("n", np.zeros(1))}).to_netcdf(io.BytesIO(), engine="h5netcdf")
    for line in sys.stdin:
        request = json.loads(line)
        if "wait" in request:
            print(os.waitstatus_to_exitcode(os.waitpid(request["wait"], 0)[1]), flush=True)
        elif pid := os.fork():
            print(pid, flush=True)
        else:
            _child(request)


def _child(request: dict[str, object]) -> None:
    os.setsid()
    os.chdir(request["folder"])
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    flags = os.O_WRONLY | os.O_CREAT | os.O_TRUNC
    number = request["number"]
    out = os.open(f".out{number}", flags, 0o644)
    if request["out"] == "closed":
        reader, out = os.pipe()
        os.close(reader)
    elif request["out"] is not None:
        out = os.open(request["out"], os.O_WRONLY)
    os.dup2(out, 1)
    os.dup2(os.open(f".err{number}", flags, 0o644), 2)
    sys.argv = ["ridgebayes", *request["words"]]
    signal.signal(signal.SIGPIPE, signal.SIG_IGN)
    # Code of the cases themselves.
    exec(request["before"], {"__name__": "before", "os": os, "signal": signal})
    if request["words"]:
        cli.main()
    sys.exit()


if __name__ == "__main__":
    _main()
