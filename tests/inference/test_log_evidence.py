import math
from dataclasses import FrozenInstanceError

import pytest

from ridgebayes.inference.log_evidence import LogEvidence


def test_log_evidence__is_ok_only_if_its_status_says_so():
    assert LogEvidence("bridge", 1.0, 0.1).ok
    failed = LogEvidence("bridge", math.nan, math.nan, "not settled")
    assert not failed.ok
    assert failed.kept().status == "first pass: not settled"
    assert failed.kept().ok
    with pytest.raises(FrozenInstanceError):
        failed.value = 2.0
