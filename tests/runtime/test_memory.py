"""The peak of memory counts a job's processes below it."""

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
