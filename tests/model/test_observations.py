"""From a table's rows to the arrays a posterior is conditioned on."""

import numpy as np
import pandas as pd
import pytest

from ridgebayes import ContactTable, InputError
from ridgebayes.model.observations import Observations

TEXTURES = np.array([(0.012, 0.03), (0.032, 0.01), (0.022, 0.02)])


def frame_of(n=6):
    j = np.arange(n) % 3
    return pd.DataFrame(
        {
            "a_over_R": TEXTURES[j, 0],
            "b_over_R": TEXTURES[j, 1],
            "Q": 4 + 2 * (np.arange(n) // 3),
            "p_over_E": 1e-4 * np.linspace(1, 2, n),
            "nu": np.where(np.arange(n) % 2, 0.3, 0.5),
            "rel_se": 0.01 * np.arange(n),
        }
    )


def observations(frame, where="mine.csv"):
    return Observations.from_table(ContactTable.from_frame(frame, where=where))


def test_from_table__reduces_loads_and_keeps_textures_in_order():
    frame = frame_of()
    data = observations(frame)
    assert len(data) == len(frame)
    assert data.textures == tuple(map(tuple, TEXTURES.tolist()))
    assert data.texture.tolist() == [0, 1, 2, 0, 1, 2]
    assert data.a_over_R.tolist() == TEXTURES[:, 0].tolist()
    assert data.b_over_R.tolist() == TEXTURES[:, 1].tolist()
    assert data.Q.tolist() == frame["Q"].tolist()
    assert data.rel_se.tolist() == frame["rel_se"].tolist()
    expected = np.log(frame["p_over_E"] * (1 - frame["nu"] ** 2) / 0.75)
    np.testing.assert_allclose(data.log_load, expected, rtol=1e-14)  # algebra
    assert np.isnan(data.log_lower).all()
    assert not data.is_count.any()
    assert data.is_exact.all()


def test_from_table__takes_brackets_with_both_ends_reduced():
    frame = frame_of()
    lower = np.array([np.nan, 0.9, 0.0, 1.0, np.nan, 0.5]) * frame["p_over_E"]
    data = observations(frame.assign(p_over_E_lower=lower))
    np.testing.assert_array_equal(np.isnan(data.log_lower), np.isnan(lower))
    assert data.log_lower[2] == -np.inf
    expected = np.log([0.9, 1.0, 0.5])
    found = (data.log_lower - data.log_load)[[1, 3, 5]]
    np.testing.assert_allclose(found, expected, atol=1e-14)  # rounding: logs of 10
    # A bracket whose ends agree is the load itself.
    assert data.is_exact.tolist() == [True, False, False, True, True, False]


def test_from_table__takes_counts():
    frame = frame_of().assign(kind=["count", "transition", "count"] * 2)
    frame.loc[0, "Q"] = 2
    data = observations(frame)
    assert data.is_count.tolist() == [True, False, True] * 2
    assert data.Q.tolist() == [2, 4, 4, 6, 6, 6]
    assert data.is_exact.tolist() == [False, True, False] * 2
    plain = observations(frame_of())
    assert data.log_load.tolist() == plain.log_load.tolist()


def test_from_table__takes_series_and_sources_only_where_there_is_no_series():
    source = ["a.csv", "b.csv"] * 3
    plain = observations(frame_of())
    assert (plain.n_series, plain.series_labels) == (1, ("",))
    assert not plain.series.any()
    by_source = observations(frame_of().assign(source=source))
    assert by_source.series_labels == ("a.csv", "b.csv")
    assert by_source.series.tolist() == [0, 1] * 3
    named = observations(frame_of().assign(source=source, series=["", "", "rig 2"] * 2))
    assert named.series_labels == ("", "rig 2")
    assert named.series.tolist() == [0, 0, 1] * 2


@pytest.mark.parametrize(
    ("series", "one_series", "one_texture"),
    [
        ("xxyyzz", True, True),  # each series is a texture
        ("xxxxyy", True, False),  # a series of two textures
        ("xyzzuu", False, True),  # a texture of two series
        ("xyxyxy", False, False),
        ("xxxxxx", False, False),  # one series is none
    ],
)
def test_series__that_cannot_be_told_from_textures(series, one_series, one_texture):
    places = {"a_over_R": [0.01, 0.01, 0.02, 0.02, 0.03, 0.03], "b_over_R": 0.02, "Q": [4, 6] * 3}
    rows = observations(frame_of().assign(**places, series=list(series)))
    assert rows.one_series_per_texture is one_series
    assert rows.one_texture_per_series is one_texture


def test_from_table__refuses_bodies_that_are_not_centred():
    frame = frame_of().assign(offset_over_R=[0.0, 0.001, 0.0, 0.002, 0.0, 0.0])
    rule = (
        r"mine.csv, row 2 and 1 more rows: offset_over_R: expected 0, got 0.001; .*centred bodies"
    )
    with pytest.raises(InputError, match=rule):
        observations(frame)
    one = frame.assign(offset_over_R=[0.0, 0.001, 0.0, 0.0, 0.0, 0.0])
    with pytest.raises(InputError, match=r"mine.csv, row 2: offset_over_R: expected 0, got 0.001"):
        observations(one)


def test_take__keeps_rows_and_the_textures_that_they_have():
    series = ["one", "two", "three"] * 2
    frame = frame_of().assign(
        series=series, p_over_E_lower=5e-5, kind=["count", "transition", "transition"] * 2
    )
    frame.loc[frame["kind"] == "count", "p_over_E_lower"] = np.nan
    data = observations(frame)
    keep = np.array([True, False, True, False, False, True])
    some = data.take(keep)
    again = observations(frame[keep].reset_index(drop=True))
    assert some.textures == again.textures == tuple(map(tuple, TEXTURES[[0, 2]].tolist()))
    assert len(some.labels) == 2
    # The series are the table's, also those without a row: what is left out has one of them.
    assert some.series_labels == ("one", "two", "three")
    assert some.series.tolist() == data.series[keep].tolist()
    for name in ("texture", "Q", "log_load", "rel_se", "log_lower", "is_count", "labels"):
        np.testing.assert_array_equal(getattr(some, name), getattr(again, name))
