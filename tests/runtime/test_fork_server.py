import subprocess
import sys

import pytest

SERVER = """
import os, sys, threading
from ridgebayes.runtime.pool import workers
def seen():
    return hasattr(sys, "mark"), "ridgebayes.runtime.journal" in sys.modules, os.getppid()
if __name__ == "__main__":
    import ridgebayes.runtime.journal
    sys.mark, ended = 1, threading.Event()
    if sys.argv[1:]:
        threading.Thread(target=ended.wait, daemon=True).start()
    print("once")
    with workers(2) as pool:
        found = {future.result() for future in [pool.submit(seen) for _ in range(8)]}
    ended.set()
    print(*(is_copy + 2 * has_loaded for is_copy, has_loaded, _ in found), len(found))
"""


@pytest.mark.process
@pytest.mark.parametrize(("threads", "expected"), [([], "3 1"), (["too"], "2 1")])
def test_start_server__is_a_copy_of_a_process_of_one_thread(tmp_path, threads, expected):
    # Of one that has more it is a fresh interpreter, which imports what was loaded.
    script = tmp_path / "parent.py"
    script.write_text(SERVER)
    words = [sys.executable, "-W", "error", str(script), *threads]
    done = subprocess.run(words, check=True, capture_output=True, text=True)
    assert done.stdout == f"once\n{expected}\n"
    assert not done.stderr
