"""Bands and loads as tables: every column derived from the others or from a form's equation."""

import math

import numpy as np
import pandas as pd
import pytest

import ridgebayes as rb
from ridgebayes import Noise
from ridgebayes.comparison import bands as module
from ridgebayes.comparison.bands import bands_table, default_loads, loads_table
from tests.columns import COLUMNS

SHARES = {"classic": 0.2, "modified": 0.3, "hybrid": 0.5}
BAND_COLUMNS, LOAD_COLUMNS = (COLUMNS[f"{name}.csv"].split(",") for name in ("bands", "loads"))


def compared(table, fits, shares=SHARES):
    """Make a comparison with probabilities given by hand, so that an average is a real mix."""
    columns = {"form": list(shares), "model_probability": list(shares.values())}
    evidence = pd.DataFrame(columns).assign(noise="iid")
    nothing = pd.DataFrame()
    chosen = {name: fits[name] for name in shares}
    return rb.Comparison(
        table, Noise(), chosen, evidence.assign(used=True), nothing, nothing, nothing
    )


@pytest.fixture(scope="module")
def comparison(paper, fits):
    return compared(paper, fits)


@pytest.fixture(scope="module")
def bands(comparison):
    return bands_table(
        comparison,
        textures=[(0.022, 0.02), (0.012, 0.09), (0.032, 0.01)],
        loads=np.geomspace(1e-4, 0.02, 40),
    )


@pytest.fixture(scope="module")
def loads(comparison):
    return loads_table(comparison)


def tail(frame):
    return [name for name in frame if name.startswith("p_q_ge_")]


# --- bands on Q -----------------------------------------------------------------------------------


def test_bands__columns_are_the_contract_for_every_form_and_the_average_in_both_kinds(bands):
    names = tail(bands)
    assert list(bands) == BAND_COLUMNS + names
    assert names == [f"p_q_ge_{n}" for n in range(4, 4 + 2 * len(names), 2)]
    rows = bands.groupby(["kind_of_band", "form"], sort=False).size()
    expected = [(kind, form) for kind in ("curve", "simulation") for form in (*SHARES, "average")]
    assert rows.index.tolist() == expected
    assert set(rows) == {3 * 40}
    assert bands[["noise", "prob", "nu"]].drop_duplicates().to_numpy().tolist() == [
        ["iid", 0.9, 0.5]
    ]
    assert not bands.isna().any(axis=None)


@pytest.mark.parametrize("load", [1e-6, 1e-3, 0.02])
def test_bands__end_at_the_first_negligible_count_at_any_load(comparison, load):
    frame = bands_table(comparison, textures=[(0.022, 0.02)], loads=np.array([load]))
    highest = frame[tail(frame)].max()
    assert highest.iloc[-1] < 1e-6
    assert (highest.iloc[:-1] >= 1e-6).all()


def test_bands__an_average_ends_by_its_own_probabilities(paper, fits):
    """Classic's wide errors reach far counts, but weigh next to nothing."""
    mixed = compared(paper, fits, {"modified": 1 - 1e-5, "classic": 1e-5})
    where = {"textures": [(0.022, 0.02)], "loads": np.array([0.01])}
    average = bands_table(mixed, forms=["average"], **where)
    highest = average[tail(average)].max()
    assert highest.iloc[-1] < 1e-6
    assert (highest.iloc[:-1] >= 1e-6).all()
    assert len(highest) < len(tail(bands_table(mixed, forms=["classic"], **where)))


def test_bands__go_texture_by_texture_and_load_by_load(bands):
    one = bands.query("form == 'hybrid' and kind_of_band == 'curve'")
    assert one["a_over_R"].tolist() == [0.022] * 40 + [0.012] * 40 + [0.032] * 40
    assert one["b_over_R"].tolist() == [0.02] * 40 + [0.09] * 40 + [0.01] * 40
    assert one["p_over_E"].tolist() == np.geomspace(1e-4, 0.02, 40).tolist() * 3


