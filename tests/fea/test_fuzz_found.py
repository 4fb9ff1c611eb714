"""What damaged files found wrong in readers: the least of each, and what should come of it."""

import importlib.util
import re
import sys
from pathlib import Path

import h5py
import pytest

from ridgebayes.errors import InputError

if "fuzzing" not in sys.modules:
    _SPEC = importlib.util.spec_from_file_location(
        "fuzzing", Path(__file__).with_name("fuzzing.py")
    )
    sys.modules["fuzzing"] = importlib.util.module_from_spec(_SPEC)
    _SPEC.loader.exec_module(sys.modules["fuzzing"])
fuzzing = sys.modules["fuzzing"]

ASCII, BINARY, APPENDED = (
    fuzzing.TARGETS[f"series, VTU {kind}"].content for kind in ("ascii", "binary", "appended")
)
DOUBLE = ASCII.replace(b"Float32", b"Float64")
N = len(fuzzing._SERIES["points"])


def change(pattern, new, content, count=1):
    found = re.subn(pattern, new, content, count=count, flags=re.S)
    assert found[1]
    return found[0]


def array(name, words, content):
    """Put other words into an array of a VTU file."""
    return change(rb'(Name="%b"[^>]*>)[^<]*' % name, lambda found: found[1] + words, content)


def refused(name, folder, content, *, of_all=False):
    """Have a target's reader refuse content in words that name the file."""
    target = fuzzing.TARGETS[name]
    path = folder / target.file_name
    path.write_bytes(content)
    for other in (f"{k}.vtu" for k in range(len(fuzzing._STATES)) if of_all):
        (folder / other).write_bytes(content)
    with pytest.raises(InputError) as caught:
        target.read(path)
    text = str(caught.value)
    assert (".vtu" if of_all else target.file_name) in text
    assert text == text.strip()


# --- VTU ----------------------------------------------------------------------------------------


def test_vtu__points_of_one_number_are_refused(tmp_path):
    content = change(rb'(Name="Points" NumberOfComponents=)"3"', rb'\1"1"', ASCII)
    refused(
        "series, VTU ascii", tmp_path, array(b"Points", b" ".join([b"1"] * N), content), of_all=True
    )


def test_vtu__points_all_in_one_place_name_the_file(tmp_path):
    content = array(b"displacement", b"0 " * 3 * N, array(b"Points", b"1 1 0 " * N, ASCII))
    refused("series, VTU ascii", tmp_path, content, of_all=True)


@pytest.mark.parametrize("word", [b"-1.7e308 0 0 ", b"1e200 1 0 "])
def test_vtu__points_beyond_what_can_be_squared_are_refused(tmp_path, word):
    content = array(b"Points", word + b"1 1 0 " * (N - 1), DOUBLE)
    refused("series, VTU ascii", tmp_path, content, of_all=True)


@pytest.mark.parametrize("word", [b"nan", b"1e9"])
def test_vtu__the_file_that_is_wrong_is_the_one_named(tmp_path, word):
    words = word + b" " + b"0 " * (3 * N - 1)
    refused("series, VTU ascii", tmp_path, array(b"displacement", words, ASCII))


def test_vtu__two_arrays_of_one_name_are_refused(tmp_path):
    found = re.search(rb'<DataArray[^>]*Name="displacement".*?</DataArray>', ASCII, re.S)[0]
    refused("series, VTU ascii", tmp_path, ASCII.replace(found, found + found))


# --- XDMF ---------------------------------------------------------------------------------------

XDMF, TEXT = (fuzzing.TARGETS[name].content for name in ("series, XDMF", "series, XDMF of text"))
SHAPE = rb'(Dimensions=")%d( 3"[^>]*>)' % N


def test_xdmf__a_load_beyond_floats_is_refused(tmp_path):
    content = change(rb'Time Value="[^"]*"', b'Time Value="1e308"', XDMF, count=0)
    refused("series, XDMF", tmp_path, content)


def test_xdmf__loads_below_0_are_none(tmp_path):
    content = XDMF.replace(b'Time Value="', b'Time Value="-')
    refused("series, XDMF", tmp_path, content)


def test_xdmf__two_fields_of_one_name_are_refused(tmp_path):
    first, second = re.findall(rb'<Attribute Name="displacement".*?</Attribute>', XDMF, re.S)[:2]
    refused("series, XDMF", tmp_path, XDMF.replace(first, first + second))


def test_xdmf__two_times_of_a_state_are_refused(tmp_path):
    refused("series, XDMF", tmp_path, change(rb"(<Time [^>]*>)", rb"\1\1", XDMF))


@pytest.mark.parametrize("old", [b"run.h5:/data0", b'"displacement"'])
def test_xdmf__long_names_are_not_shown_whole(tmp_path, old):
    content = XDMF.replace(old, b"".join([old[:-1], b"x" * 5000, old[-1:]]))
    path = tmp_path / "run.xdmf"
    path.write_bytes(content)
    with pytest.raises(InputError) as caught:
        fuzzing.TARGETS["series, XDMF"].read(path)
    assert len(str(caught.value)) < 500 + len(str(tmp_path))


# --- HDF5 ---------------------------------------------------------------------------------------


def with_dataset(make):
    """The HDF5 file with its first displacements made anew."""
    content = fuzzing.io.BytesIO(fuzzing._H5)
    with h5py.File(content, "r+") as file:
        values = file.pop("data2")[()]
        make(file, values)
    return content.getvalue()


def test_hdf5__a_type_without_a_numpy_one_is_refused(tmp_path):
    def make(file, values):
        space = h5py.h5s.create_simple(values.shape)
        h5py.h5d.create(file.id, b"data2", h5py.h5t.UNIX_D32LE.copy(), space)

    refused("series, HDF5", tmp_path, with_dataset(make))


@pytest.mark.parametrize("chunks", [None, (10, 3)])
def test_hdf5__numbers_that_were_never_stored_are_not_zeros(tmp_path, chunks):
    def make(file, values):
        one = file.create_dataset("data2", values.shape, dtype="f8", chunks=chunks)
        if chunks:
            one[:20] = values[:20]

    refused("series, HDF5", tmp_path, with_dataset(make))


def test_hdf5__chunks_much_larger_than_the_data_are_refused(tmp_path):
    def make(file, values):
        file.create_dataset(
            "data2", values.shape, dtype="f8", chunks=(2**23, 3), maxshape=(None, 3)
        )

    refused("series, HDF5", tmp_path, with_dataset(make))


# --- contact print ------------------------------------------------------------------------------

PRINT = fuzzing.TARGETS["contact print"].content


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (rb"\n( +2 +)3(  1\.0)", rb"\n\g<1>3.5\2"),  # of a face
        (rb"\n 0\. (-\S+) 0\.\n", rb"\n 0. \1 0.\n 0. -0.02 0.\n"),  # two totals
        (rb"\n 0\. -\S+ 0\.\n", b"\n 0. -1.7e308 0.\n"),  # loads beyond floats
        (rb"\n( +2 +3  1\.0)", rb"\nQ\n\1"),  # rows lost to what is no heading
        (rb"(contact stress[^\n]*\n)", rb"\1Q"),
    ],
)
def test_contact_print__what_cannot_be_right_is_refused(tmp_path, old, new):
    count = 0 if b"e308" in new else 1
    refused("contact print", tmp_path, change(old, new, PRINT, count))
