"""Chains on disk: the same walk back, and a clear refusal of anything else."""

from dataclasses import fields, replace

import numpy as np
import pytest

from ridgebayes import InputError
from ridgebayes.inference.checkpoint import Checkpoint, Walk, packed, unpacked


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


def test_load__without_a_file_is_none(checkpoint):
    assert checkpoint.load() is None


def test_load__gives_back_what_save_kept_to_the_last_bit(checkpoint, walk):
    checkpoint.save(walk)
    again = checkpoint.load()
    assert again.n_step == 7
    for name in (field.name for field in fields(Walk)):
        np.testing.assert_array_equal(getattr(again, name), getattr(walk, name))


def test_load__goes_on_with_the_same_random_numbers(checkpoint, walk):
    # An odd number of normals leaves one in store: it has to come back as well.
    used = np.random.RandomState(9)
    used.standard_normal(3)
    checkpoint.save(replace(walk, **packed([used.get_state(), *unpacked(walk)[1:]])))
    again = np.random.RandomState()
    again.set_state(unpacked(checkpoint.load())[0])
    np.testing.assert_array_equal(again.standard_normal(5), used.standard_normal(5))


def test_load__names_what_has_changed(checkpoint, walk):
    checkpoint.save(walk)
    other = Checkpoint(checkpoint.path, {"form": "modified", "seed": "1"})
    with pytest.raises(InputError, match=r"chains-hybrid.npz: cannot resume, form was 'hybrid'"):
        other.load()


@pytest.mark.parametrize("damage", [0, 100, 3000, "a bit"])
def test_load__refuses_a_damaged_file(checkpoint, walk, damage):
    checkpoint.save(walk)
    content = bytearray(checkpoint.path.read_bytes())
    if damage == "a bit":
        content[len(content) // 2] ^= 1
    checkpoint.path.write_bytes(content if damage == "a bit" else content[:damage])
    with pytest.raises(InputError, match=r"chains-hybrid.npz: not a readable chain file"):
        checkpoint.load()


def test_save__leaves_no_partial_file(checkpoint, walk):
    checkpoint.save(walk)
    checkpoint.save(walk)
    assert [path.name for path in checkpoint.path.parent.iterdir()] == ["chains-hybrid.npz"]
