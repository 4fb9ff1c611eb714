import os
import subprocess
import sys

import pytest

CORNER = """
import numpy as np
from ridgebayes.drawing.posterior import plot_corner
draws = np.random.default_rng(1).normal(size=(500, 2))
plot_corner("hybrid", ["c1", "c2"], draws, {}, n_parameter=2)
"""
NETCDF = "from ridgebayes.runtime.quiet import import_arviz; import_arviz()"


@pytest.mark.long
@pytest.mark.process
@pytest.mark.parametrize(("code", "cache"), [(CORNER, "new"), (NETCDF, "file/cannot-be")])
def test_import_arviz__says_nothing_on_the_first_import_of_a_day(tmp_path, code, cache):
    (tmp_path / "file").touch()
    # Where arviz 0.x notes the day on which it spoke; matplotlib's own folder is another.
    folders = {"XDG_CACHE_HOME": str(tmp_path / cache), "MPLCONFIGDIR": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-c", code], env=os.environ | folders, capture_output=True, text=True
    )
    assert (done.returncode, done.stderr) == (0, "")
