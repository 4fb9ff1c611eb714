"""Edge cases of system failures: kills, full disks, missing folders; finished work is kept."""

import functools
import json
import shutil
import signal
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd

import ridgebayes as rb
from ridgebayes.inference.checkpoint import Checkpoint
from tests.hard_cases.case import hard_case
from tests.hard_cases.files import sound_run
from tests.hard_cases.machine import (
    contents,
    ran,
    read_only,
    run_contents,
    small_disk,
    started,
)

TEXTURES = ((0.012, 0.03), (0.022, 0.02), (0.032, 0.01))
# Walks as short as they can be: what is tested holds for draws that have not converged as well.
JOB = """
import dataclasses
from pathlib import Path
import ridgebayes as rb
from ridgebayes.commands import cli
from ridgebayes.comparison import compare
from ridgebayes.commands import run as command
from ridgebayes.commands.terminal import Answer
from ridgebayes.evidence import prior_sensitivity
prior_sensitivity.scale_factors = lambda prior: (1.5,)
def job(**options):
    settings = rb.SampleSettings(n_walker=16, n_burn=20, n_tau=120, tau_change=0.1)
    forms = ["modified", "hybrid"]
    what = {"forms": forms, "noise": "iid", "rng": 5, "settings": settings, "command": "compare"}
    command.run("few.csv", "out", **what, **options)
"""
RUN = """
import sys
command.command = lambda asked: job({options}) or Answer()
sys.argv = ["ridgebayes", "run", "--table", "few.csv", "--workers", "1", "-o", "out"]
cli.main()
"""


@functools.cache
def few_rows() -> str:
    """A contact table of three textures as CSV."""
    frame = rb.paper_sweep().frame
    pairs = zip(frame["a_over_R"], frame["b_over_R"], strict=True)
    chosen = rb.ContactTable.from_frame(frame[[pair in TEXTURES for pair in pairs]])
    with tempfile.TemporaryDirectory() as folder:
        chosen.write(Path(folder, "few.csv"))
        return Path(folder, "few.csv").read_text(encoding="utf-8")


def place(folder: Path, name: str = "") -> Path:
    """Return a working folder that holds the table."""
    here = folder / name
    here.mkdir(exist_ok=True)
    (here / "few.csv").write_text(few_rows(), encoding="utf-8")
    return here


def compared(folder: Path, *, before: str = "", options: str = "") -> object:
    return ran(folder, before=JOB + before + RUN.format(options=options))


@functools.cache
def undisturbed() -> dict[str, str]:
    """What the files of a comparison are that nothing befell."""
    with tempfile.TemporaryDirectory() as scratch:
        here = place(Path(scratch))
        assert compared(here).code == 0
        return run_contents(here / "out")


def put(files: dict[str, bytes], folder: Path) -> Path:
    """Write the files of a run."""
    folder.mkdir()
    for name, content in files.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_bytes(content)
    return folder


# --- killed ---------------------------------------------------------------------------------------

KILL = "os.kill(os.getpid(), signal.SIGKILL)"
KILLS = {
    "after the first chain's second check": f"""
from ridgebayes.inference.checkpoint import Checkpoint
save, saved = Checkpoint.save, []
def saving(self, walk):
    save(self, walk)
    saved.append(1)
    len(saved) == 2 and {KILL}
Checkpoint.save = saving
""",
    "half-way through writing a chain": f"""
write, wrote = Path.write_bytes, []
def writing(path, content):
    wrote.append(1)
    if "chains-modified" in path.name and len(wrote) == 3:
        with path.open("wb") as file:
            file.write(bytes(content)[: len(content) // 2])
            file.flush()
        {KILL}
    return write(path, content)
Path.write_bytes = writing
""",
    "with the old run set aside and the new one not yet named": f"""
rename = Path.rename
def renaming(path, target):
    found = rename(path, target)
    path.name == "out" and {KILL}
    return found
Path.rename = renaming
""",
}


