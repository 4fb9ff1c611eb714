"""Deformed meshes over load: loads of a known run, and files that are not to be trusted."""

import base64
import os
import re
import runpy
import zlib
from pathlib import Path
from types import SimpleNamespace

import h5py
import meshio
import numpy as np
import pytest
from meshio.xdmf import TimeSeriesWriter

from ridgebayes.contact.cylinder.cylinder import Cylinder
from ridgebayes.contact.cylinder.fields import write_fields
from ridgebayes.contact.rigid_profile import Profile
from ridgebayes.errors import InputError
from ridgebayes.fea.history import RunBody
from tests.fea.runs import read_series

WRITER = SimpleNamespace(**runpy.run_path(str(Path(__file__).with_name("abaqus_writer.py"))))


def pressed(**options):
    """The known run with its rim to the mid-plane, nodes inside, and the same loads."""
    run = WRITER.pressed(n_node=161, **options)
    full = bool((run["nodes"][:, 0] < 0).any())
    outer = np.linspace(0.9, np.pi / 2, 8)[1:]
    angle = np.concatenate([-outer, outer]) if full else outer
    more = run["R"] * np.column_stack([np.sin(angle), -np.cos(angle)])
    inside = 0.5 * run["nodes"][::4]
    points = np.vstack([run["nodes"], more, inside])
    still = np.zeros((len(run["force"]), len(more) + len(inside), 2))
    moved = np.concatenate([run["position"] - run["nodes"], still], axis=1)
    load = run["force"] * (1 if full else 2) / (2 * run["R"] * run["E"])
    return {**run, "points": points, "moved": moved, "p": load, "full": full}


RUN = pressed()
BODY = RunBody(RUN["a"], RUN["b"], top=RUN["top"])


def with_z(plane):
    return np.column_stack([plane, np.zeros(len(plane))])


def mesh(run, k=0, name="displacement", dtype=float):
    n = len(run["points"])
    cells = [("line", np.column_stack([np.arange(n - 1), np.arange(1, n)]))]
    data = {name: with_z(run["moved"][k]).astype(dtype)}
    return with_z(run["points"]), cells, data


def write(folder, run=RUN, data_format="HDF", times=None, name="displacement"):
    folder.mkdir(exist_ok=True)
    here = Path.cwd()
    os.chdir(folder)  # the writer puts its .h5 into the current folder
    try:
        with TimeSeriesWriter("run.xdmf", data_format=data_format) as writer:
            points, cells, _ = mesh(run)
            writer.write_points_cells(points, cells)
            for k, p in enumerate(run["p"] if times is None else times):
                writer.write_data(float(p), point_data=mesh(run, k, name)[2])
    finally:
        os.chdir(here)
    return folder / "run.xdmf"


def frame(*args, **options):
    return read_series(*args, **options).table.frame


@pytest.mark.parametrize("data_format", ["HDF", "XML"])
@pytest.mark.parametrize("full", [False, True])
def test_read_series__finds_the_loads_in_files_of_meshio(tmp_path, data_format, full):
    run = pressed(full=full, R=8.0, E=0.06)
    body = RunBody(run["a"], run["b"], E=0.06, top=run["top"], symmetry="full" if full else "half")
    done = read_series(write(tmp_path, run, data_format), body)
    found = done.table.frame
    assert found["Q"].tolist() == [4, 6, 8]
    np.testing.assert_allclose(found["p_over_E"], run["load"], rtol=6e-3)  # second order
    assert (np.abs(found["p_over_E"] / run["load"] - 1) < 3 * found["rel_se"]).all()
    rim = 161 + 7 if not full else 321 + 14
    assert f"34 states, {rim} of {len(run['points'])} nodes are the rim" in done.messages[0]
    assert found["source"].str.contains(r"series: run.xdmf sha256=\w{16} field=displ").all()


