import math
from dataclasses import FrozenInstanceError, replace

import pytest

from ridgebayes.evidence import LogEvidence, laplace_evidence


def test_log_evidence__is_ok_only_if_its_status_says_so():
    assert LogEvidence("bridge", 1.0, 0.1).ok
    assert not LogEvidence("bridge", math.nan, math.nan, "not settled").ok


def test_laplace_evidence__is_one_half_log_of_two_pi_per_parameter_and_the_volume(laplaces):
    laplace = laplaces["modified"]
    record = laplace_evidence(laplace)
    volume = math.log(laplace.factor[0, 0] * laplace.factor[1, 1])
    expected = laplace.log_density + math.log(2 * math.pi) + volume
    assert record.value == pytest.approx(expected, rel=1e-14)  # algebra
    assert record.method == "laplace"
    assert math.isnan(record.se)
    assert record.ok


def test_laplace_evidence__is_not_ok_where_there_is_no_mode(laplaces):
    record = laplace_evidence(replace(laplaces["modified"], is_mode=False))
    assert record.status == "several humps, no mode"
    assert record.value == laplace_evidence(laplaces["modified"]).value


def test_log_evidence__cannot_be_changed():
    with pytest.raises(FrozenInstanceError):
        LogEvidence("bridge", 1.0, 0.1).value = 2.0
