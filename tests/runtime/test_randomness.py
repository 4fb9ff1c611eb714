import os
import subprocess
import sys

import numpy as np
import pytest

from ridgebayes import InputError
from ridgebayes.runtime.randomness import seed_of, stream


def test_seed_of__draws_from_a_generator_reproducibly_and_moves_it_on():
    rng = np.random.default_rng(4)
    first, second = seed_of(rng), seed_of(rng)
    assert first != second
    assert first == seed_of(np.random.default_rng(4))


@pytest.mark.parametrize("bad", [-1, 1.5, True, None, "7"])
def test_seed_of__refuses_what_is_no_seed(bad):
    rule = rf"rng: expected a non-negative integer or a numpy Generator, got {bad!r}"
    with pytest.raises(InputError, match=rule):
        seed_of(bad)


def test_stream__differs_with_seed_labels_and_their_order():
    names = [(1,), (2,), (1, "a"), (1, "b"), (1, "a", "b"), (1, "b", "a"), (1, "ab")]
    assert len({float(stream(*name).random()) for name in names}) == len(names)


def test_stream__is_the_same_in_every_process():
    # Python's own hash() of text would differ between these two.
    code = "from ridgebayes.runtime.randomness import stream; print(stream(3, 'x').random().hex())"
    found = [
        subprocess.run(
            [sys.executable, "-c", code],
            env=os.environ | {"PYTHONHASHSEED": seed},
            capture_output=True,
            text=True,
            check=True,
        ).stdout.strip()
        for seed in ("1", "2")
    ]
    assert found == [float(stream(3, "x").random()).hex()] * 2
