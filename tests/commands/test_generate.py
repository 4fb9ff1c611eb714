"""Sweeps that are shared out, killed and resumed give the bytes of an undisturbed one."""

import re
import shutil
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import pytest

import ridgebayes as rb
from ridgebayes.commands.generate import journal_of, sweep_job
from ridgebayes.runtime.journal import Journal
from ridgebayes.runtime.pool import workers
from ridgebayes.scene.scene import Texture
from ridgebayes.simulate import generation

N = 12
SCENE = rb.Scene(
    textures=(
        *(Texture(a_over_R=0.012 + 0.002 * i, b_over_R=0.03 - 0.001 * i) for i in range(N - 2)),
        Texture(a_over_R=0.03, b_over_R=0.01, corner_radius_over_R=2e-3, max_p_over_E=2e-3),
        Texture(a_over_R=0.03, b_over_R=0.02, offset=0.25, role="held-out", max_p_over_E=4e-3),
    ),
    p_over_E=0.006,
)


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """The bytes of the table that one process writes in one go."""
    out = tmp_path_factory.mktemp("undisturbed") / "t.csv"
    rb.generate(SCENE, rel_tol=1e-6).write(out)
    return out.read_bytes()


@dataclass
class Counted:
    """Counts textures that this process computes."""

    n: int = 0


@pytest.fixture
def counted(monkeypatch):
    count, solved = Counted(), generation._solved

    def counting(task, **known):
        count.n += 1
        return solved(task, **known)

    monkeypatch.setattr(generation, "_solved", counting)
    return count


def sweep(out, **options):
    return sweep_job(out, SCENE, **({"rel_tol": 1e-6} | options))


def cut_off(out, monkeypatch, after, **options):
    """Run a sweep that ends by force after so many textures."""
    keep, kept = Journal.keep, []

    def keeping(journal, given, found):
        if len(kept) == after:
            raise KeyboardInterrupt
        kept.append(given)
        keep(journal, given, found)

    with monkeypatch.context() as patch:
        patch.setattr(Journal, "keep", keeping)
        with pytest.raises(KeyboardInterrupt):
            sweep(out, **options)
    assert not out.exists()
    assert len(entries(out)) == after


def entries(out):
    return {path: path.stat().st_mtime_ns for path in journal_of(out).folder.glob("*.json")}


# --- shared out -----------------------------------------------------------------------------------


def test_sweep__refusals_are_those_of_one_process(tmp_path):
    small = rb.Scene.of([(0.012, 0.01), (0.012, 0.09), (0.032, 0.03)], p_over_E=5e-4)
    with pytest.raises(rb.InputError) as alone:
        rb.generate(small)
    with pytest.raises(rb.InputError) as shared:
        sweep_job(tmp_path / "t.csv", small, workers=2)
    assert str(shared.value) == str(alone.value)
    assert list(tmp_path.iterdir()) == []


def test_sweep__workers_of_another_version_are_refused(monkeypatch):
    task = generation._tasks(SCENE, "auto", 1e-6, (24, 10))[0]
    monkeypatch.setattr(generation, "__version__", "0.0.9")
    with pytest.raises(
        rb.InputError, match=r"a worker has ridgebayes 0\.0\.9, this process \d.*same"
    ):
        generation._solved(task)


def test_generate__fields_come_from_one_process_alone(tmp_path):
    with (
        workers(2) as pool,
        pytest.raises(rb.InputError, match="pressed: cannot be combined with executor"),
    ):
        rb.generate(SCENE, pressed=print, executor=pool)
    with pytest.raises(rb.InputError, match="combined with executor or journal"):
        rb.generate(SCENE, pressed=print, journal=Journal(tmp_path / "j"))


# --- killed and resumed ---------------------------------------------------------------------------

# Every texture takes so long that the sweep can be caught at work, in workers as well.
SLOW = """
import time
from ridgebayes.commands import cli
from ridgebayes.contact import halfplane
solve = halfplane.transition_loads
def transition_loads(a, b, *rest, **known):
    time.sleep(0.05)
    return solve(a, b, *rest, **known)
halfplane.transition_loads = transition_loads
if __name__ == "__main__":
    cli.main()
"""


def killed(folder, *more):
    """Start a sweep, and kill it when three textures are done."""
    (folder / "slow.py").write_text(SLOW)
    SCENE.to_toml(folder / "scene.toml")
    words = ["generate", "scene.toml", "--tol", "1e-6", "-o", "t.csv", *more]
    with subprocess.Popen(
        [sys.executable, "slow.py", *words], cwd=folder, stderr=subprocess.PIPE
    ) as process:
        end = time.monotonic() + 60
        while len(entries(folder / "t.csv")) < 3:
            assert process.poll() is None
            assert time.monotonic() < end
            time.sleep(0.01)
        process.kill()
        process.stderr.read()  # to its end: the workers hold it open until they are gone