@hard_case(
    "A comparison killed while it writes a chain, and while it replaces an old run, then resumed",
    why="The sampler may continue with another state of its random stream, a chain file may be "
    "half written, or an old run may already be moved away when the kill comes. Then the result "
    "would differ, or be lost.",
    expected="Killed by signal 9 each time. After --resume every file has the bytes of an "
    "undisturbed run (exact, apart from times), and no other file is left.",
    long=True,
)
def killed_at_stages(folder):
    return resumed(folder, [stage for stage in KILLS if "half-way" in stage or "old run" in stage])


def resumed(folder: Path, stages: list[str]) -> str:
    """Kill comparisons, each at its stage, and resume them."""
    expected = undisturbed()
    for number, stage in enumerate(stages):
        before = KILLS[stage]
        here = place(folder, str(number))
        force = "old run" in stage
        if force:
            (here / "out").mkdir()
            (here / "out" / "run.json").write_text("{}", encoding="utf-8")
        done = compared(here, before=before, options="force=True" if force else "")
        assert done.code == -signal.SIGKILL, (stage, done)
        assert force or not (here / "out").exists()
        done = compared(here, options="resume=True")
        assert done.code == 0, (stage, done.err)
        assert run_contents(here / "out") == expected, stage
        assert {path.name for path in here.iterdir()} == {"few.csv", "out"}, stage
    return f"{len(stages)} kills: {len(expected)} files have the same bytes after each"


SLOW = """
import time
from ridgebayes.contact import halfplane
solve = halfplane.transition_loads
def transition_loads(a, b, *rest, **known):
    time.sleep(0.05)
    return solve(a, b, *rest, **known)
halfplane.transition_loads = transition_loads
"""
SWEEP = [f"--texture={0.012 + 0.002 * i:g},{0.03 - 0.001 * i:g}" for i in range(10)]
SWEEP = ["generate", *SWEEP, "--p-max", "0.006", "--tol", "1e-6", "-o", "t.csv"]


@functools.cache
def sweep_undisturbed() -> bytes:
    with tempfile.TemporaryDirectory() as scratch:
        assert ran(Path(scratch), *SWEEP).code == 0
        return Path(scratch, "t.csv").read_bytes()


def textures_done(folder: Path) -> int:
    return len(list((folder / ".t.csv.journal").glob("*.json")))


@hard_case(
    "A sweep stopped by Ctrl-C, SIGTERM and SIGKILL in turn, then resumed",
    why="Each way of stopping skips other clean-up, and only Ctrl-C allows a message. A lock file "
    "or a half-written journal entry must not block the next start.",
    expected="Exit 130 with one line, then -15, then -9. The table appears only at the end, with "
    "the bytes of an undisturbed sweep (exact), and no other file beside it.",
    long=True,
)
def stopped_sweep(folder):
    expected, counts = sweep_undisturbed(), []
    for number, code in [(signal.SIGINT, 130), (signal.SIGTERM, -15), (signal.SIGKILL, -9)]:
        more = ["--resume"] if counts else []
        wanted = textures_done(folder) + 2
        program = started(folder, *SWEEP, *more, before=SLOW)
        program.until(lambda wanted=wanted: textures_done(folder) >= wanted)
        ended = program.send(number).end()
        assert ended.code == code, ended
        assert program.left() == []
        if code == 130:
            ended.refused(130, "interrupted", "--resume")
            assert "textures are in .t.csv.journal: continue with --resume" in ended.err
        assert not (folder / "t.csv").exists()
        counts.append(textures_done(folder))
    assert counts == sorted(set(counts))
    ended = ran(folder, *SWEEP, "--resume")
    assert ended.code == 0
    assert f"{counts[-1]} of 10 textures taken from the journal" in ended.err
    assert contents(folder) == {"t.csv": contents(folder)["t.csv"]}
    assert (folder / "t.csv").read_bytes() == expected
    return "exit codes 130, -15, -9; then the same bytes"


