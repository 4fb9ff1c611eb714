"""Deformed meshes over load: loads of a known run, and files that are not to be trusted."""

import base64
import re
import zlib

import h5py
import numpy as np
import pytest

from ridgebayes import InputError
from ridgebayes.fea.read import import_files
from ridgebayes.fea.record import Given
from tests.fea import runs
from tests.fea.runs import imported

RUN = runs.pressed(n_node=161)
POINTS, MOVED = runs.points(RUN)
XDMF = runs.xdmf(RUN)


def swap(old, new, count=-1):
    return lambda text: text.replace(old, new, count)


def loads(folder, kind="series", change=None, files=None, **given):
    read = imported(folder, kind, change, run=RUN, files=files, **given)
    return read.table.frame["p_over_E"].to_numpy()


def test_series__line_loads_are_two_R_p(tmp_path):
    run = runs.pressed(R=8.0, E=0.06)
    times = runs.line_loads(run)
    files = {"run.xmf": runs.xdmf(run, times=times)["run.xdmf"], **runs.xdmf(run)}  # both suffixes
    read = imported(tmp_path, "series", run=run, files=files, time="line", thickness="3")
    expected = imported(tmp_path, "series", run=run, thickness="3").table.frame["p_over_E"]
    np.testing.assert_allclose(read.table.frame["p_over_E"], expected, rtol=1e-12)
    assert (
        read.table.frame["source"].str.contains(r"series: run.xmf sha256=\w{16} field=displ").all()
    )
    assert f"34 states, {241 + 7} of {len(runs.points(run)[0])} nodes are the rim" in "".join(
        read.messages
    )


def test_series__tops_that_rise_are_where_the_body_rests(tmp_path):
    run = {**RUN, "position": RUN["position"] + np.linspace(0.0, 0.05, 34)[:, None, None] * [0, 1]}
    read = imported(tmp_path, "series", run=run, top=None).table.frame
    # The rest is known to 3e-6 of R, of gaps that close by 1e-3 an increment of a tenth of a load.
    np.testing.assert_allclose(read["p_over_E"], loads(tmp_path), rtol=2e-3)


@pytest.mark.parametrize("options", [{"binary": True}, {"binary": False}, {"compression": None}])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_series__lists_of_vtu_give_the_same(tmp_path, options, dtype):
    files = runs.vtus(RUN, dtype, **options)
    # Seven digits of a displacement of 0.03, of gaps that close by 1e-3 an increment.
    np.testing.assert_allclose(
        loads(tmp_path, "series, VTU", files=files), loads(tmp_path), rtol=1e-5
    )


VTUS = dict(list(runs.vtus(RUN).items())[:2])


@pytest.mark.parametrize(
    ("n", "line", "message"),
    [
        (1, (), r"1 \.vtu with 0 loads; expected two or more"),
        (1, (0.1,), r"1 \.vtu with 1 loads; expected two or more"),
        (2, (), r"2 \.vtu with 0 loads"),
        (2, (0.1,), r"2 \.vtu with 1 loads"),
        (2, (0.1, np.nan), "load 'nan'; expected a number from 0"),
        (2, (0.1, -0.2), r"1\.vtu: load '-0\.2'; expected"),
    ],
)
def test_series__one_state_and_missing_loads_are_refused(tmp_path, n, line, message):
    with pytest.raises(InputError, match=message):
        loads(tmp_path, "series, VTU", files=dict(list(VTUS.items())[:n]), loads=line)


def block(sizes, content):
    """A compressed array that states some sizes."""
    packed = zlib.compress(content)
    head = np.array([*sizes, len(packed)], dtype="<u4").tobytes()
    return (base64.b64encode(head) + base64.b64encode(packed)).decode()


SIZE = 24 * len(POINTS)


