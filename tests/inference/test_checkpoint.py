"""Chains on disk: the same walk back, and a clear refusal of anything else."""

from dataclasses import fields

import numpy as np
import pytest

from ridgebayes import InputError
from ridgebayes.inference.checkpoint import Checkpoint, Walk, packed


@pytest.fixture
def walk():
    rng = np.random.default_rng(3)
    return Walk(
        u=rng.standard_normal((4, 8, 6, 3)),
        log_density=rng.standard_normal((4, 8, 6)),
        extras=rng.standard_normal((4, 8, 6, 5)),
        accepted=np.arange(4.0),
        tau=np.array([1.5, 2.5, np.inf, 1.0]),
        **packed([np.random.RandomState(i).get_state() for i in range(4)]),
    )


@pytest.fixture
def checkpoint(tmp_path):
    return Checkpoint(tmp_path / "chains-hybrid.npz", {"form": "hybrid", "seed": "1"})


def test_load__gives_back_what_save_kept_to_the_last_bit(checkpoint, walk):
    checkpoint.save(walk)
    again = checkpoint.load()
    assert again.n_step == 7
    for name in (field.name for field in fields(Walk)):
        np.testing.assert_array_equal(getattr(again, name), getattr(walk, name))


@pytest.mark.parametrize("damage", [0, 100, 3000, "a bit"])
def test_load__refuses_a_damaged_file(checkpoint, walk, damage):
    checkpoint.save(walk)
    content = bytearray(checkpoint.path.read_bytes())
    if damage == "a bit":
        content[len(content) // 2] ^= 1
    checkpoint.path.write_bytes(content if damage == "a bit" else content[:damage])
    with pytest.raises(InputError, match=r"chains-hybrid.npz: not a readable chain file"):
        checkpoint.load()