@hard_case(
    "Ctrl-C while workers compute evidences, and during MCMC",
    why="The signal reaches every process of the terminal. Workers could print their own "
    "tracebacks or outlive the command.",
    expected="Exit 130, one line that names --resume, no traceback, no process left, no final "
    "folder. The resumed chain has the bytes of an undisturbed one (exact).",
    long=True,
)
def interrupted(folder):
    here = place(folder, "weighing")
    words = ("run", "--table", "few.csv", "--forms", "modified", "--workers", "2", "-o", "out")
    begun = (
        "from ridgebayes.evidence import pairs\nfrom ridgebayes.commands import run\n"
        "from pathlib import Path\n"
        + (
            "look = pairs.map_ordered\n"
            "def looking(*given, **known):\n"
            "    for found in look(*given, **known):\n"
            "        Path('begun').touch()\n"
            "        yield found\n"
            "pairs.map_ordered = looking\n"
        )
    )
    program = started(here, *words, before=begun).until((here / "begun").exists)
    program.send(signal.SIGINT).end().refused(130, "interrupted", "--resume")
    assert program.left() == []
    assert not (here / "out").exists()

    here = place(folder, "walking")
    program = started(here, before=JOB + RUN.format(options=""))
    program.until((here / ".out.partial" / "chains-hybrid.npz").exists)
    program.send(signal.SIGINT).end().refused(130, "interrupted", "--resume")
    assert program.left() == []
    assert (here / ".out.partial" / "chains-modified.npz").exists()
    assert compared(here, options="resume=True").code == 0
    assert run_contents(here / "out") == undisturbed()
    return "exit 130 twice, no process left; resumed to the same bytes"


@hard_case(
    "Output to a closed pipe, and to a full device",
    why="`| head -1` closes the pipe. Python notices when it flushes at exit, prints 'Exception "
    "ignored' and ends with code 120.",
    expected="No traceback. A closed pipe is no failure: exit 0, and nothing is said. A full "
    "device is one: exit 1, and the reason. The files that the command writes are complete.",
    long=True,
)
def closed_output(folder):
    here = put(sound_run(), folder / "run")
    bands = ("predict", here, "--texture", "0.02,0.02", "--p-over-E", "0.001:0.01:5")
    for number, where in enumerate(["closed", "/dev/full"]):
        done = ran(folder, *bands, "-o", f"{number}.csv", stdout=where)
        assert done.code == number, done
        assert done.quiet, done.err
        assert done.err == "" or number == 1
        assert len(pd.read_csv(folder / f"{number}.csv")) == 5
    assert done.last == "ridgebayes: output: No space left on device"
    return "exit 0 and 1, bands written twice"


# --- disks and folders ----------------------------------------------------------------------------

# A file that would grow beyond this many bytes is an error of the system, as on a full disk.
LIMIT = """
import resource
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, ({size}, resource.RLIM_INFINITY))
"""


