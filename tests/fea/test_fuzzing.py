"""Damaged files: some hundred of them, with a fixed seed."""

import numpy as np
import pytest

from tests.fea import fuzzing

N_MUTANT = 8  # of each kind of file; thousands by `python -m tests.fea.fuzzing`


@pytest.mark.parametrize("name", sorted(fuzzing.TARGETS))
def test_targets__read_what_is_whole(name, tmp_path):
    target = fuzzing.TARGETS[name]
    path = tmp_path / target.file_name
    path.write_bytes(target.content)
    found = target.read(path)
    assert target.doubt(target.content, found) == ""


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(fuzzing.TARGETS))
def test_mutants__are_refused_in_words_or_read_as_they_stand(name, tmp_path):
    rng = np.random.default_rng([20, *name.encode()])
    counts = fuzzing.attack(fuzzing.TARGETS[name], N_MUTANT, rng, tmp_path)
    assert counts["refused"] > (N_MUTANT / 3 if name.startswith("columns") else 0)
    assert counts["read"] + counts["refused"] + counts["same bytes"] == N_MUTANT


def test_attack__sees_a_number_that_is_not_in_the_file(tmp_path):
    target = fuzzing.TARGETS["columns, contract"]

    def read(path):
        path.write_text(path.read_text().replace("0.49", "0.48").replace("0.0087", "0.0088"))
        return target.read(path)

    wrong = fuzzing.Target(
        "wrong", target.file_name, target.content, read, target.doubt, lambda content, rng: content
    )
    with pytest.raises(AssertionError, match=r"wrong: the file has"):
        fuzzing.attack(wrong, 1, np.random.default_rng(1), tmp_path)