def test_read_series__line_loads_are_two_R_p(tmp_path):
    run = pressed(R=8.0, E=0.06)
    path = write(tmp_path, run, times=2 * 8.0 * 0.06 * run["p"])
    path = path.rename(path.with_suffix(".xmf"))  # the other suffix of XDMF
    body = RunBody(run["a"], run["b"], E=0.06, top=run["top"], thickness=3.0)
    found = frame(path, body, time="line")
    expected = frame(write(tmp_path / "b", run), body)
    np.testing.assert_allclose(found["p_over_E"], expected["p_over_E"], rtol=1e-12)


def test_read_series__tops_that_rise_are_where_the_body_rests(tmp_path):
    run = {**RUN, "moved": RUN["moved"].copy()}
    run["moved"][:, :, 1] += np.linspace(0.0, 0.05, 34)[:, None]
    found = frame(write(tmp_path, run), RunBody(RUN["a"], RUN["b"]))
    expected = frame(write(tmp_path / "b"), BODY)
    # The rest is known to 3e-6 of R, of gaps that close by 1e-3 an increment of a tenth of a load.
    np.testing.assert_allclose(found["p_over_E"], expected["p_over_E"], rtol=2e-3)


@pytest.mark.slow
def test_read_series__the_packages_own_file_imports(tmp_path):
    a, b = 0.06, 0.02
    cylinder = Cylinder(Profile(a, b), p_max=0.01, edges=8)
    reached = [one for one, _ in zip(cylinder.transitions(0.02), range(2), strict=False)]
    write_fields(cylinder, [one.state for one in reached], tmp_path / "fields.xdmf")
    found = frame(tmp_path / "fields.xdmf", RunBody(a, b))
    assert found["Q"].tolist() == [one.Q for one in reached]
    # Two states, each at a transition: nothing to extrapolate from, and each ends its bracket.
    loads = [one.p_over_E for one in reached]
    np.testing.assert_allclose(found["p_over_E"], loads, rtol=1e-12)
    np.testing.assert_allclose(found["p_over_E_lower"], [0.0, loads[0]], rtol=1e-12)


@pytest.mark.parametrize("options", [{"binary": True}, {"binary": False}, {"compression": None}])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_read_series__lists_of_vtu_give_the_same(tmp_path, options, dtype):
    paths = []
    for k in range(len(RUN["p"])):
        points, cells, data = mesh(RUN, k, dtype=dtype)
        paths.append(tmp_path / f"{k}.vtu")
        meshio.vtu.write(paths[-1], meshio.Mesh(points, cells, point_data=data), **options)
    found = frame(paths, BODY, loads=RUN["p"].tolist())
    expected = frame(write(tmp_path / "x"), BODY)
    # Seven digits of a displacement of 0.03, of gaps that close by 1e-3 an increment.
    np.testing.assert_allclose(found["p_over_E"], expected["p_over_E"], rtol=1e-5)


def vtu(folder, change=lambda text: text, **options):
    folder.mkdir(exist_ok=True)
    paths = [folder / "0.vtu", folder / "1.vtu"]
    for k, path in enumerate(paths):
        points, cells, data = mesh(RUN, k)
        meshio.vtu.write(path, meshio.Mesh(points, cells, point_data=data), **options)
        path.write_text(change(path.read_text()))
    return paths


@pytest.mark.parametrize(
    ("paths", "loads", "message"),
    [
        (1, None, r"1 \.vtu with 0 loads; expected two or more"),
        (1, [0.1], r"1 \.vtu with 1 loads; expected two or more"),
        (2, None, r"2 \.vtu with 0 loads"),
        (2, [0.1], r"2 \.vtu with 1 loads"),
        (2, [0.1, np.nan], "load 'nan'; expected a number from 0"),
        (2, [0.1, -0.2], r"1\.vtu: load '-0\.2'; expected"),
    ],
)
def test_read_series__one_state_and_missing_loads_are_refused(tmp_path, paths, loads, message):
    with pytest.raises(InputError, match=message):
        read_series(vtu(tmp_path)[:paths], BODY, loads=loads)