@pytest.mark.parametrize("more", [(), ("--workers", "2")], ids=["alone", "workers"])
def test_sweep__killed_goes_on_with_the_same_bytes_and_repeats_nothing(
    tmp_path, monkeypatch, undisturbed, counted, more
):
    killed(tmp_path, *more)
    out = tmp_path / "t.csv"
    before = entries(out)
    assert 3 <= len(before) < N
    monkeypatch.chdir(tmp_path)
    with monkeypatch.context() as patch:  # to see what was there
        patch.setattr(Journal, "remove", lambda journal: None)
        sweep(out, resume=True)
    after = entries(out)
    assert before.items() <= after.items()  # not written again
    assert len(after) == N
    assert counted.n == N - len(before)
    assert out.read_bytes() == undisturbed


def test_sweep__what_an_earlier_one_left_needs_a_word(tmp_path, monkeypatch, undisturbed, counted):
    out = tmp_path / "t.csv"
    cut_off(out, monkeypatch, 4)
    before = entries(out)
    with pytest.raises(rb.InputError, match=r"\.t\.csv\.journal: .*use --resume to .*, or --force"):
        sweep(out)
    assert entries(out) == before
    counted.n = 0
    sweep(out, force=True)
    assert counted.n == N
    assert out.read_bytes() == undisturbed
    assert {path.name for path in tmp_path.iterdir()} == {"t.csv"}


@pytest.mark.parametrize(
    "changed",
    [{"rel_tol": 1e-5}, {"scene": SCENE.model_copy(update={"nu": 0.4})}],
    ids=["tolerance", "nu"],
)
def test_sweep__takes_nothing_from_another_question(
    tmp_path, monkeypatch, counted, changed, capsys
):
    out, fresh = tmp_path / "t.csv", tmp_path / "fresh.csv"
    cut_off(out, monkeypatch, 4)
    counted.n = 0
    options = {"rel_tol": 1e-6, "scene": SCENE} | changed
    sweep_job(out, resume=True, **options)
    assert counted.n == N
    assert f"0 of {N} textures taken from the journal" in capsys.readouterr().err
    sweep_job(fresh, **options)
    assert out.read_bytes() == fresh.read_bytes()


def test_sweep__a_damaged_texture_is_computed_again_and_counted(
    tmp_path, monkeypatch, undisturbed, counted, capsys
):
    out = tmp_path / "t.csv"
    cut_off(out, monkeypatch, 6)
    first, second, *_ = sorted(entries(out))
    first.write_text("")
    text = second.read_text()
    Q = re.search(r'"Q": \[4, (\d+)', text)
    second.write_text(text.replace(Q.group(), Q.group() + "1"))
    counted.n = 0
    sweep(out, resume=True)
    assert counted.n == N - 4
    assert "2 damaged textures, computed again" in capsys.readouterr().err
    assert out.read_bytes() == undisturbed


def test_sweep__bad_input_leaves_nothing_unless_it_was_to_go_on(tmp_path, monkeypatch):
    out = tmp_path / "t.csv"
    bad = SCENE.model_copy(update={"p_over_E": 5e-4})
    with pytest.raises(rb.InputError, match="no transition under"):
        sweep_job(out, bad, rel_tol=1e-6)
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(rb.InputError, match="no transition under"):
        sweep_job(out, bad, rel_tol=1e-6, resume=True)
    assert len(entries(out)) > 0
    shutil.rmtree(journal_of(out).folder)
    cut_off(out, monkeypatch, 2)
    with pytest.raises(rb.InputError, match="no Dask scheduler answers"):
        sweep(out, scheduler="tcp://127.0.0.1:1", force=True)
    assert len(entries(out)) == 2  # dropped only when something takes its place


# --- as commands ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("generate", "-o", "t.csv", "--workers", "0"), "--workers"),
        (("generate", "-o", "t.csv", "--scheduler", "tcp://127.0.0.1:1"), "no Dask scheduler"),
        (
            ("generate", "-o", "t.csv", "--fields", "f", "--workers", "2"),
            "--fields: cannot be combined with --work",
        ),
        (("generate", "-o", "t.csv", "--fields", "f", "--resume"), "cannot be combined"),
        (("coverage", "--scheduler", "tcp://127.0.0.1:1"), "no Dask scheduler answers"),
        (("run", "--scheduler", "tcp://127.0.0.1:1"), "no Dask scheduler answers"),
    ],
)
def test_commands__refuse_workers_that_cannot_be_and_write_nothing(command, words, expected):
    said = command(*words)
    assert said.code == 2
    assert expected in said.err
    assert "Traceback" not in said.err
    assert list(Path().iterdir()) == []
