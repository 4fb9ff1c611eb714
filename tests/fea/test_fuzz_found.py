"""Damaged files that were once accepted: the smallest of each kind is refused."""

import re

import h5py
import numpy as np
import pytest

from ridgebayes import InputError
from tests.fea import runs
from tests.fea.fuzzing import RUN, TARGETS, io

N = len(runs.points(RUN)[0])
VTU = TARGETS["series, VTU ascii"].content


def change(pattern, new, count=1):
    def changed(content):
        content, n = re.subn(pattern, new, content, count=count, flags=re.S)
        assert n
        return content

    return changed


def array(name, words):
    """Put other words into an array of a VTU file."""
    return change(rb'(Name="%b"[^>]*>)[^<]*' % name, lambda match: match[1] + words)


def twice(pattern):
    return change(rb"(%b)" % pattern, rb"\1\1")


def with_dataset(make):
    """Replace the first displacements of an HDF5 file."""

    def changed(content):
        content = io.BytesIO(content)
        with h5py.File(content, "r+") as file:
            make(file, file.pop("data2")[()])
        return content.getvalue()

    return changed


def of_no_type(file, values):
    space = h5py.h5s.create_simple(values.shape)
    h5py.h5d.create(file.id, b"data2", h5py.h5t.UNIX_D32LE.copy(), space)


def never_stored(chunks):
    def make(file, values):
        data = file.create_dataset("data2", values.shape, dtype="f8", chunks=chunks)
        if chunks:
            data[:20] = values[:20]

    return make


def in_large_chunks(file, values):
    file.create_dataset("data2", values.shape, dtype="f8", chunks=(2**23, 3), maxshape=(None, 3))


@pytest.mark.parametrize(
    ("name", "damage"),
    [
        # The file that is wrong is the one named.
        ("series, VTU ascii", array(b"displacement", b"nan " + b"0 " * (3 * N - 1))),
        ("series, VTU ascii", array(b"displacement", b"1e9 " + b"0 " * (3 * N - 1))),
        ("series, VTU ascii", twice(rb'<DataArray[^>]*Name="displacement".*?</DataArray>')),
        ("series", change(rb'Time Value="[^"]*"', b'Time Value="1e308"', 0)),
        ("series", change(b'Time Value="', b'Time Value="-', 0)),
        ("series", twice(rb'<Attribute Name="displacement".*?</Attribute>')),
        ("series", twice(rb"<Time [^>]*>")),
        ("series, HDF5", with_dataset(of_no_type)),
        ("series, HDF5", with_dataset(never_stored(None))),
        ("series, HDF5", with_dataset(never_stored((10, 3)))),
        ("series, HDF5", with_dataset(in_large_chunks)),
        ("calculix", change(rb"(force[^\n]*\n\n)([^\n]*\n)", rb"\1\2\2")),  # two totals
        ("calculix", change(rb"(force[^\n]*\n\n) +\S+ +\S+", rb"\1 0. -1.7e308", 0)),
        ("nodes, status", change(rb",0\n", b",inf\n")),
        ("calculix", change(rb"\n( +2 )", rb"\nQ\n\1")),  # rows lost to what is no heading
    ],
)
def test_damage__is_refused_in_words_that_name_the_file(tmp_path, name, damage):
    target = TARGETS[name]
    path = tmp_path / target.file_name
    path.write_bytes(damage(target.content))
    with pytest.raises(InputError, match=rf"\A\S.*{target.file_name}.*\S\Z"):
        target.read(path)


@pytest.mark.parametrize(
    "damages",
    [
        (
            change(rb'(Name="Points" NumberOfComponents=)"3"', rb'\1"1"'),
            array(b"Points", b" ".join([b"1"] * N)),
        ),
        (array(b"Points", b"1 1 0 " * N), array(b"displacement", b"0 " * 3 * N)),
        (
            change(b"Float32", b"Float64", 0),
            array(b"Points", b"-1.7e308 0 0 " + b"1 1 0 " * (N - 1)),
        ),
        (change(b"Float32", b"Float64", 0), array(b"Points", b"1e200 1 0 " + b"1 1 0 " * (N - 1))),
    ],
)
def test_vtu__points_of_no_disk_are_refused(tmp_path, damages):
    content = VTU
    for damage in damages:
        content = damage(content)
    files = dict.fromkeys(runs.vtus(RUN, np.float32, binary=False), content)
    with pytest.raises(InputError, match=r"\.vtu"):
        runs.imported(tmp_path, "series, VTU", run=RUN, files=files)
