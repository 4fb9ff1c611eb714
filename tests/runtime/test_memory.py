"""The peak of memory counts a job's processes below it; freed memory serves the next batch."""

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


# Prints the number of pages that the system gives for 40 turns of four arrays of 1 MB.
TAKES_TURNS = """
import resource, sys
import numpy as np
from ridgebayes.runtime.memory import keep_freed_memory
if "keep" in sys.argv:
    keep_freed_memory()
pages = []
for turn in range(61):
    held = [np.ones(2**17) for _ in range(4)]
    del held
    pages.append(resource.getrusage(resource.RUSAGE_SELF).ru_minflt)
print(pages[60] - pages[20])
"""


@pytest.mark.process
@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="other C libraries differ")
def test_freed_memory__is_kept_for_the_next_arrays():
    command = [sys.executable, "-c", TAKES_TURNS]
    new, kept = (
        int(subprocess.run([*command, *how], capture_output=True, check=True).stdout)
        for how in ([], ["keep"])
    )
    assert kept < 100 < 10_000 < new