def array(new):
    """Put new content into the array of displacements."""
    return lambda text: re.sub(r'(Name="displacement"[^>]*>)[^<]*', rf"\g<1>{new}", text)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "message"),
    [
        (array(block((1, 1 << 31, 1 << 31), b"")), "but len"),
        (array(block((1, SIZE, SIZE), b"\0" * 10**8)), "a block of"),
        (array(block((1, SIZE, SIZE), b"short")), "buffer size"),
        (array(block((2**32 - 1, 1, 1), b"")), "4294967295 blocks"),
        (array("AAAA"), "cannot be read"),
        (array("???"), "expected base64"),
        (swap("vtkZLib", "vtkLZMA"), "expected vtkZLibDataCompressor"),
        (lambda t: re.sub(r'(OfPoints=)"\d+"', r'\1"999999999"', t), "cannot be read"),
        (swap('"displacement"', '"u"'), "0 point data .*; expected one; the fields are 'u'"),
        (swap("Float64", "String"), "type 'String'"),
        (swap('format="binary"', 'format="raw"'), "expected a VTU file"),
        (lambda t: t.replace("<Piece", "<P").replace("</Piece", "</P"), "the fields are none"),
        (lambda t: t[: len(t) // 2], "expected XML"),
    ],
)
def test_series__vtu_that_states_what_it_is_not_is_refused(tmp_path, change, message):
    files = {name: change(content.decode()) for name, content in VTUS.items()}
    with pytest.raises(InputError, match=rf"\.vtu.*{message}"):
        loads(tmp_path, "series, VTU", files=files, loads=(0.001, 0.002))


def test_series__vtu_of_other_points_are_refused(tmp_path):
    other = runs.vtus({**RUN, "nodes": 1.5 * RUN["nodes"]})
    files = {**VTUS, "1.vtu": other["1.vtu"]}
    with pytest.raises(InputError, match=r"points are not those of .*0\.vtu; expected one mesh"):
        loads(tmp_path, "series, VTU", files=files, loads=(0.001, 0.002))


def refused(folder, change, message, files=XDMF):
    assert change(files["run.xdmf"].decode()) != files["run.xdmf"].decode()
    with pytest.raises(InputError, match=message):
        loads(folder, change=lambda content: change(content.decode()), files=files)


def link_to(file, name="data0"):
    """Put another dataset in place of the first."""
    return lambda text: text.replace("run.h5:/data0", f"{file}:/{name}")


BOMB = '<!DOCTYPE x [<!ENTITY a "ha"><!ENTITY b "&a;&a;">]>'


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t: BOMB + t, r"run\.xdmf, line 1: <!DOCTYPE; expected XML without it"),
        (lambda t: "\n<!doctype x>" + t, "line 2: <!DOCTYPE"),
        (swap("<Domain>", "<!ENTITY a 'b'><Domain>"), "line 1: <!ENTITY"),
        (lambda t: '<?xml version="1.0" encoding="latin-1"?>' + t, "'latin-1'; expected UTF"),
        (lambda t: t.encode("utf-16"), "UTF-8"),
        (lambda t: t.encode() + b"\xff", "0xff is not UTF-8"),
        (lambda t: t[:500], r"run\.xdmf, line 1: .*; expected XML"),
        *(
            (link_to(name), "expected FILE.h5:/PATH in the same folder")
            for name in ("/etc/passwd", "../run.h5", "C:\\run.h5", "\\\\host\\run.h5", "link.h5")
        ),
        (link_to("a" * 5000), "cannot be read"),
        (link_to("other.h5"), "no such file; move both together"),
        (swap("run.h5:/data0", "run.h5"), r"expected FILE\.h5:/PATH"),
        (link_to("run.h5", "none"), "cannot be read: .*none"),
        (link_to("run.h5", "group"), "cannot be read"),
        (link_to("run.h5", "text"), "cannot be read|not all finite|shape"),
        *(
            (link_to(f"{name}.h5"), f"{name}.h5: '/{name}' is a link; expected none")
            for name in ("soft", "external")
        ),
        *(
            (link_to(f"{name}.h5"), f"{name}.h5: '/{name}': expected a dataset of numbers, in this")
            for name in ("virtual", "raw")
        ),
        (link_to("run.h5", "small"), "of shape .*; expected"),
        (link_to("run.h5", "nan"), "not all finite"),
        (swap("run.h5:/data9", "run.h5:/huge"), r"up to 1e\+99; expected within 4 R"),
        (swap('Format="HDF"', 'Format="Binary"'), "Format 'Binary'; expected XML or"),
        (swap("<DataItem ", '<DataItem ItemType="Function" '), "one plain <DataItem>"),
        (swap('"displacement"', '"u"'), "0 point data 'displacement'; expected one"),
        (swap('Center="Node"', 'Center="Cell"'), "0 point data 'displacement'"),
        (swap('"Temporal"', '"Spatial"'), "expected an XDMF time series"),
        (lambda t: re.sub('Value="[^"]*"', 'Value="0,1"', t), "'0,1'; expected an XDMF"),
        (lambda t: re.sub('Value="[^"]*"', 'Value="nan"', t), "state 1: load 'nan'"),
        (lambda t: re.sub("<Time[^>]*>", "", t), "state 1: 0 times"),
        (swap('"XYZ"', '"VXVYVZ"'), "geometry_type 'VXVYVZ'"),
        (lambda t: "", "expected XML"),
        (lambda t: "<a/>", "expected an XDMF time series"),
    ],
)
def test_series__xdmf_that_is_not_to_be_trusted_is_refused(tmp_path, change, message):
    inside, outside = tmp_path / "inside", tmp_path / "outside.h5"
    inside.mkdir()
    shape = runs.with_z(POINTS).shape
    assert shape == (209, 3)
    with h5py.File(outside, "w") as file:
        file["data0"] = runs.with_z(POINTS)
    (inside / "link.h5").symlink_to(outside)
    layout = h5py.VirtualLayout(shape=shape, dtype=float)
    layout[:] = h5py.VirtualSource(str(outside), "data0", shape=shape)
    raw = {"dtype": float, "external": [(str(tmp_path / "raw.bin"), 0, 8 * 209 * 3)]}
    with (
        h5py.File(inside / "soft.h5", "w") as soft,
        h5py.File(inside / "external.h5", "w") as external,
        h5py.File(inside / "virtual.h5", "w") as virtual,
        h5py.File(inside / "raw.h5", "w") as stored,
    ):
        soft["soft"] = h5py.SoftLink("/data0")
        external["external"] = h5py.ExternalLink(str(outside), "/data0")
        virtual.create_virtual_dataset("virtual", layout)
        stored.create_dataset("raw", shape, **raw)
    (inside / "run.h5").write_bytes(XDMF["run.h5"])
    with h5py.File(inside / "run.h5", "a") as file:
        file["text"] = np.array([b"a"])
        file.create_group("group")
        file["nan"], file["huge"] = np.full(shape, np.nan), np.full(shape, 1e99)
        file["small"] = np.zeros((208, 3))
    refused(inside, change, message, XDMF | {"run.h5": (inside / "run.h5").read_bytes()})


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5])
def test_series__a_broken_hdf5_is_refused(tmp_path, share):
    content = XDMF["run.h5"][: int(share * len(XDMF["run.h5"]))] or b"text"
    with pytest.raises(InputError, match=r"run\.h5.*cannot be read"):
        loads(tmp_path, files=XDMF | {"run.h5": content})


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("e-0", "e-x"),
        (r"\n0\.0", r"\n0,0"),
        *((r'(Dimensions="209 3"[^>]*>)\s*\S+', rf"\1{word}") for word in ("", " 1_0")),
    ],
)
def test_series__numbers_in_the_xml_are_numbers(tmp_path, old, new):
    files = runs.xdmf(RUN, "XML")
    refused(tmp_path, lambda t: re.sub(old, new, t, count=1), "cannot be read", files)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"R": "0.5"}, "expected a disk, undeformed"),
        ({"R": "1.5"}, "surface nodes; expected at least 5"),
        ({"top": -1.3}, "no corner is reached"),
        ({"top": None, "texture": (1e-5, 0.03)}, "no rim node over the first ridge"),
        ({"loads": (1.0,)}, r"expected one .xdmf with its times"),
        ({"time": "s"}, "--time s: expected p_over_E or line"),
    ],
)
def test_series__what_contradicts_the_mesh_is_refused(tmp_path, given, message):
    with pytest.raises(InputError, match=message):
        loads(tmp_path, files=XDMF, **given)


def test_series__a_mesh_in_space_is_refused(tmp_path):
    (tmp_path / "run.h5").write_bytes(XDMF["run.h5"])
    with h5py.File(tmp_path / "run.h5", "a") as file:
        file["data0"][:, 2] = np.arange(209)
    with pytest.raises(InputError, match="expected a plane mesh"):
        loads(tmp_path, files=XDMF | {"run.h5": (tmp_path / "run.h5").read_bytes()})


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (["a.stl"], r"expected one \.xdmf with"),
        (["a.xdmf", "b.vtu"], r"expected one \.xdmf with"),
        (["a.xdmf"], "no such file"),
        (["a" * 5000 + ".xdmf"], "cannot be read|no such file"),
    ],
)
def test_series__wrong_paths_are_refused(tmp_path, names, message):
    given = Given(texture=(0.05, 0.03), nu="0.5")
    with pytest.raises(InputError, match=message):
        import_files([tmp_path / name for name in names], given, program="series")
