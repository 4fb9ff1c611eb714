"""What a long command says: plain lines off a terminal, a bar on one, times either way."""

import io
from types import SimpleNamespace

import pytest

from ridgebayes.runtime.progress import VERBOSITY, Progress, tell_count


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture
def clock(monkeypatch):
    """Wall and CPU clocks that a test moves by hand."""
    now = SimpleNamespace(wall=100.0, cpu=10.0)
    fake = SimpleNamespace(
        perf_counter=lambda: now.wall, process_time=lambda: now.cpu, thread_time=lambda: now.cpu
    )
    monkeypatch.setattr("ridgebayes.runtime.progress.time", fake)
    return now


def test_stages__each_has_its_own_wall_and_cpu_time(clock):
    with Progress(2, io.StringIO()) as progress:
        with progress.stage("calibrate"):
            clock.wall += 2.5
            clock.cpu += 1.25
        clock.wall += 7.0  # between stages: nobody's
        with progress.stage("evidence"):
            clock.wall += 0.5
            clock.cpu += 4.0
    # Algebra: the clocks' steps are exact in binary.
    assert progress.stages == [
        {"name": "calibrate", "wall_s": 2.5, "cpu_s": 1.25},
        {"name": "evidence", "wall_s": 0.5, "cpu_s": 4.0},
    ]


def test_plain__one_line_a_stage_and_nothing_else(clock):
    out = io.StringIO()
    with Progress(2, out) as progress:
        for name in ("calibrate", "evidence"):
            with progress.stage(name):
                progress.detail("100 steps")
                clock.wall += 2.0
        with progress.stage("walk") as add_cpu:
            add_cpu(3.0)
    told = "calibrate: 2.00 s\nevidence: 2.00 s\nwalk: 0.00 s (and 3.00 s of CPU on workers)\n"
    assert out.getvalue() == told


@pytest.mark.parametrize(
    ("level", "told"),
    [
        (-1, ""),
        (0, "folds: 3 of 9, about 1 min left\nfolds: 31.00 s\n"),
        (1, "folds: 1 of 9, about 20 s left\nfolds: 3 of 9, about 1 min left\nfolds: 31.00 s\n"),
    ],
)
def test_counts__are_told_as_much_as_asked_for(clock, level, told):
    out, token = io.StringIO(), VERBOSITY.set(level)
    with Progress(1, out) as progress, progress.stage("folds"):
        for n_done, seconds in ((1, 2.5), (2, 0.5), (3, 27.0)):
            clock.wall += seconds
            tell_count(n_done, 9)
        clock.wall += 1.0
    VERBOSITY.reset(token)
    tell_count(1, 2)  # nobody's
    assert out.getvalue() == told


def test_stage__that_raises_is_timed_and_its_error_goes_on(clock):
    progress = Progress(1, io.StringIO())

    def fail():
        with progress, progress.stage("evidence"):
            clock.wall += 3.0
            raise RuntimeError("half-way")

    with pytest.raises(RuntimeError, match="half-way"):
        fail()
    assert progress.stages == [{"name": "evidence", "wall_s": 3.0, "cpu_s": 0.0}]


def test_terminal__a_bar_instead_of_lines(clock, monkeypatch):
    monkeypatch.setenv("TERM", "xterm")
    out = Terminal()
    with Progress(2, out) as progress:
        with progress.stage("calibrate hybrid"):
            progress.detail("434 steps")
        assert progress._bar.tasks[0].description == "434 steps"
        assert progress._bar.tasks[0].completed == 1
        with progress.stage("evidence hybrid"):
            assert progress._bar.tasks[0].description == "evidence hybrid"
            clock.wall += 8.0
            progress.count(2, 3)
            told = "evidence hybrid: 2 of 3, about 4.0 s left"
            assert progress._bar.tasks[0].description == told
            assert progress._bar.tasks[0].completed == pytest.approx(1 + 2 / 3)  # algebra
        assert progress._bar.finished
    assert [stage["name"] for stage in progress.stages] == ["calibrate hybrid", "evidence hybrid"]
    assert "calibrate hybrid: " not in out.getvalue()
    assert "evidence hybrid" in out.getvalue()