def test_bands__average_is_the_mix_by_probability(bands):
    for kind in ("curve", "simulation"):
        of_kind = bands[bands["kind_of_band"] == kind]
        part = {name: rows[["q_mean", *tail(bands)]] for name, rows in of_kind.groupby("form")}
        mix = sum(share * part[form].to_numpy() for form, share in SHARES.items())
        # Algebra: sums of four numbers.
        np.testing.assert_allclose(
            part["average"].to_numpy(), mix, rtol=0, atol=1e-6
        )  # printed digits


def test_bands__probabilities_fall_with_the_count_and_rise_with_the_load(bands):
    ladder = bands[tail(bands)].to_numpy()
    assert ((ladder >= 0) & (ladder <= 1)).all()
    assert (np.diff(ladder, axis=1) <= 0).all()
    by_load = ladder.reshape(-1, 40, ladder.shape[1])
    # Algebra: means of thousands of numbers, each to rounding.
    assert (np.diff(by_load, axis=1) >= -1e-12).all()


def test_bands__mean_median_and_bounds_follow_from_the_probabilities(bands):
    ladder = np.column_stack([np.ones(len(bands)), bands[tail(bands)].to_numpy()])
    # Algebra: the mean is a sum of probabilities; what lies beyond the last is under 1e-6 a count.
    np.testing.assert_allclose(bands["q_mean"], 2 * ladder.sum(axis=1), rtol=0, atol=1e-5)
    for column, prob in [("q_median", 0.5), ("q_lower", 0.05), ("q_upper", 0.95)]:
        q = bands[column].to_numpy().astype(int)
        here = ladder[np.arange(len(q)), q // 2 - 1]  # P(Q >= q)
        above = ladder[np.arange(len(q)), q // 2]  # P(Q >= q + 2)
        assert (1 - above >= prob - 1e-9).all()  # q is enough,
        assert ((1 - here < prob) | (q == 2)).all()  # and q - 2 is not
    assert (bands["q_lower"] <= bands["q_median"]).all()
    assert (bands["q_median"] <= bands["q_upper"]).all()


def test_bands__curve_is_the_share_of_draws_whose_load_is_reached(bands, fits):
    """A slow count over draws beside the sorted search."""
    fit = fits["hybrid"]
    rows = bands.query("form == 'hybrid' and kind_of_band == 'curve' and b_over_R == 0.09")
    theta = fit.draws[:, :2]
    for q in (4, 6):
        load = rb.Hybrid().load(q, 0.012, 0.09, theta)
        p = rows["p_over_E"].to_numpy()
        share = [np.mean(load <= one) for one in p]
        # Algebra: counts over the same draws; a load equal to a draw's to rounding may go either
        # way, which is one draw in 10,240.
        drawn = fit.predict(0.012, 0.09, p, kind="curve").at_least(q)
        np.testing.assert_allclose(drawn, share, rtol=0, atol=1.01 / len(theta))
        # Monte Carlo: weighted nodes against draws, five standard errors.
        most = 5 * np.sqrt(0.25 / fit.summary["ess_bulk"].min())
        np.testing.assert_allclose(rows[f"p_q_ge_{q}"], share, rtol=0, atol=most)


def test_bands__pass_over_rows_that_are_not_ok(comparison, paper):
    frame = paper.frame
    is_lost = frame["texture"].eq("a0.012_b0.03") | frame["p_over_E"].eq(frame["p_over_E"].max())
    frame["status"] = frame["status"].mask(is_lost, "diverged")
    found = compared(rb.ContactTable.from_frame(frame), comparison.fits)
    bands = bands_table(found, forms=["modified"], loads=np.array([0.01]), kinds=["curve"])
    assert len(bands) == len(paper.textures) - 1
    p = default_loads(found, 5)
    assert len(p) == 5
    assert math.isclose(p[-1], frame.loc[frame["status"] == "ok", "p_over_E"].max())


@pytest.mark.parametrize(("kept", "n_load"), [(10_000, 200), (500, 50), (20, 10)])
def test_bands__of_very_many_textures_are_at_fewer_loads(comparison, monkeypatch, kept, n_load):
    monkeypatch.setattr("ridgebayes.comparison.bands.MAX_BANDS_KEPT", kept)
    found = bands_table(comparison, forms=["modified"], kinds=["curve"])
    assert len(found) == n_load * len(comparison.table.textures) == n_load * 10


def test_bands__of_very_many_places_keep_no_posteriors_and_are_the_same(comparison, monkeypatch):
    where = {"textures": [(0.022, 0.02)], "loads": np.geomspace(1e-3, 0.02, 30)}
    kept = bands_table(comparison, **where)
    monkeypatch.setattr("ridgebayes.comparison.bands.MAX_BANDS_KEPT", 29)
    pd.testing.assert_frame_equal(bands_table(comparison, **where), kept, check_exact=True)


def test_bands__default_to_the_poissons_ratio_of_each_texture(comparison, paper):
    frame = paper.frame
    frame["nu"] = frame["nu"].mask(frame["a_over_R"] == 0.012, 0.3)
    soft = compared(rb.ContactTable.from_frame(frame), comparison.fits, {"modified": 1.0})
    textures = [(0.012, 0.03), (0.022, 0.02), (0.05, 0.05)]  # the last is not in the table
    options = {"loads": np.array([0.004, 0.009]), "forms": ["modified"]}
    found = bands_table(soft, textures=textures, **options)
    assert found["nu"].tolist() == [0.3, 0.3, 0.5, 0.5, 0.5, 0.5] * 2
    for texture, nu in zip(textures, (0.3, 0.5, 0.5), strict=True):
        alone = bands_table(soft, textures=[texture], nu=nu, **options)
        ours = found[found["a_over_R"] == texture[0]].reset_index(drop=True)
        pd.testing.assert_frame_equal(ours[list(alone)], alone, check_exact=True)


# --- loads that reach Q ---------------------------------------------------------------------------


def test_loads__one_row_for_each_transition_held_out_ones_too(loads, paper):
    rows = loads.groupby(["kind_of_band", "form"], sort=False).size()
    expected = [(kind, form) for kind in ("curve", "simulation") for form in (*SHARES, "average")]
    assert rows.index.tolist() == expected
    assert set(rows) == {44}
    one = loads.query("form == 'average' and kind_of_band == 'curve'")
    columns = ["a_over_R", "b_over_R", "nu", "Q"]
    assert one[columns].to_numpy().tolist() == paper.frame[columns].to_numpy().tolist()
    assert one["p_over_E_observed"].tolist() == paper.frame["p_over_E"].tolist()


def test_loads__bounds_hold_the_median(loads):
    assert not loads.isna().any(axis=None)
    assert (loads["p_over_E_lower"] < loads["p_over_E_median"]).all()
    assert (loads["p_over_E_median"] < loads["p_over_E_upper"]).all()
    width = np.log(loads["p_over_E_upper"] / loads["p_over_E_lower"])
    curve = loads["kind_of_band"] == "curve"
    assert (width[curve].to_numpy() < width[~curve].to_numpy()).all()


def test_loads__curve_median_is_the_load_at_the_median_coefficient(loads, fits):
    """The load falls with c, so quantiles of one are quantiles of the other."""
    c = fits["modified"].draws[:, 0]
    # Monte Carlo: five standard errors of a sample median, for 2,560 draws at least, in log load.
    error = 2 * 1.2533 * c.std() / c.mean() / math.sqrt(2560)
    rows = loads.query("form == 'modified' and kind_of_band == 'curve'")
    expected = rb.Modified().load(
        rows["Q"], rows["a_over_R"], rows["b_over_R"], np.array([np.median(c)])
    )
    assert np.abs(np.log(rows["p_over_E_median"] / expected)).max() < 5 * error


def test_loads__simulation_spread_is_sigma(loads, fits):
    """With c known to a fraction of sigma, the 90 % band is 2 x 1.645 sigma wide in log load."""
    sigma = fits["modified"].summary.set_index("parameter").loc["sigma", "mean"]
    sd_c = fits["modified"].summary.set_index("parameter").loc["c", "sd"]
    rows = loads.query("form == 'modified' and kind_of_band == 'simulation'")
    width = np.log(rows["p_over_E_upper"] / rows["p_over_E_lower"])
    spread = math.hypot(sigma, 2 * sd_c / 1.37)
    # Reference: normal quantiles; a t with about 40 degrees of freedom is 3 % wider.
    assert np.abs(width / (2 * 1.6449 * spread) - 1).max() < 0.05


def test_loads__rows_that_are_not_ok_transitions_are_not_predicted(paper, fits):
    frame = paper.frame
    frame["status"] = frame["status"].mask(frame.index == 2, "diverged")
    frame["kind"] = frame["kind"].mask(frame.index == 5, "count")
    found = loads_table(compared(rb.ContactTable.from_frame(frame), fits, {"modified": 1.0}))
    assert set(found["form"]) == {"modified", "average"}
    assert len(found) == 2 * 2 * (44 - 2)
    assert not set(found["p_over_E_observed"]) & set(frame.loc[[2, 5], "p_over_E"])


def test_loads__rows_of_a_body_off_centre_are_not_predicted(paper, fits):
    frame = paper.frame
    off = frame.tail(3).assign(offset_over_R=0.01, role="held-out", Q=[5, 7, 9])
    table = rb.ContactTable.from_frame(pd.concat([frame, off]))
    found = loads_table(compared(table, fits, {"modified": 1.0}))
    pd.testing.assert_frame_equal(found, loads_table(compared(paper, fits, {"modified": 1.0})))


def test_loads__simulation_bands_hold_the_rows_known_error(paper, fits):
    known = np.where(paper.frame["Q"] == 6, 0.05, 0.0)
    table = rb.ContactTable.from_frame(paper.frame.assign(rel_se=known))
    shares = {"modified": 1.0}
    found, bare = (loads_table(compared(one, fits, shares)) for one in (table, paper))
    curve = found["kind_of_band"] == "curve"
    pd.testing.assert_frame_equal(found[curve], bare[curve])
    width, other = (
        np.log(f["p_over_E_upper"] / f["p_over_E_lower"])[~curve] for f in (found, bare)
    )
    # Monte Carlo: sigma's own spread, 11 %, makes the bands wider than a normal's by 2 %.
    expected = np.hypot(other, 2 * 1.6449 * np.tile(known, 2))
    np.testing.assert_allclose(width, expected, rtol=0.02)
    same = np.tile(known, 2) == 0
    np.testing.assert_allclose(width[same], other[same], rtol=1e-7)  # solved for to 1e-10


def test_loads__of_very_many_rows_take_fewer_draws(paper, fits, monkeypatch):
    comparison = compared(paper, fits, {"modified": 1.0})
    many = loads_table(comparison)
    monkeypatch.setattr(module, "MAX_DRAWS_TIMES_ROWS", 44 * 320)  # rows times draws
    few = loads_table(comparison)
    error = np.log(few["p_over_E_median"] / many["p_over_E_median"])
    width = np.log(many["p_over_E_upper"] / many["p_over_E_lower"]) / (2 * 1.645)
    # A median of 320 draws has a standard error of 0.07 sd; those of a curve are all of it.
    assert 1e-6 < np.abs(error / width).max() < 5 * 0.07


def test_loads__probability_inside_is_the_callers(comparison):
    with pytest.raises(rb.InputError, match="prob"):
        loads_table(comparison, prob=2.0)
    assert set(loads_table(comparison, prob=0.5, kinds=["curve"])["prob"]) == {0.5}
