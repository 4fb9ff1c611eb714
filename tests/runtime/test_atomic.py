import subprocess
import sys
from pathlib import Path

import pytest

from ridgebayes import InputError
from ridgebayes.errors import OutputError
from ridgebayes.runtime.atomic import exclusive_lock, replacing


def test_replacing__keeps_the_old_file_and_no_other_where_writing_fails(tmp_path):
    path = tmp_path / "table.csv"
    path.write_text("before")

    def fail():
        with replacing(path) as partial:
            partial.write_text("half")
            assert partial.parent == path.parent
            raise OSError

    with pytest.raises(OSError):
        fail()
    assert [(found.name, found.read_text()) for found in tmp_path.iterdir()] == [
        ("table.csv", "before")
    ]


def test_replacing__puts_the_new_file_in_place_of_the_old(tmp_path):
    path = tmp_path / "table.csv"
    path.write_text("before")
    with replacing(path) as partial:
        partial.write_text("after")
        assert path.read_text() == "before"
    assert [found.read_text() for found in tmp_path.iterdir()] == ["after"]


def test_replacing__a_folder_is_refused():
    with pytest.raises(OutputError, match=r"\A\.: cannot be written"), replacing(Path()) as partial:
        partial.write_text("new")


HOLDER = """
import sys
from pathlib import Path
from ridgebayes.runtime.atomic import exclusive_lock
with exclusive_lock(Path(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.read()
"""


def test_exclusive_lock__is_of_one_process_and_dies_with_it(tmp_path):
    path, lock = tmp_path / "out", tmp_path / ".out.lock"
    words = [sys.executable, "-c", HOLDER, str(path)]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as holder:
        assert holder.stdout.readline() == b"held\n"
        with (
            pytest.raises(InputError, match=r"out: another process is working on it; use another"),
            exclusive_lock(path),
        ):
            pass
        with exclusive_lock(tmp_path / "other"):
            pass
        holder.kill()
    assert lock.exists()  # the file, which nobody holds any more
    with exclusive_lock(path):
        assert lock.exists()
    assert list(tmp_path.iterdir()) == []


def test_exclusive_lock__is_released_by_an_error_and_needs_a_folder(tmp_path):
    with pytest.raises(ZeroDivisionError), exclusive_lock(tmp_path / "out"):
        raise ZeroDivisionError
    assert list(tmp_path.iterdir()) == []
    expected = r"out: cannot be written: .*; expected a folder"
    for folder in (tmp_path / "none", Path("/proc")):
        with pytest.raises(InputError, match=expected), exclusive_lock(folder / "out"):
            pass