def block(sizes, content):
    """A compressed array that states some sizes."""
    packed = zlib.compress(content)
    head = np.array([*sizes, len(packed)], dtype="<u4").tobytes()
    return (base64.b64encode(head) + base64.b64encode(packed)).decode()


SIZE = 24 * len(RUN["points"])
ARRAY = r'(Name="displacement"[^>]*>)[^<]*'


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t: re.sub(ARRAY, r"\g<1>" + block((1, 1 << 31, 1 << 31), b""), t), "but len"),
        (
            lambda t: re.sub(ARRAY, r"\g<1>" + block((1, SIZE, SIZE), b"\0" * 10**8), t),
            "a block of",
        ),
        (lambda t: re.sub(ARRAY, r"\g<1>" + block((1, SIZE, SIZE), b"short"), t), "buffer size"),
        (lambda t: re.sub(ARRAY, r"\g<1>" + block((2**32 - 1, 1, 1), b""), t), "4294967295 blocks"),
        (lambda t: re.sub(ARRAY, r"\g<1>AAAA", t), "cannot be read"),
        (lambda t: re.sub(ARRAY, r"\g<1>???", t), "expected base64"),
        (lambda t: t.replace("vtkZLib", "vtkLZMA"), "expected vtkZLibDataCompressor"),
        (
            lambda t: re.sub(r'NumberOfPoints="\d+"', 'NumberOfPoints="999999999"', t),
            "cannot be read",
        ),
        (
            lambda t: t.replace('"displacement"', '"u"'),
            "0 point data 'displacement'; expected one; the fields are 'u'",
        ),
        (lambda t: t.replace("Float64", "String"), "type 'String'"),
        (
            lambda t: t.replace('format="binary"', 'format="raw"'),
            "expected a VTU file",
        ),
        (lambda t: t.replace("<Piece", "<P").replace("</Piece", "</P"), "the fields are none"),
        (lambda t: t[: len(t) // 2], "expected XML"),
    ],
)
def test_read_series__vtu_that_states_what_it_is_not_is_refused(tmp_path, change, message):
    with pytest.raises(InputError, match=rf"\.vtu.*{message}"):
        read_series(vtu(tmp_path, change), BODY, loads=[0.001, 0.002])


def test_read_series__vtu_of_other_points_are_refused(tmp_path):
    paths = vtu(tmp_path)
    points, cells, data = mesh(RUN, 1)
    meshio.vtu.write(paths[1], meshio.Mesh(1.5 * points, cells, point_data=data))
    with pytest.raises(InputError, match=r"points are not those of .*0\.vtu; expected one mesh"):
        read_series(paths, BODY, loads=[0.001, 0.002])


def refused(path, change, message):
    text = path.read_text()
    new = change(text)
    assert new != text
    path.write_bytes(new.encode() if isinstance(new, str) else new)
    with pytest.raises(InputError, match=message):
        read_series(path, BODY)


