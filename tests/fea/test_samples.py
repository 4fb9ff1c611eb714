"""The shipped files of every kind become the tables that their READMEs promise."""

import numpy as np
import pytest

import ridgebayes as rb
from ridgebayes.fea.read import import_files
from ridgebayes.fea.record import Given
from ridgebayes.table.datafiles import CALCULIX_FE, data_path

FEA = data_path(CALCULIX_FE).parent
TEXTURE = {"texture": (0.03, 0.02), "nu": "0.49"}
PRINTED = {"deck": FEA / "calculix/ridges.inp", "surface": "NARC", "reaction": "NTOP"}
COLUMNS = {"map": (str(FEA / "tables/columns.toml"),)}
WIDE = {
    "map": ("a=Ridge width [mm]", "b=Groove width [mm]", "line=Q=*;N/m"),
    "R": "8 mm",
    "E": "60 kPa",
    "nu": "0.49",
}


@pytest.fixture(scope="module")
def shipped():
    return rb.read_table(FEA / "calculix/ridges.csv").frame


def imported(name, given, **options):
    return import_files([FEA / name], Given(**given), **options)


def test_calculix__is_the_table_beside_it(shipped):
    frame = imported("calculix/ridges.dat", TEXTURE | PRINTED).table.frame
    assert frame["source"].tolist() == shipped["source"].tolist()
    # Algebra: a least-squares circle on another machine.
    np.testing.assert_allclose(frame["p_over_E"], shipped["p_over_E"], rtol=1e-9)


@pytest.mark.slow
def test_calculix__of_the_reference_is_within_its_overlap(tmp_path):
    given = {
        "texture": (0.032, 0.01),
        "nu": "0.49",
        "deck": FEA / "calculix/texture_0.032_0.01.inp",
        "surface": "NARC",
        "reaction": "NTOP",
    }
    found = imported("calculix/texture_0.032_0.01.dat", given).table.frame
    brackets = imported("calculix/texture_0.032_0.01.dat", given | {"brackets": True}).table.frame
    reference = rb.read_table(data_path(CALCULIX_FE)).frame
    reference = reference[reference["series"] == "coarse"].iloc[: len(found)]
    reference = reference[reference["a_over_R"] == 0.032]
    assert found["Q"].tolist() == reference["Q"].tolist() == [4, 6, 8, 10]
    # Reference: corrected for the penalty's overlap, which these are not.
    off = found["p_over_E"].to_numpy() / reference["p_over_E"].to_numpy() - 1
    assert np.all(np.abs(off) < 3e-3)
    assert np.all(np.abs(off) < 1.5 * found["rel_se"])
    loads = found["p_over_E"]
    assert np.all((brackets["p_over_E_lower"] < loads) & (loads <= brackets["p_over_E"]))
    corrected = reference["p_over_E"].to_numpy()
    assert np.all((brackets["p_over_E_lower"] < corrected) & (corrected <= brackets["p_over_E"]))


def test_abaqus__layout_tells_the_same_loads(shipped):
    given = {"deck": FEA / "abaqus/ridges.inp", "surface": "RIM", "reaction": "TOP"}
    frame = imported("abaqus/ridges.dat", TEXTURE | given).table.frame
    assert frame["Q"].tolist() == shipped["Q"].tolist()
    np.testing.assert_allclose(frame["p_over_E"], shipped["p_over_E"], rtol=1e-3)  # four digits
    assert set(frame["solver"]) == {"abaqus"}


@pytest.mark.parametrize(
    ("name", "given"),
    [
        ("tables/long.csv", COLUMNS),
        ("tables/long.tsv", COLUMNS),
        ("tables/long.parquet", COLUMNS),
        ("tables/long.xlsx", COLUMNS),
        ("tables/wide.csv", WIDE),
    ],
)
def test_tables__of_other_columns_and_units_are_the_same_loads(shipped, name, given):
    frame = imported(name, given).table.frame
    assert frame["Q"].tolist() == shipped["Q"].tolist()
    assert frame[["a_over_R", "b_over_R"]].to_numpy().tolist() == [[0.03, 0.02]] * 4
    np.testing.assert_allclose(frame["p_over_E"], shipped["p_over_E"], rtol=1e-14)  # rounding


def test_series__reads_the_package_s_own_fields():
    frame = imported("series/fields-a0.03_b0.02.xdmf", TEXTURE).table.frame
    loads = rb.read_table(FEA / "series/loads.csv").frame["p_over_E"]
    np.testing.assert_allclose(frame["p_over_E"], loads, rtol=1e-12)  # rounding
    assert frame["p_over_E_lower"].tolist() == pytest.approx([0.0, frame["p_over_E"].iloc[0]])