@hard_case(
    "Disk full while chains, posteriors and a sweep's journal are written",
    why="HDF5 ends the process (signal 11) when the disk fills up under an open file. A failed "
    "write that is treated as bad input would also remove what is finished, with exit code 2.",
    expected="Exit 1 and one message with the file, the reason and what was expected. No file "
    "under its final name; finished chains and textures are kept. After resuming with free space: "
    "the bytes of an undisturbed run (exact).",
    long=True,
)
def disk_full(folder):
    seen = []
    for number, size in enumerate([60_000, 400_000]):
        here = folder / str(number)
        here.mkdir()
        with small_disk(here, size) as is_small:
            place(here)
            limit = "" if is_small else LIMIT.format(size=size // 3)
            done = compared(here, before=limit)
            message = done.refused(
                1, str(here), ": cannot be written: ", "; expected a writable folder with room"
            )
            assert not (here / "out").exists()
            left = {path.name for path in here.glob(".out.partial/*")}
            assert not any("partial" in name for name in left), left
            if left:
                assert f"what is finished is kept in {here}/.out.partial" in message, message
            kept = folder / f"with room {number}"
            shutil.copytree(here, kept)
            seen.append(len([name for name in left if name.startswith("chains")]))
        assert compared(kept, options="resume=True").code == 0
        assert run_contents(kept / "out") == undisturbed()
    here = folder / "sweep"
    here.mkdir()
    full = LIMIT.format(size=100_000) + (
        "from ridgebayes.runtime.journal import Journal\n"
        "keep = Journal.keep\n"
        "def keeping(journal, given, found):\n"
        "    if journal.n_kept == 3:\n"
        "        resource.setrlimit(resource.RLIMIT_FSIZE, (600, resource.RLIM_INFINITY))\n"
        "    keep(journal, given, found)\n"
        "Journal.keep = keeping\n"
    )
    done = ran(here, *SWEEP, before=full)
    done.refused(
        1,
        ".t.csv.journal/",
        "cannot be written: File too large",
        "expected a writable folder with room",
    )
    assert "3 of 10 textures are in .t.csv.journal: continue with --resume" in done.err
    assert textures_done(here) == 3
    assert ran(here, *SWEEP, "--resume").code == 0
    assert (here / "t.csv").read_bytes() == sweep_undisturbed()
    assert seen[-1] > 0
    return "exit 1 three times, 3 of 10 textures kept; the same bytes after --resume"


@hard_case(
    "Disk full at the last write of predict, import, export-deck and plan",
    why="A table that is cut off in the middle is a valid CSV file with fewer rows.",
    expected="Exit 1 and one message. The old file is unchanged, and there is no part of a new "
    "one.",
    long=True,
)
def disk_full_at_the_end(folder):
    run = put(sound_run(), folder / "run")
    place(folder)
    scene = folder / "scene.toml"
    rb.Scene.of([(0.2, 0.1)], p_over_E=0.005, nu=0.49).to_toml(scene)
    bands = ("--texture", "0.02,0.02", "--p-over-E", "0.001:0.01:50")
    for words, name in [
        (("predict", run, *bands, "--force", "-o"), "bands.csv"),
        (("import", "few.csv", "--force", "-o"), "table.csv"),
        (("export-deck", scene, "--force", "-o"), "deck.inp"),
        (("plan", scene, "--force", "-o"), "plan.csv"),
    ]:
        (folder / name).write_text("old", encoding="utf-8")
        before = set(folder.iterdir())
        done = ran(folder, *words, name, before=LIMIT.format(size=300))
        done.refused(
            1, f"{name}: cannot be written: File too large; expected a writable folder with room"
        )
        assert (folder / name).read_text(encoding="utf-8") == "old"
        assert set(folder.iterdir()) == before
    return "4 commands: exit 1, the old file stays"


@hard_case(
    "A folder without write permission",
    why="If this is found only when the first file is written, minutes of work are lost.",
    expected="Exit 2 before any work, with one message that names the folder. Nothing is written.",
    long=True,
)
def read_only_folder(folder):
    run = put(sound_run(), folder / "run")
    place(folder)
    closed = folder / "closed"
    closed.mkdir()
    bands = ("--texture", "0.02,0.02", "--p-over-E", "0.001:0.01:5")
    works = "from ridgebayes import request\nfrom ridgebayes.simulate import generation\n" + (
        "def worked(*given, **known):\n    raise SystemExit(99)\n"
        "request.weigh_pairs = generation.generate = worked\n"
    )
    commands = [
        ("run", "--table", "few.csv", "-o", "closed/out"),
        ("fit", "few.csv", "--form", "hybrid", "-o", "closed/out"),
        ("compare", "few.csv", "-o", "closed/out"),
        (*SWEEP[:-1], "closed/t.csv"),
        ("predict", run, *bands, "-o", "closed/bands.csv"),
        ("import", "few.csv", "-o", "closed/t.csv"),
    ]
    with read_only(closed) as own:
        for words in commands:
            done = ran(folder, *words, before=own + works)
            done.refused(2, "closed", "cannot be", "expected ")
        assert list(closed.iterdir()) == []
    return f"{len(commands)} commands: exit 2 before any work"


@hard_case(
    "The folder is removed while a run writes to it",
    why="Clean-up that needs the folder hides the cause behind a second error.",
    expected="Exit 1 and one message that names the missing folder. No file is left behind.",
)
def folder_removed(folder):
    here = place(folder)
    gone = """
import shutil
from ridgebayes.inference.checkpoint import Checkpoint
save = Checkpoint.save
def saving(self, walk):
    shutil.rmtree(self.path.parent)
    save(self, walk)
Checkpoint.save = saving
"""
    done = compared(here, before=gone)
    done.refused(1, f"{here}/out: the working folder {here}/.out.partial was removed")
    assert {path.name for path in here.iterdir()} == {"few.csv"}
    return "exit 1; no folder left"


HELD = """
import time
from {package} import {module}
def held(*given, **known):
    Path("at work").touch()
    time.sleep(100)
{module}.{name} = held
"""


@hard_case(
    "Two runs of one folder at the same time, and two sweeps of one table",
    why="The second would remove the first one's unfinished folder or journal, and both would "
    "write chains or textures to the same place.",
    expected="The second is refused in one line, exit 2, and leaves the first one's files alone. "
    "A lock ends with its process, so after SIGKILL the next one can start at once.",
    long=True,
)
def two_at_once(folder):
    here = place(folder)
    path = "from pathlib import Path\n"
    pairs = [
        (
            "out",
            ("compare", "few.csv", "--forms", "modified", "--noise", "iid", "-o", "out"),
            "ridgebayes.request",
            "weigh_pairs",
        ),
        ("t.csv", tuple(SWEEP), "ridgebayes.simulate.generation", "map_ordered"),
    ]
    for name, words, where, waits in pairs:
        package, _, module = where.rpartition(".")
        first = started(
            here, *words, before=path + HELD.format(package=package, module=module, name=waits)
        )
        first.until((here / "at work").exists)
        before = contents(here)
        for more in ([], ["--force"], ["--resume"] if name == "t.csv" else []):
            done = ran(here, *words, *more)
            done.refused(2, f"{name}: another process is working on it; use another -o")
        assert contents(here).keys() >= before.keys()
        first.send(signal.SIGKILL).end()
        (here / "at work").unlink()
        assert (here / f".{name}.lock").exists()  # the file, which nobody holds any more
        done = ran(here, *words, "--force")
        assert done.code == 0, done.err
        assert not (here / f".{name}.lock").exists()
    assert {path.name for path in here.iterdir()} == {"few.csv", "out", "t.csv"}
    return "refused 6 times; after SIGKILL the next run succeeds"


# --- damaged files --------------------------------------------------------------------------------


@functools.cache
def chain_file() -> bytes:
    """A chain file of a walk under way."""
    with tempfile.TemporaryDirectory() as scratch:
        here = place(Path(scratch))
        assert compared(here, before=KILLS["after the first chain's second check"]).code == -9
        return (here / ".out.partial" / "chains-modified.npz").read_bytes()


@hard_case(
    "A chain file truncated, zeroed, or with one bit flipped",
    why="A flipped bit in a walker or in the state of the random stream gives another chain, "
    "without any sign, unless the file has checksums.",
    expected="Each of 30 truncations and 150 flips is refused in one line, or the chain is the "
    "same to the last bit. A resumed run says to remove the file, exit 2.",
    long=True,
)
def damaged_chain(folder):
    content, rng = chain_file(), np.random.default_rng(3)
    path, told = folder / "chains-modified.npz", set()

    def loaded(damaged: bytes) -> object:
        path.write_bytes(damaged)
        try:
            return Checkpoint(path, {}).load()
        except rb.InputError as refusal:
            told.add(str(refusal))
            return None

    whole = loaded(content)
    sizes = [0, *rng.integers(0, len(content) - 1, 29).tolist()]
    damaged = [content[:size] for size in sizes] + [content[: len(content) // 2] + bytes(1000)]
    for _ in range(150):
        at, bit = int(rng.integers(len(content))), 1 << int(rng.integers(8))
        damaged.append(content[:at] + bytes([content[at] ^ bit]) + content[at + 1 :])
    same = 0
    for one in damaged:
        walk = loaded(one)
        if walk is not None:
            same += 1
            assert all(
                np.array_equal(values, getattr(whole, name), equal_nan=True)
                for name, values in vars(walk).items()
            )
    for message in told:
        assert message.startswith(f"{path}: not a readable chain file (")
        assert message.endswith("; remove it and use --resume to compute it again")
        assert "\n" not in message
    here = place(folder, "resumed")
    (here / ".out.partial").mkdir()
    flipped = bytearray(content)
    flipped[len(content) // 2] ^= 1
    (here / ".out.partial" / "chains-modified.npz").write_bytes(bytes(flipped))
    done = compared(here, options="resume=True")
    done.refused(2, "chains-modified.npz", "Bad CRC-32", "remove")
    (here / ".out.partial" / "chains-modified.npz").unlink()
    assert compared(here, options="resume=True").code == 0
    assert run_contents(here / "out") == undisturbed()
    assert same < 40
    return f"{len(damaged)} damaged files: refused, or the same chain; none gave another chain"


@hard_case(
    "Files of a run folder truncated, emptied or overwritten, then predict",
    why="A run folder may come by mail or from a broken disk. NetCDF, CSV and JSON are read by "
    "different libraries with many kinds of errors.",
    expected="Each damage is refused in one line that names the file (exit 2), or predict gives "
    "the numbers of the intact run to the last bit. Never a traceback.",
    long=True,
)
def damaged_run(folder):
    files, rng = sound_run(), np.random.default_rng(4)
    load = {"a_over_R": 0.02, "b_over_R": 0.02, "p_over_E": 0.009}
    expected = rb.read_run(put(files, folder / "sound")).predict(**load).survival
    n = same = 0
    told: list[tuple[str, str]] = []
    # Posteriors of one form: the other's are read by the same code.
    for name in sorted(name for name in files if "modified" not in name):
        content = files[name]
        at = int(rng.integers(len(content) // 4, len(content) // 2))
        damaged = [b"", content[:at], content[:at] + bytes(64) + content[at + 64 :]]
        if name.endswith((".nc", ".json")):
            damaged += [bytes(len(content)), b"\xff" + content, b"[[" * 50_000, b"0" * 4000]
        if name.endswith(".csv"):
            damaged.append(content.replace(b"modified", b"modifier"))
            damaged.append(content.replace(b"0.", b"O."))
        here = folder / name.replace(".", "-").replace("/", "-")
        put(files, here)
        for one in damaged:
            n += 1
            (here / name).write_bytes(one)
            try:
                found = rb.read_run(here).predict(**load).survival
            except rb.InputError as refusal:
                told.append((name, str(refusal)))
            else:
                same += 1
                np.testing.assert_array_equal(found, expected)
    for name, message in told:
        assert name in message.partition("\n")[0], message
        assert name == "table.csv" or "\n" not in message, message  # which lists its rows
    put(files, folder / "run")
    about = json.loads(files["run.json"])
    (folder / "run" / "run.json").write_text(json.dumps({**about, "forms": ["../../x"]}))
    bands = ("--texture", "0.02,0.02", "--p-over-E", "0.001:0.01:5", "-o", "b.csv")
    ran(folder, "predict", "run", *bands).refused(2, "run.json: form '../../x'; expected one of")
    ran(folder, "report", "run").refused(2, "run.json: form '../../x'; expected one of")
    assert same < n / 3
    return f"{n} damaged files: {n - same} refused, {same} without effect"
