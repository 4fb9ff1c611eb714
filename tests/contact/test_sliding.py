"""Counts averaged over offsets, against solutions at single offsets."""

import math

import numpy as np
import pytest

from ridgebayes.contact.contact_solution import solve_contact
from ridgebayes.contact.rigid_profile import Profile
from ridgebayes.contact.sliding import sliding_counts
from ridgebayes.errors import InputError

PROFILE = Profile(0.012, 0.03)


def test_sliding_counts__are_means_and_spreads_of_separate_solutions():
    W = np.array([2e-4, 3e-3])
    mean, sd = sliding_counts(PROFILE, W, n_offset=6)
    offsets = (np.arange(6) + 0.5) / 12
    for i, load in enumerate(W):
        counts = [solve_contact(Profile(0.012, 0.03, offset=o), load).Q for o in offsets]
        assert mean[i] == pytest.approx(np.mean(counts), abs=1e-12)  # algebra
        assert sd[i] == pytest.approx(np.std(counts), abs=1e-12)


@pytest.mark.parametrize("W", [[1e-6], [1e-6, 1.2e-4]])
def test_sliding_counts__where_a_floor_alone_is_touched_are_those_of_separate_solutions(W):
    shallow = Profile(0.012, 0.03, depth=5e-5)
    mean, _ = sliding_counts(shallow, W, n_offset=4)
    for load, found in zip(W, mean.tolist(), strict=True):
        places = [Profile(0.012, 0.03, depth=5e-5, offset=(i + 0.5) / 8) for i in range(4)]
        counts = [solve_contact(place, load).Q for place in places]
        assert 0 in counts or load > W[0]
        assert found == pytest.approx(np.mean(counts), abs=1e-12)  # algebra


def test_sliding_counts__of_fine_ridges_are_the_contact_over_the_pitch():
    # Many ridges: a contact of width 2 w touches (2 w + a) over the pitch of them on average. It is
    # wider than Hertz's by its edge constant, a fraction of a pitch on either side.
    fine = Profile(0.002, 0.002)
    W = 0.5 * 0.05**2
    mean, sd = sliding_counts(fine, W, n_offset=8)
    assert mean == pytest.approx((2 * math.sqrt(2 * W) + fine.a) / fine.pitch, abs=1.0)
    assert sd < 1


def test_sliding_counts__does_not_mind_the_profiles_own_offset():
    one, other = (
        sliding_counts(profile, [1e-3, 2e-3], n_offset=4)
        for profile in (PROFILE, Profile(0.012, 0.03, offset=0.3))
    )
    assert np.array_equal(one, other)


@pytest.mark.parametrize(("W", "n"), [([0.0], 4), ([np.nan], 4), ([], 4), ([1e-3], 0)])
def test_sliding_counts__refuses_bad_input(W, n):
    with pytest.raises(InputError, match="expected "):
        sliding_counts(PROFILE, W, n_offset=n)
