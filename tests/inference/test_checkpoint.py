"""Chains on disk: the same walk back, and a clear refusal of anything else."""

from dataclasses import fields

import numpy as np
import pytest

from ridgebayes.errors import InputError
from ridgebayes.inference.checkpoint import Checkpoint, Walk


@pytest.fixture
def walk():
    rng = np.random.default_rng(3)
    return Walk(
        u=rng.standard_normal((4, 7, 6, 3)),
        log_density=rng.standard_normal((4, 7, 6)),
        extras=rng.standard_normal((4, 7, 6, 5)),
        accepted=np.arange(4.0),
        last_u=rng.standard_normal((4, 6, 3)),
        last_log_density=rng.standard_normal((4, 6)),
        last_extras=rng.standard_normal((4, 6, 5)),
        tau=np.array([1.5, 2.5, np.inf, 1.0]),
        weights=rng.random(2),
        charts=np.array([0, 1]),
        centres=rng.standard_normal((2, 3)),
        factors=rng.standard_normal((2, 3, 3)),
        random_states=tuple(np.random.RandomState(i).get_state() for i in range(4)),
    )


@pytest.fixture
def checkpoint(tmp_path):
    return Checkpoint(tmp_path / "chains-hybrid.h5", {"form": "hybrid", "seed": "1"})


def test_load__without_a_file_is_none(checkpoint):
    assert checkpoint.load() is None


def test_load__gives_back_what_save_kept_to_the_last_bit(checkpoint, walk):
    checkpoint.save(walk)
    again = checkpoint.load()
    assert again.n_step == 7
    for name in (field.name for field in fields(Walk) if field.name != "random_states"):
        np.testing.assert_array_equal(getattr(again, name), getattr(walk, name))


def test_load__goes_on_with_the_same_random_numbers(checkpoint, walk):
    # An odd number of normals leaves one in store: it has to come back as well.
    used = np.random.RandomState(9)
    used.standard_normal(3)
    states = (used.get_state(), *walk.random_states[1:])
    checkpoint.save(Walk(**{**vars(walk), "random_states": states}))
    again = np.random.RandomState()
    again.set_state(checkpoint.load().random_states[0])
    np.testing.assert_array_equal(again.standard_normal(5), used.standard_normal(5))


def test_load__names_what_has_changed(checkpoint, walk):
    checkpoint.save(walk)
    other = Checkpoint(checkpoint.path, {"form": "modified", "seed": "1"})
    with pytest.raises(InputError, match=r"chains-hybrid.h5: cannot resume, form was 'hybrid'"):
        other.load()


@pytest.mark.parametrize("keep", [0, 100, 3000])
def test_load__refuses_a_damaged_file(checkpoint, walk, keep):
    checkpoint.save(walk)
    content = checkpoint.path.read_bytes()
    checkpoint.path.write_bytes(content[:keep])
    with pytest.raises(InputError, match=r"chains-hybrid.h5: not a readable chain file"):
        checkpoint.load()


def test_save__leaves_no_partial_file(checkpoint, walk):
    checkpoint.save(walk)
    checkpoint.save(walk)
    assert [path.name for path in checkpoint.path.parent.iterdir()] == ["chains-hybrid.h5"]
