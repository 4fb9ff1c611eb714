"""What damaged files found wrong in readers: the least of each, and what should come of it."""

import base64
import importlib.util
import re
import sys
import zlib
from pathlib import Path

import h5py
import numpy as np
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


def test_vtu__no_points_are_refused(tmp_path):
    content = change(rb'NumberOfPoints="\d+"', b'NumberOfPoints="0"', ASCII)
    content = array(b"displacement", b"", array(b"Points", b"", content))
    refused("series, VTU ascii", tmp_path, content, of_all=True)


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


def test_vtu__numbers_beyond_single_precision_are_refused(tmp_path):
    words = b"1e39 " + b"0 " * (3 * N - 1)
    refused("series, VTU ascii", tmp_path, array(b"displacement", words, ASCII))


@pytest.mark.parametrize("name", [b"Points", b"displacement"])
def test_vtu__an_empty_array_is_refused(tmp_path, name):
    refused("series, VTU binary", tmp_path, array(name, b"", BINARY))


def test_vtu__a_byte_order_that_is_none_is_refused(tmp_path):
    refused("series, VTU binary", tmp_path, BINARY.replace(b"LittleEndian", b"Bigendian"))


@pytest.mark.parametrize(
    ("kind", "head"),
    [
        (b"Float64", np.array([np.inf])),
        (b"String", np.array([24 * N], "<u4")),
        (b"Int32", np.array([24 * N], "<i4")),
    ],
)
def test_vtu__a_header_that_does_not_count_bytes_is_refused(tmp_path, kind, head):
    content = BINARY.replace(b"byte_order=", b'header_type="%b" byte_order=' % kind)
    points = fuzzing._in_space(fuzzing._SERIES["points"]).tobytes()
    words = base64.b64encode(head.tobytes() + points)
    refused("series, VTU binary", tmp_path, array(b"Points", words, content))


def test_vtu__a_number_of_blocks_below_0_is_refused(tmp_path):
    content = APPENDED.replace(b"byte_order=", b'header_type="Int32" byte_order=')
    content = re.sub(rb'format="appended" offset="\d+"', b'format="binary"', content)
    words = base64.b64encode(np.array([-1, -24 * N, 0], dtype="<i4").tobytes())
    refused("series, VTU appended", tmp_path, array(b"Points", words, content))


def test_vtu__a_block_without_its_checksum_is_refused(tmp_path):
    plain = fuzzing._in_space(fuzzing._SERIES["moved"][fuzzing._HIT]).tobytes()
    packed = zlib.compress(plain)[:-4]
    head = np.array([1, len(plain), 0, len(packed)], dtype="<u4").tobytes()
    words = base64.b64encode(head) + base64.b64encode(packed)
    content = change(
        rb'(Name="displacement"[^>]*)format="appended" offset="\d+"',
        rb'\1format="binary"',
        APPENDED,
    )
    refused("series, VTU appended", tmp_path, array(b"displacement", words, content))


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


def test_xdmf__no_points_are_refused(tmp_path):
    content = change(SHAPE + rb"[^<]*", rb"\g<1>0\2", TEXT, count=0)
    refused("series, XDMF of text", tmp_path, content)


@pytest.mark.parametrize("more", [b"1 " * 70, b"0 " + b"9999999 " * 40])
def test_xdmf__dimensions_beyond_an_array_s_are_refused(tmp_path, more):
    words = b"" if more.startswith(b"0") else rb"\3"
    content = change(SHAPE + rb"([^<]*)", rb"\g<1>" + more + rb"%d\2" % N + words, TEXT)
    refused("series, XDMF of text", tmp_path, content)


def test_xdmf__numbers_beyond_single_precision_are_refused(tmp_path):
    content = change(rb'(displacement".*?)Precision="8">\s*\S+', rb'\1Precision="4">1e39', TEXT)
    refused("series, XDMF of text", tmp_path, content)


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


def test_xdmf__a_file_name_that_is_too_long_is_told_of_the_series(tmp_path):
    refused("series, XDMF", tmp_path, XDMF.replace(b"run.h5:", b"a" * 5000 + b":"))


@pytest.mark.parametrize("old", [b"run.h5:/data0", b'"displacement"'])
def test_xdmf__long_names_are_not_shown_whole(tmp_path, old):
    content = XDMF.replace(old, b"".join([old[:-1], b"x" * 5000, old[-1:]]))
    path = tmp_path / "run.xdmf"
    path.write_bytes(content)
    with pytest.raises(InputError) as caught:
        fuzzing.TARGETS["series, XDMF"].read(path)
    assert len(str(caught.value)) < 500 + len(str(tmp_path))


def test_xdmf__a_geometry_of_elements_in_elements_is_refused(tmp_path):
    content = change(rb"(<Geometry[^>]*>)", rb"\1" + b"<a>" * 5000 + b"</a>" * 5000, XDMF)
    refused("series, XDMF", tmp_path, content)


def test_xdmf__a_message_ends_in_words(tmp_path):
    refused("series, XDMF", tmp_path, XDMF.replace(b'Name="displacement"', b'Name=" "', 1))


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


def test_hdf5__numbers_in_a_header_are_read(tmp_path):
    def make(file, values):
        plain = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        plain.set_layout(h5py.h5d.COMPACT)
        space = h5py.h5s.create_simple(values.shape)
        kind = h5py.h5t.NATIVE_DOUBLE
        h5py.h5d.create(file.id, b"data2", kind, space, dcpl=plain).write(
            h5py.h5s.ALL, h5py.h5s.ALL, np.ascontiguousarray(values)
        )

    target = fuzzing.TARGETS["series, HDF5"]
    path = tmp_path / target.file_name
    path.write_bytes(with_dataset(make))
    rows = fuzzing._rows(target.read(path))
    np.testing.assert_array_equal(rows, fuzzing._clean("series, HDF5")[3])


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


# --- mappings -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "content",
    [
        b"[values]\nR = 0x" + b"f" * 4000,
        b"[columns]\na = 0x" + b"f" * 4000,
        b"[values]\n" + b".".join([b"a"] * 3000) + b" = 1",
    ],
)
def test_map__values_that_cannot_be_printed_are_refused(tmp_path, content):
    refused("map", tmp_path, content)


def test_map__quantities_of_thousands_of_digits_are_refused(tmp_path):
    content = b'[values]\nR = "%b mm"\nE = "60 kPa"\n' % (b"9" * 5000)
    columns = fuzzing._MAP_TOML.partition(b"[values]")[0]
    refused("map, used", tmp_path, columns + content)
