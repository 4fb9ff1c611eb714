"""Mutation testing: change the code in one place and see whether a test notices.

    python -m studies.mutation.run [MODULE ...] [--workers N] [--again]

Which modules, tests and changes is in `modules.toml`; what came out goes to
`docs/mutation/mutants.csv`, and what is there of a module as it stands is not tried again. No file
of the code is changed: a mutant is loaded in its place. Each runs in a process of its own, forked
from one that has imported all but this package, with the quickest tests first and an end at the
first failure.
"""

import argparse
import contextlib
import importlib
import importlib.abc
import importlib.util
import json
import os
import random
import resource
import signal
import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import hypothesis
import pytest

from studies.mutation.mutants import Mutant, mutants_of
from studies.mutation.results import (
    CONFIGURATION,
    ROOT,
    Result,
    path_of,
    read,
    state_of,
    totals,
    write,
    write_totals,
)

MEMORY = 6 * 2**30  # bytes that a mutant may take


class Replaced(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Loads one module from another source."""

    def __init__(self, module: str, path: Path, source: str) -> None:
        self._module, self._path, self._source = module, path, source

    def find_spec(self, name, path=None, target=None):
        if name != self._module:
            return None
        return importlib.util.spec_from_file_location(name, self._path, loader=self)

    def exec_module(self, module) -> None:
        exec(compile(self._source, str(self._path), "exec"), module.__dict__)


class Watch:
    """A plugin of pytest: quickest tests first, no search for a smaller example."""

    def __init__(self, known: dict[str, float]) -> None:
        self._known, self.failed = known, ""
        self.seconds: dict[str, float] = {}

    def pytest_configure(self) -> None:
        phases = [hypothesis.Phase.explicit, hypothesis.Phase.generate]
        steady = hypothesis.settings.get_profile("steady")
        hypothesis.settings.register_profile("unshrunk", steady, phases=phases)
        hypothesis.settings.load_profile("unshrunk")

    def pytest_collection_modifyitems(self, items) -> None:
        items.sort(key=lambda item: self._known.get(item.nodeid, 0.0))

    def pytest_runtest_logreport(self, report) -> None:
        self.seconds[report.nodeid] = self.seconds.get(report.nodeid, 0.0) + report.duration
        if report.failed:
            self.failed = self.failed or report.nodeid


def run_tests(tests: list[str], known: dict[str, float], note: Path) -> int:
    """Run tests in this process, and leave a note of what they said."""
    watch = Watch(known)
    options = ["-q", "-x", "--tb=no", "-p", "no:cacheprovider", "-o", "addopts="]
    # What plugins bring is imported already.
    options += ["--import-mode=importlib", "-W", "ignore::pytest.PytestAssertRewriteWarning"]
    options += [f"--deselect={test}" for test in CONFIGURATION["left_out"]]
    code = pytest.main([*options, *tests], plugins=[watch])
    own = ("ridgebayes", "tests", "test_", "conftest", "__")
    imported = [name for name in sys.modules if not name.startswith(own)]
    note.write_text(json.dumps([watch.seconds, watch.failed, imported]), encoding="utf-8")
    return int(code)


def begin(
    tests: list[str], known: dict[str, float], note: Path, limit: int, replaced: Replaced | None
) -> int:
    """Fork a process that runs the tests within `limit` CPU seconds, and return its number."""
    process = os.fork()
    if process:
        return process
    code = 3
    try:
        resource.setrlimit(resource.RLIMIT_CPU, (limit, limit + 5))
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        signal.alarm(10 * limit)  # of waiting for nothing
        silence = os.open(os.devnull, os.O_WRONLY)
        os.dup2(silence, 1)
        os.dup2(silence, 2)
        if replaced is not None:
            sys.meta_path.insert(0, replaced)
        code = run_tests(tests, known, note)
    finally:
        os._exit(code)


def outcome_of(status: int) -> str:
    """Say what the end of a process means."""
    if os.WIFSIGNALED(status):
        return "timed out"
    return "survived" if os.WEXITSTATUS(status) == 0 else "killed"


def warm(tests: list[str], folder: Path) -> dict[str, float] | None:
    """Run the tests on the code as it is, and import what they needed of other packages.

    Returns
    -------
    dict of str to float or None
        Seconds of each test; None if one fails, so that no mutant can be told from the code.
    """
    note = folder / "plain"
    process = begin(tests, {}, note, 600, None)
    if outcome_of(os.waitpid(process, 0)[1]) != "survived":
        return None
    seconds, _, imported = json.loads(note.read_text(encoding="utf-8"))
    for name in imported:
        with contextlib.suppress(Exception):
            importlib.import_module(name)
    return seconds


def mutate(module: str, chosen: list[Mutant], workers: int, tell: Callable[[Result], None]) -> None:
    """Try mutants of a module and tell of each as it ends."""
    original, state = path_of(module).read_text("utf-8"), state_of(module)
    tests = CONFIGURATION["modules"][module]
    waiting, running = list(chosen), {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        known = warm(tests, folder)
        if known is None:
            print(f"{' '.join(tests)}: fails on the code as it is", flush=True)
            return
        limit = 20 + 4 * round(sum(known.values()))
        while waiting or running:
            while waiting and len(running) < workers:
                mutant = waiting.pop(0)
                source, note = mutant.source(original), folder / str(len(waiting))
                if mutant.is_none(original, source):
                    continue
                name = module if module.startswith("tests.") else f"ridgebayes.{module}"
                replaced = Replaced(name, path_of(module), source)
                process = begin(tests, known, note, limit, replaced)
                running[process] = mutant, note, mutant.change(original, source)
            process, status, used = os.wait3(0)
            mutant, note, change = running.pop(process)
            by = json.loads(note.read_text("utf-8"))[1].split("::")[-1] if note.exists() else ""
            place = mutant.line, mutant.column, mutant.operator, mutant.occurrence
            seconds = round(used.ru_utime + used.ru_stime, 2)
            tell(Result(module, state, *place, change, outcome_of(status), by, seconds))


def chosen_of(module: str, before: list[Result], again: bool) -> list[Mutant]:
    """Return the mutants to try: those of the sample that were not, or that survived last time."""
    mutants = mutants_of(path_of(module), CONFIGURATION["operators"])
    write_totals(totals() | {module: len(mutants)})
    random.Random(module).shuffle(mutants)  # a larger sample holds the smaller one
    mutants = mutants[: CONFIGURATION["sample"].get(module, CONFIGURATION["most"])]
    outcomes = {result.mutant: result.outcome for result in before}
    wanted = {"survived"} if again else {None}
    return [m for m in mutants if outcomes.get((module, m.operator, m.occurrence)) in wanted]


def main() -> None:
    """Try the mutants of some modules and keep what became of them."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("modules", nargs="*", help="such as forms.closed; all if none is given")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--again", action="store_true", help="those that survived last time")
    options = parser.parse_args()
    sys.path.insert(0, str(ROOT / "src"))
    os.chdir(ROOT)
    for module in options.modules or CONFIGURATION["modules"]:
        state = state_of(module)
        kept = {r.mutant: r for r in read() if r.module != module or r.source == state}
        counts: Counter[str] = Counter()

        def keep(result: Result, kept: dict = kept, counts: Counter = counts) -> None:
            kept[result.mutant] = result
            counts[result.outcome] += 1
            write(list(kept.values()))

        chosen = chosen_of(module, list(kept.values()), options.again)
        if chosen:
            mutate(module, chosen, options.workers, keep)
        print(f"{module}: {len(chosen)} mutants tried now, {dict(counts)}", flush=True)


if __name__ == "__main__":
    main()