BOMB = '<!DOCTYPE x [<!ENTITY a "ha"><!ENTITY b "&a;&a;">]>'


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t: BOMB + t, r"run\.xdmf, line 1: <!DOCTYPE; expected XML without it"),
        (lambda t: "\n<!doctype x>" + t, "line 2: <!DOCTYPE"),
        (lambda t: t.replace("<Domain>", "<!ENTITY a 'b'><Domain>"), "line 1: <!ENTITY"),
        (
            lambda t: '<?xml version="1.0" encoding="latin-1"?>' + t,
            "encoding 'latin-1'; expected UTF",
        ),
        (lambda t: t.encode("utf-16"), "UTF-8"),
        (lambda t: t.encode() + b"\xff", "0xff is not UTF-8"),
        (lambda t: t[:500], r"run\.xdmf, line 1: .*; expected XML"),
        (
            lambda t: t.replace("run.h5:", "/etc/passwd:"),
            "expected FILE.h5:/PATH in the same folder",
        ),
        (lambda t: t.replace("run.h5:", "../run.h5:"), "expected FILE.h5:/PATH in the same folder"),
        (
            lambda t: t.replace("run.h5:", "C:\\run.h5:"),
            "expected FILE.h5:/PATH in the same folder",
        ),
        (
            lambda t: t.replace("run.h5:", "\\\\host\\run.h5:"),
            "expected FILE.h5:/PATH in the same folder",
        ),
        (lambda t: t.replace("run.h5:", "link.h5:"), "expected FILE.h5:/PATH in the same folder"),
        (lambda t: t.replace("run.h5:", "a" * 5000 + ":"), "cannot be read"),
        (lambda t: t.replace("run.h5:", "other.h5:"), "no such file; move both together"),
        (lambda t: t.replace("run.h5:/data0", "run.h5"), r"expected FILE\.h5:/PATH"),
        (lambda t: t.replace("run.h5:/data0", "run.h5:/none"), "'/none' is no dataset"),
        (
            lambda t: t.replace("run.h5:/data0", "run.h5:/soft"),
            "'/soft' is no dataset, or is behind a link",
        ),
        (
            lambda t: t.replace("run.h5:/data0", "run.h5:/external"),
            "'/external' is no dataset, or is behind a link",
        ),
        (lambda t: t.replace("run.h5:/data0", "run.h5:/virtual"), "expected a dataset of numbers"),
        (lambda t: t.replace("run.h5:/data0", "run.h5:/raw"), "expected a dataset of numbers"),
        (lambda t: t.replace("run.h5:/data0", "run.h5:/text"), "expected a dataset of numbers"),
        (lambda t: t.replace("run.h5:/data0", "run.h5:/group"), "expected a dataset of numbers"),
        (lambda t: t.replace("run.h5:/data0", "run.h5:/data1"), "is .*; expected "),
        (lambda t: t.replace("run.h5:/data0", "run.h5:/nan"), "not all finite"),
        (
            lambda t: t.replace("run.h5:/data9", "run.h5:/huge"),
            r"up to 1e\+99; expected within 4 R",
        ),
        (
            lambda t: re.sub('Dimensions="209 3"', 'Dimensions="9999999999 3"', t),
            "at most 2147483648",
        ),
        (lambda t: re.sub('Dimensions="209 3"', 'Dimensions="-8 3"', t), "Dimensions '-8 3'"),
        (lambda t: re.sub('Dimensions="209 3"', 'Dimensions="1,5"', t), "Dimensions '1,5'"),
        (
            lambda t: t.replace('Format="HDF"', 'Format="Binary"'),
            "Format 'Binary'; expected XML or",
        ),
        (
            lambda t: t.replace("<DataItem ", '<DataItem ItemType="Function" '),
            "one plain <DataItem>",
        ),
        (lambda t: t.replace('"displacement"', '"u"'), "0 point data 'displacement'; expected one"),
        (lambda t: t.replace('Center="Node"', 'Center="Cell"'), "0 point data 'displacement'"),
        (lambda t: t.replace('"Temporal"', '"Spatial"'), "expected an XDMF time series"),
        (
            lambda t: re.sub('Value="[^"]*"', 'Value="0,1"', t),
            "'0,1'; expected an XDMF",
        ),
        (lambda t: re.sub('Value="[^"]*"', 'Value="nan"', t), "state 1: load 'nan'"),
        (lambda t: re.sub("<Time[^>]*>", "", t), "state 1: 0 times"),
        (lambda t: t.replace('"XYZ"', '"VXVYVZ"'), "geometry_type 'VXVYVZ'"),
        (lambda t: "", "expected XML"),
        (lambda t: "<a/>", "expected an XDMF time series"),
    ],
)
def test_read_series__xdmf_that_is_not_to_be_trusted_is_refused(tmp_path, change, message):
    path = write(tmp_path / "inside")
    outside = tmp_path / "outside.h5"
    with h5py.File(outside, "w") as file:
        file["data0"] = with_z(RUN["points"])
    (tmp_path / "inside" / "link.h5").symlink_to(outside)
    shape = with_z(RUN["points"]).shape
    assert shape == (209, 3)
    with h5py.File(tmp_path / "inside" / "run.h5", "a") as file:
        file["soft"] = h5py.SoftLink("/data0")
        file["external"] = h5py.ExternalLink(str(outside), "/data0")
        layout = h5py.VirtualLayout(shape=shape, dtype=float)
        layout[:] = h5py.VirtualSource(str(outside), "data0", shape=shape)
        file.create_virtual_dataset("virtual", layout)
        raw = [(str(tmp_path / "raw.bin"), 0, 8 * 209 * 3)]
        file.create_dataset("raw", shape, dtype=float, external=raw)
        file["text"] = np.array([b"a"])
        file.create_group("group")
        file["nan"], file["huge"] = np.full(shape, np.nan), np.full(shape, 1e99)
    refused(path, change, message)


