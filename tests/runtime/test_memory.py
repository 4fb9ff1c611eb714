"""The peak of memory counts a job's processes below it; threads share what one of them frees."""

import platform
import subprocess
import sys

import pytest

from ridgebayes.runtime.memory import PeakMemory

HOLDS = "x = b'1' * 100_000_000; print(flush=True); input()"


@pytest.mark.process
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only Linux tells")
def test_memory_of_a_child__counts():
    peak = PeakMemory()
    peak.look()
    alone = peak.in_bytes
    with subprocess.Popen(
        [sys.executable, "-c", HOLDS], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as child:
        child.stdout.readline()
        peak.look()
        child.communicate(b"\n")
    assert peak.in_bytes > alone + 90_000_000


_ARENAS = """
import ctypes, sys, tempfile, threading
from ridgebayes.runtime.memory import share_one_arena

if sys.argv[1] == "one":
    share_one_arena()
barrier = threading.Barrier(4)

def work():
    barrier.wait()
    kept.append([bytes(1000) for _ in range(1000)])
    barrier.wait()

kept = []
threads = [threading.Thread(target=work) for _ in range(4)]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
libc = ctypes.CDLL(None)
libc.fopen.restype = ctypes.c_void_p
libc.malloc_info.argtypes = [ctypes.c_int, ctypes.c_void_p]
libc.fclose.argtypes = [ctypes.c_void_p]
with tempfile.NamedTemporaryFile() as file:
    stream = libc.fopen(file.name.encode(), b"w")
    libc.malloc_info(0, stream)
    libc.fclose(stream)
    print(file.read().count(b"<heap nr="))
"""


@pytest.mark.process
@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="other C libraries have no arenas")
@pytest.mark.parametrize("how", ["one", "each"])
def test_share_one_arena__leaves_one_however_many_threads_allocate(how):
    asked = [sys.executable, "-c", _ARENAS, how]
    n = int(subprocess.run(asked, capture_output=True, text=True, check=True).stdout)
    assert (n == 1) == (how == "one")  # and without it each thread has its own
