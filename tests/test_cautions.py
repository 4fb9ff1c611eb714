import numpy as np
import pandas as pd
import pytest

import ridgebayes as rb
from ridgebayes.cautions import cautions
from ridgebayes.inference.presets import QUICK


def _compared(frame, noise="step"):
    table = rb.ContactTable.from_frame(frame)
    return rb.compare(table, rb.Modified(), noise=noise, accuracy=QUICK)


def _of_other_rows(frame, compared, noises=None):
    table, fits = rb.ContactTable.from_frame(frame), {compared.best: compared.fits[compared.best]}
    weighed = noises or set(compared.evidence["noise"])
    return cautions(table, weighed, compared.noise, fits)[compared.best]


def test_cautions__loads_that_contradict_the_prior(paper):
    frame = paper.calibration.frame
    assert _compared(frame).cautions == ()
    wrong = _compared(frame.assign(p_over_E=4 * frame["p_over_E"]))
    (told,) = wrong.cautions
    assert told.startswith("The loads contradict a prior: c of modified is 0.")
    # The prior is log-normal about 1.382 with a log-sd of 0.1: times exp(-0.2326) and exp(0.2326).
    assert "expected 1.1 to 1.74 (98 %). Check that widths are over R and loads are p/E" in told


@pytest.mark.parametrize(("factor", "shown"), [(1e-3, "0.00085"), (30, "26")])
def test_cautions__loads_in_other_units(paper, factor, shown):
    frame = paper.calibration.frame
    *high, told = _compared(frame.assign(p_over_E=factor * frame["p_over_E"])).cautions
    assert len(high) == (factor == 30)  # p/E to 0.58
    # The printed loads are 0.85 times those of eqs (3, 4) of the study, by the median of 41 rows.
    assert told == (
        f"The loads are {shown} times those that make a smooth body touch as far (Hertz, median of "
        "the rows). Check that widths are over R and loads are p/E."
    )


def test_cautions__rows_that_are_taken_as_independent(paper, tmp_path):
    compared = rb.compare(paper, rb.Modified(), noise="iid", accuracy=QUICK)
    (told,) = compared.cautions
    fit = compared.fits["modified"]
    fit.to_netcdf(tmp_path / "modified.nc")
    assert fit.cautions == rb.Fit.from_netcdf(tmp_path / "modified.nc").cautions == (told,)
    assert told.startswith("Errors of rows were taken as independent, and no other error model")


def test_cautions__rows_that_the_evidence_says_are_independent(paper):
    frame = paper.calibration.frame
    places = [frame[name].to_numpy() for name in ("Q", "a_over_R", "b_over_R")]
    errors = 0.01 * np.random.default_rng(2).standard_normal(len(frame))
    loads = rb.Modified().load(*places) * np.exp(errors)
    drawn = _compared(frame.assign(p_over_E=loads), "auto")
    assert (drawn.noise.name, drawn.cautions) == ("iid", ())
    repeated = frame.iloc[[0, 0, 1]].assign(p_over_E=[0.0011, 0.0011001, 0.0052], series=[*"aba"])
    assert not any("sds from" in sentence for sentence in _compared(repeated, "iid").cautions)
    loads[8] *= 1.3
    (told,) = _compared(frame.assign(p_over_E=loads)).cautions  # only normal errors are weighed
    assert f"The load of Q = {places[0][8]} at a/R = {places[1][8]:g}" in told


def test_cautions__of_counts_whose_loads_are_closer_than_offsets_of_steps():
    rows = {"a_over_R": 0.012, "b_over_R": 0.01, "Q": [20, 40, 42], "kind": "count"}
    loads = 1.01 * rb.Modified().load(np.array([20, 40, 42]), 0.012, 0.01)
    frame = pd.DataFrame(rows | {"p_over_E": loads})
    assert not any("counts of Q" in sentence for sentence in _compared(frame, "iid").cautions)
    *_, sentence = _compared(frame, "step").cautions
    assert sentence.startswith("2 counts of Q = 40 and more: where each step has an offset")


def test_cautions__counts_rows_that_repeat_a_load(comparison):
    table = comparison.table
    both = pd.concat([table.frame, table.calibration.frame.iloc[:5].assign(source="copy")])
    told = _of_other_rows(both, comparison)
    assert told[0].startswith("5 rows of curves whose loads are those of another source")


def test_cautions__what_no_body_can_have_is_told_with_the_worst_row(comparison, paper):
    rows = paper.calibration.frame

    def told(**columns):
        return _of_other_rows(rows.assign(**columns), comparison)

    # Widths in mm of a body of 8 mm: Q = 18 of the finest texture, 8 pitches from its groove.
    a, b = 8 * rows["a_over_R"], 8 * rows["b_over_R"]
    reach = b / 2 + (rows["Q"] / 2 - 1) * (a + b)
    words = told(a_over_R=a, b_over_R=b)
    wide = next(one for one in words if "wider than the body" in one)
    assert wide.startswith(f"{int((reach > 1).sum())} rows with a contact wider than the body")
    assert f"ends {reach.max():.2g} R from the axis. Check that widths are over R" in wide
    loads = told(p_over_E=60 * rows["p_over_E"])  # in kPa
    high = next(one for one in loads if "p/E above 0.5" in one)
    n = int((60 * rows["p_over_E"] > 0.5).sum())
    assert high.startswith(f"{n} rows with p/E above 0.5, up to 1.16: no model here holds there.")
    assert not any("wider" in one or "above" in one for one in told(rel_se=1.0))
    assert any(one.startswith("41 rows with rel_se above 1, up to 5.") for one in told(rel_se=5.0))


def test_cautions__series_that_have_no_texture_in_common(paper):
    frame = paper.calibration.frame
    of_texture = frame.groupby(["a_over_R", "b_over_R"]).ngroup().map("rig {}".format)
    compared = _compared(frame.assign(series=of_texture), "series")

    def told(frame, noises=None):
        return " ".join(_of_other_rows(frame, compared, noises))

    words = "No texture has rows of two series (sources, where no series is named)."
    assert told(frame.assign(series=of_texture)).startswith(words)
    assert told(frame.assign(source=of_texture)).startswith(words)
    assert words not in told(frame.assign(series=of_texture.mask(frame.index == 0, "rig 3")))
    assert words not in told(frame.assign(series=of_texture), {"step"})


def test_cautions__are_warned_of_in_python_once_and_kept(paper):
    with pytest.warns(rb.CautionWarning, match="taken as independent") as caught:
        fit = rb.calibrate(paper, rb.Modified(), noise="iid")
    assert fit.cautions == tuple(str(warning.message) for warning in caught)
    assert caught[0].filename == __file__
    with pytest.warns(rb.CautionWarning) as caught:
        compared = rb.compare(paper, "modified", noise="iid", accuracy="quick")
    assert compared.cautions == fit.cautions == tuple(str(one.message) for one in caught)
    assert rb.calibrate(paper, rb.Modified(), noise="step", accuracy="quick").cautions == ()