def test_read_series__a_broken_hdf5_is_refused(tmp_path):
    path = write(tmp_path)
    content = (tmp_path / "run.h5").read_bytes()
    for part in (b"", b"text", content[:1000], content[: len(content) // 2]):
        (tmp_path / "run.h5").write_bytes(part)
        with pytest.raises(InputError, match=r"run\.h5.*cannot be read"):
            read_series(path, BODY)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t: t.replace("e-0", "e-x", 1), "expected numbers between blanks"),
        (lambda t: re.sub(r"\n0\.0", r"\n0,0", t, count=1), "expected numbers between blanks"),
        (
            lambda t: re.sub(r'(Dimensions="209 3"[^>]*>)\s*\S+', r"\1", t, count=1),
            "cannot be read",
        ),
        (lambda t: re.sub(r'(Dimensions="209 3"[^>]*>)\s*\S+', r"\1 1_0", t, count=1), "numbers b"),
    ],
)
def test_read_series__numbers_in_the_xml_are_numbers(tmp_path, change, message):
    refused(write(tmp_path, data_format="XML"), change, message)


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ({"R": 0.5}, "expected a disk, undeformed"),
        ({"R": 1.5}, "surface nodes; expected at least 5"),
        ({"symmetry": "full"}, "--symmetry half"),
        ({"top": -1.3}, "no corner is reached"),
        ({"top": None, "a_over_R": 1e-5}, "no rim node over the first ridge"),
    ],
)
def test_read_series__what_contradicts_the_mesh_is_refused(tmp_path, body, message):
    given = {"a_over_R": RUN["a"], "b_over_R": RUN["b"], "top": RUN["top"], **body}
    with pytest.raises(InputError, match=message):
        read_series(write(tmp_path), RunBody(**given))


def test_read_series__a_mesh_in_space_is_refused(tmp_path):
    path = write(tmp_path)
    with h5py.File(tmp_path / "run.h5", "a") as file:
        file["data0"][:, 2] = np.arange(209)
    with pytest.raises(InputError, match="expected a plane mesh"):
        read_series(path, BODY)


@pytest.mark.parametrize(
    ("names", "options", "message"),
    [
        (["a.stl"], {}, r"expected one \.xdmf with"),
        (["a.xdmf", "b.xdmf"], {}, r"expected one \.xdmf with"),
        (["a.xdmf", "b.vtu"], {}, r"expected one \.xdmf with"),
        (["a.xdmf"], {}, "no such file"),
        (["a" * 5000 + ".xdmf"], {}, "cannot be read|no such file"),
        (["a.xdmf"], {"loads": [1.0]}, "expected one .xdmf with its times"),
        (["a.xdmf"], {"time": "s"}, "--time s: expected p_over_E or line"),
    ],
)
def test_read_series__wrong_paths_and_options_are_refused(tmp_path, names, options, message):
    with pytest.raises(InputError, match=message):
        read_series([tmp_path / name for name in names], BODY, **options)
