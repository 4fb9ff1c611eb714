"""Edge cases of untrusted files: nothing in them is executed, and their size is limited."""

import ast
import base64
import functools
import io
import json
import os
import pickle
import re
import resource
import tempfile
import zipfile
import zlib
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path
from xml.etree import ElementTree as ET

import h5py
import numpy as np
import pandas as pd
import pytest

import ridgebayes as rb
from ridgebayes.commands.run import report_job
from ridgebayes.fea.read import import_files
from ridgebayes.fea.record import Given
from tests.hard_cases.case import hard_case, refused

SOURCE = Path(__file__).parents[2] / "src" / "ridgebayes"
GOOD = "a_over_R,b_over_R,Q,p_over_E\n0.022,0.02,4,0.002\n0.022,0.02,6,0.005\n"
_UNPACKED = 2**28
LABELS = (
    "<script>alert(1)</script>",
    "![x](http://e.vil/a.png) [c](javascript:alert(1)) | `b` **s** _e_ ~~d~~",
    "$\\input{/etc/passwd}$ $x ^_ \\frac",
    "../../x",
    "=cmd|' /C calc'!A0",
    "\u202egnp.exe \u2066\u200b字 \U0001f600 --> <!-- & \"q\" 's'",
)


class Bomb:
    """Leaves a file behind when it is unpickled."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self):
        return os.mkdir, (str(self.path),)


def bounded(call: Callable[[], object], most: int = 2**28) -> object:
    """Call with so many bytes of memory beyond what is in use: more is a MemoryError."""
    used = int(Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")
    before = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (used + most, before[1]))
    try:
        return call()
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)


@functools.cache
def sound_run() -> dict[str, bytes]:
    """The files of a quick comparison of two forms on three textures."""
    frame = rb.paper_sweep().frame
    chosen = frame["texture"].isin(frame["texture"].unique()[:3])
    with tempfile.TemporaryDirectory() as scratch:
        rb.ContactTable.from_frame(frame[chosen]).write(Path(scratch, "t.csv"))
        out = Path(scratch, "out")
        table = Path(scratch, "t.csv")
        what = {"forms": ["modified", "hybrid"], "accuracy": "quick", "command": "compare"}
        rb.run(table, out, **what)
        return {
            path.relative_to(out).as_posix(): path.read_bytes()
            for path in out.rglob("*")
            if path.is_file()
        }


def put(folder: Path, **changed: bytes) -> Path:
    """Write that run, some files of it changed."""
    folder.mkdir()
    for name, content in {**sound_run(), **changed}.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_bytes(content)
    return folder


def disk_xdmf(folder: Path, dataset: str) -> Path:
    """An XDMF series of one point that names a dataset."""
    item = f'<DataItem Dimensions="%s" Format="HDF">{dataset}</DataItem>'
    grid = (
        '<Grid Name="s"><Time Value="0.001"/><Attribute Name="displacement" Center="Node">'
        f"{item % '1 2'}</Attribute></Grid>"
    )
    text = (
        '<Xdmf Version="3.0"><Domain><Grid Name="m"><Geometry GeometryType="XY">'
        f'{item % "1 2"}</Geometry></Grid><Grid Name="t" GridType="Collection" '
        f'CollectionType="Temporal">{grid}</Grid></Domain></Xdmf>'
    )
    path = folder / "s.xdmf"
    path.write_text(text, encoding="utf-8")
    return path


def import_series(path: Path) -> object:
    return import_files([path], Given(texture=(0.02, 0.02), nu="0.5", symmetry="half"))


# --- nothing is executed --------------------------------------------------------------------------


@hard_case(
    "A pickled object in NetCDF, HDF5, Parquet, a NumPy file and a table",
    why="Unpickling runs what the file says. Readers of NumPy's object arrays, opaque HDF5 types, "
    "extension types of Parquet and the suffix .pkl do it without being asked.",
    expected="Each is refused in one line, or its bytes are kept as text. The pickle never ran.",
)
def pickles(folder):
    mark = folder / "ran"
    payload = pickle.dumps(Bomb(mark))
    run = put(folder / "run")
    path = run / "posterior-hybrid.nc"
    with h5py.File(path, "r+") as file:
        file["sample_stats"]["bomb"] = np.void(payload)
    seen = [
        refused(lambda: rb.read_run(run), rb.InputError, "posterior-hybrid.nc", "bomb", "numbers")
    ]
    with h5py.File(folder / "s.h5", "w") as file:
        file["x"] = np.array([[np.void(payload)]])
    xdmf = disk_xdmf(folder, "s.h5:/x")
    seen.append(refused(lambda: import_series(xdmf), rb.InputError, "s.h5", "a dataset of numbers"))
    np.save(folder / "t.npy", np.array([Bomb(mark)], dtype=object), allow_pickle=True)
    for suffix in (".npy", ".csv", ".parquet", ".pkl"):
        for content in ((folder / "t.npy").read_bytes(), payload):
            table = folder / f"bad{suffix}"
            table.write_bytes(content)
            for call in (
                lambda table=table: rb.read_table(table),
                lambda table=table: import_files([table], Given()),
            ):
                seen.append(refused(call, rb.InputError, f"bad{suffix}"))
    import pyarrow
    import pyarrow.parquet

    frame = pd.read_csv(io.StringIO(GOOD))
    pickled = pyarrow.array([payload] * 2, pyarrow.binary())
    table = pyarrow.Table.from_pandas(frame, preserve_index=False).append_column("x", pickled)
    field = table.schema.field("x").with_metadata(
        {
            b"ARROW:extension:name": b"arrow.py_extension_type",
            b"ARROW:extension:metadata": payload,
        }
    )
    pyarrow.parquet.write_table(
        table.set_column(4, field, pickled), folder / "t.parquet", store_schema=True
    )
    for call in (rb.read_table, lambda path: import_files([path], Given())):
        try:
            call(folder / "t.parquet")
        except rb.InputError as refusal:
            seen.append(str(refusal))
    assert not mark.exists()
    return f"{len(seen)} readings, nothing ran"


FORBIDDEN = {"eval", "exec", "compile", "__import__", "os.system", "os.popen", "yaml.load"}
FORBIDDEN |= {"pd.read_pickle", "pd.eval"}


@hard_case(
    "Neither the source code nor a run folder can execute the content of a file",
    why="One `yaml.load`, `eval` or `allow_pickle=True` is enough, and is easily added without "
    "notice.",
    expected="No call of eval, exec, os.system or yaml.load, and none with allow_pickle: np.load "
    "refuses pickles without it. Only the module of worker processes uses pickle, between "
    "processes of this package. No file of a run holds a pickle.",
)
def no_execution():
    calls, pickled = 0, set()
    for path in SOURCE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import | ast.ImportFrom):
                of = [getattr(node, "module", None) or ""]
                names = {one.name.partition(".")[0] for one in node.names} | set(of)
                assert not names & {"yaml", "marshal", "shelve", "dill", "joblib", "subprocess"}
                if names & {"pickle", "cloudpickle"}:
                    pickled.add(path.name)
            if isinstance(node, ast.Call):
                calls += 1
                assert ast.unparse(node.func) not in FORBIDDEN, (path.name, node.lineno)
                assert "allow_pickle" not in [one.arg for one in node.keywords], path.name
    assert pickled == {"pool.py"}
    for name, content in sound_run().items():
        assert not re.match(rb"\x80[\x02-\x05]", content), name
        assert b"cnumpy" not in content, name
        assert b"__reduce__" not in content, name
    return f"{calls:,} calls read; pickle in {', '.join(pickled)} only"


@hard_case(
    "Links and paths that point outside a file or a folder",
    why="HDF5 follows external links and external raw storage, XDMF names other files, and decks "
    "include them. /etc/passwd could end up in a report.",
    expected="Soft and external links, raw storage, virtual data, `..`, absolute names, symbolic "
    "links and a form named `../../x` are each refused in one line.",
)
def leading_out(folder):
    run = folder / "links"
    secret = folder / "secret.h5"
    with h5py.File(secret, "w") as file:
        file["x"] = np.zeros((1, 2))
    seen = []

    def soft(file: h5py.File) -> None:
        file["x"] = h5py.SoftLink("/posterior/sigma")

    def outside(file: h5py.File) -> None:
        file["x"] = h5py.ExternalLink(str(secret), "/x")

    def raw(file: h5py.File) -> None:
        file.create_dataset("x", (4,), "f8", external=[("/etc/passwd", 0, 32)])

    def virtual(file: h5py.File) -> None:
        layout = h5py.VirtualLayout((1, 2), "f8")
        layout[:] = h5py.VirtualSource(str(secret), "x", (1, 2))
        file.create_virtual_dataset("x", layout)

    for number, spoil in enumerate((soft, outside, raw, virtual)):
        run = put(folder / f"run{number}")
        with h5py.File(run / "posterior-hybrid.nc", "r+") as file:
            spoil(file)
        seen.append(
            refused(
                lambda run=run: rb.read_run(run),
                rb.InputError,
                "posterior-hybrid.nc: '/x'",
                "expected",
            )
        )
        with h5py.File(folder / "s.h5", "w") as file:
            spoil(file)
        xdmf = disk_xdmf(folder, "s.h5:/x")
        seen.append(refused(lambda xdmf=xdmf: import_series(xdmf), rb.InputError, "s.h5: '/x'"))
    (folder / "in").mkdir()
    (folder / "in" / "link.h5").symlink_to(secret)
    for name in ("../secret.h5", str(secret), "link.h5", "..\\secret.h5", "C:\\x.h5"):
        xdmf = disk_xdmf(folder / "in", f"{name}:/x")
        seen.append(refused(lambda xdmf=xdmf: import_series(xdmf), rb.InputError, "same folder"))
    deck = folder / "in" / "run.inp"
    (folder / "in" / "run.dat").write_text(
        " displacements (vx,vy,vz) for set RIM and time  0.1000000E+00\n", encoding="utf-8"
    )
    for name in ("../x.inp", "/etc/passwd"):
        deck.write_text(f"*INCLUDE, INPUT={name}\n", encoding="utf-8")
        given = Given(texture=(0.02, 0.02), nu="0.5", deck=deck, surface="RIM", reaction="TOP")
        call = functools.partial(import_files, [folder / "in" / "run.dat"], given)
        seen.append(refused(call, rb.InputError, "a file in the deck's own folder"))
    for form in ("../../x", "/etc/passwd", "hybrid/../../x", "\0"):
        about = json.loads(sound_run()["run.json"])
        content = json.dumps({**about, "forms": [form]}).encode()
        run = put(folder / f"form{len(seen)}", **{"run.json": content})
        seen.append(
            refused(lambda run=run: rb.read_run(run), rb.InputError, "run.json: form", "expected")
        )
    return f"{len(seen)} paths refused"


# --- what is shown --------------------------------------------------------------------------------


# Its sections and figures, the figures' files, and tables to save.
OWN_LINKS = ("#", "data:image/png;base64,", "data:image/svg+xml;base64,", "figures/")
OWN_LINKS += ("data:text/csv;charset=utf-8,", "data:application/x-tex;charset=utf-8,")


class Page(HTMLParser):
    """Elements and attributes of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: set[str] = set()
        self.n_script = 0
        self.attributes: set[str] = set()
        self.text: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.add(tag)
        self.n_script += tag == "script"
        for name, value in attrs:
            self.attributes.add(name)
            if name in ("href", "src"):
                assert value.startswith(OWN_LINKS), value

    def handle_data(self, data):
        self.text.append(data)


HTML = {"html", "head", "meta", "title", "style", "body", "header", "main", "section", "nav"}
HTML |= {"h1", "h2", "h3", "p", "a", "table", "thead", "tbody", "tr", "th", "td", "caption"}
HTML |= {"figure", "img", "figcaption", "strong", "span", "div", "ul", "li", "footer", "br"}
HTML |= {"details", "summary", "form", "fieldset", "legend", "input", "output", "button", "script"}
HTML |= {"label", "select", "option", "svg"}


@functools.cache
def hostile_run() -> tuple[str, str, dict[str, bytes]]:
    """The pages and figures of a run whose table is a stranger's, as HTML, Markdown and files."""
    frame = rb.paper_sweep().frame
    frame = frame[frame["texture"].isin(frame["texture"].unique()[:6])]
    pairs = list(dict.fromkeys(zip(frame["a_over_R"], frame["b_over_R"], strict=True)))
    names = dict(zip(pairs, LABELS, strict=True))
    frame["texture"] = [
        names[pair] for pair in zip(frame["a_over_R"], frame["b_over_R"], strict=True)
    ]
    frame["source"], frame["solver"], frame["series"] = LABELS[0], LABELS[1] + LABELS[2], LABELS[5]
    frame["=own<b>|"] = LABELS[4]
    table = rb.ContactTable.from_frame(frame)
    with tempfile.TemporaryDirectory() as scratch:
        path, out = Path(scratch, "t|`<img src=x onerror=alert(1)>$\u202e.csv"), Path(scratch, "o")
        table.write(path)
        forms = ["power-law", "modified"]
        rb.run(path, out, forms=forms, noise="iid", accuracy="quick", workers=1)
        back = rb.read_table(out / "table.csv")
        assert back.digest() == table.digest()
        assert {one.name for one in Path(scratch).iterdir()} == {path.name, "o"}
        figures = {one.name: one.read_bytes() for one in (out / "figures").iterdir()}
        figures |= {"power-law": (out / "posterior-power-law.nc").read_bytes()}
        html, markdown = (
            (out / f"report.{kind}").read_text(encoding="utf-8") for kind in ("html", "md")
        )
        return html, markdown, figures


@hard_case(
    "Scripts, event handlers and control characters in labels, then the HTML report",
    why="Labels, solvers, sources and the file's name come from the author of the table. "
    "Characters that switch to right-to-left text make one label look like another.",
    expected="The page has only its own elements and attributes, loads nothing from elsewhere, "
    "and shows labels as text. Direction characters appear as their codes. table.csv has the "
    "labels unchanged.",
)
def hostile_html():
    page = Page(hostile_run()[0])
    text = "".join(page.text)
    assert page.tags <= HTML, page.tags - HTML
    assert page.n_script == 2  # a table, and the page's own code
    assert not any(name.startswith("on") for name in page.attributes)
    for label in LABELS[:5]:
        assert label in text, label
    assert "<img src=x onerror=alert(1)>" in text
    assert "\\u202egnp.exe \\u2066\\u200b字" in text
    assert not set(text) & set(map(chr, (*range(0x202A, 0x202F), *range(0x2066, 0x206A), 0x200B)))
    return "the page's own elements only; 6 labels shown as text"


@hard_case(
    "Links, images, pipes, emphasis and HTML in labels, then the Markdown report",
    why="A pipe ends a table cell. A bracket can begin an image that loads from elsewhere. "
    "Markdown passes HTML through.",
    expected="An independent CommonMark parser finds no link, no image but the report's own "
    "figures, and no HTML but its own folds. Every row of a table is as wide as its header. Labels "
    "are text.",
)
def hostile_markdown():
    from markdown_it import MarkdownIt

    text = hostile_run()[1]
    tokens = MarkdownIt("commonmark").enable(["table", "strikethrough"]).parse(text)
    inline = [one for token in tokens for one in token.children or ()]
    kinds = {one.type for one in (*tokens, *inline)}
    bad = {"link_open", "html_inline", "s_open", "fence", "code_block"}
    assert not kinds & bad, kinds & bad
    images = [str(one.attrs["src"]) for one in inline if one.type == "image"]
    assert all(re.fullmatch(r"figures/[a-z-]+\.png", src) for src in images), images
    fold = r"<details><summary>[\w ,]+</summary>|</details>"
    folds = [one.content.strip() for one in tokens if one.type == "html_block"]
    assert all(re.fullmatch(fold, one) for one in folds), folds
    shown = "".join(one.content for one in inline if one.type == "text")
    for label in LABELS[:5]:
        assert label in shown, label
    widths, width = [], 0
    for token in tokens:
        if token.type == "tr_open":
            width = 0
        elif token.type in ("td_open", "th_open"):
            width += 1
        elif token.type == "tr_close":
            widths[-1].add(width)
        elif token.type == "table_open":
            widths.append(set())
    assert all(len(one) == 1 for one in widths)
    return f"{len(widths)} tables; {len(images)} images and {len(folds) // 2} folds of the report"


@hard_case(
    "Dollars, backslashes, ends of comments and letters without a glyph in labels, then the "
    "figures",
    why="matplotlib reads text between dollars as mathematics and fails if it cannot parse it. "
    "SVG holds labels in comments, and `-->` ends a comment. A missing glyph raises a warning.",
    expected="Every figure is drawn without a warning, is PNG or well-formed XML, and holds no "
    "script. So is the corner plot of a form with one coefficient per texture.",
)
def hostile_figures(folder):
    from ridgebayes.drawing.style import as_bytes, plain, symbol
    from ridgebayes.report.figures.gallery import corner_of

    *_, figures = hostile_run()
    path = folder / "posterior-power-law.nc"
    path.write_bytes(figures["power-law"])
    fit = rb.Fit.from_netcdf(path)
    drawn = {name: content for name, content in figures.items() if "." in name}
    drawn["corner_of.svg"] = as_bytes(corner_of(fit), "svg")
    for name, content in drawn.items():
        if name.endswith(".png"):
            assert content.startswith(b"\x89PNG")
            continue
        tags = {one.tag.rpartition("}")[2] for one in ET.fromstring(content).iter()}
        assert not tags & {"script", "a", "image", "foreignObject"} or name.startswith("corner")
        assert "script" not in tags
    odd = ["$", "$$", "a\\$b", "\\", "$\\frac{1}{$", "{}%#&_^~", "a\\", "字" * 50, "\x08\ud800"]
    from matplotlib.figure import Figure

    figure = Figure()
    axes = figure.subplots()
    for i, text in enumerate(odd):
        axes.text(0.1, i / len(odd), plain(text))
        axes.text(0.5, i / len(odd), symbol(f"K[{text}]"))
    ET.fromstring(as_bytes(figure, "svg"))
    return f"{len(drawn)} figures well-formed; {len(odd)} odd labels drawn"


# --- what is bounded ------------------------------------------------------------------------------


@hard_case(
    "HDF5 that declares 8 TB, or whose gzip chunk of 2 MB unpacks to 512 MB",
    why="HDF5 fills unwritten data with zeros. Its buffer grows to the unpacked size of a chunk, "
    "whatever size the file states.",
    expected="Refused in one line with 256 MB of free memory, both in an XDMF series and in the "
    "posterior of a run folder.",
)
def large_hdf5(folder):
    def declared(file: h5py.File) -> None:
        file.create_dataset("x", (10**6, 10**6), "f8", chunks=(1000, 1000), compression="gzip")

    def missing(file: h5py.File) -> None:
        file.create_dataset("x", (1, 2), "f8", chunks=(1, 1))

    def bomb(file: h5py.File) -> None:
        data = file.create_dataset("x", (1, 2), "f8", chunks=(1, 2), compression="gzip")
        data.id.write_direct_chunk((0, 0), packed)

    def filtered(file: h5py.File) -> None:
        file.create_dataset("x", data=np.ones((1, 2)), chunks=(1, 2), compression="lzf")

    squeeze = zlib.compressobj(1)
    zeros = bytes(2**22)
    packed = b"".join([squeeze.compress(zeros) for _ in range(128)] + [squeeze.flush()])
    assert len(packed) < 2**24
    seen = []
    for number, spoil in enumerate((declared, missing, bomb)):
        with h5py.File(folder / "s.h5", "w") as file:
            spoil(file)
        xdmf = disk_xdmf(folder, "s.h5:/x")
        call = functools.partial(bounded, functools.partial(import_series, xdmf))
        seen.append(refused(call, rb.InputError, "s.h5", "expected "))
        run = put(folder / f"run{number}")
        with h5py.File(run / "posterior-modified.nc", "r+") as file:
            spoil(file)
        call = functools.partial(bounded, functools.partial(rb.read_run, run))
        seen.append(refused(call, rb.InputError, "posterior-modified.nc: '/x'", "expected "))
    # A chunk with a sound size but packed longer than numbers can be.
    small = zlib.compress(np.ones((1, 2)).tobytes())
    with h5py.File(folder / "s.h5", "w") as file:
        packed = small
        bomb(file)
    message = refused(lambda: import_series(disk_xdmf(folder, "s.h5:/x")), rb.InputError)
    assert "unpacks" not in message  # read, and refused for being no disk
    return f"{len(seen)} refused"


@hard_case(
    "A workbook and VTU data that unpack to 256 MB, a thousand times their size",
    why="A zip file of 10 MB may hold any number of zeros and may state any size.",
    expected="Refused in one line with 64 MB of free memory, also where the stated size is wrong.",
)
def zip_bombs(folder):
    book = folder / "t.xlsx"
    with zipfile.ZipFile(book, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        archive.writestr("xl/worksheets/sheet1.xml", bytes(_UNPACKED))
    honest = book.read_bytes()
    # The same members, with a small size stated in both of its headers.
    lying = honest.replace(_UNPACKED.to_bytes(4, "little"), (1000).to_bytes(4, "little"))
    seen = []
    for content in (honest, lying):
        book.write_bytes(content)
        call = functools.partial(bounded, lambda: import_files([book], Given()), 2**26)
        seen.append(refused(call, rb.InputError, "t.xlsx"))
    header = np.array([1, 24, 0, 2**20], dtype="<u4")
    packed = zlib.compress(bytes(_UNPACKED), 9)
    header[3] = len(packed)
    text = (base64.b64encode(header.tobytes()) + base64.b64encode(packed)).decode()
    array = (
        '<DataArray type="Float64" Name="{}" NumberOfComponents="3" format="binary">{}</DataArray>'
    )
    vtu = (
        '<VTKFile type="UnstructuredGrid" compressor="vtkZLibDataCompressor">'
        '<UnstructuredGrid><Piece NumberOfPoints="1" NumberOfCells="0">'
        f"<Points>{array.format('p', text)}</Points>"
        f"<PointData>{array.format('displacement', text)}</PointData>"
        "</Piece></UnstructuredGrid></VTKFile>"
    )
    paths = [folder / "1.vtu", folder / "2.vtu"]
    for path in paths:
        path.write_text(vtu, encoding="utf-8")
    given = Given(texture=(0.02, 0.02), nu="0.5", symmetry="half", loads=(0.001, 0.002))
    call = functools.partial(bounded, lambda: import_files(paths, given), 2**26)
    seen.append(refused(call, rb.InputError, "1.vtu", "expected "))
    return f"{len(seen)} refused"


@hard_case(
    "CSV of 200,000 columns, a number of 10^7 digits, a small Parquet file of 10^8 cells",
    why="Comparing each name with all those before it takes hours. One cell may be as long as the "
    "file. Runs of one value take no space.",
    expected="Refused with the reason, in a message of under 5,000 characters, with 256 MB of "
    "free memory. Both as a table and by import.",
    long=True,
)
def wide_and_long(folder):
    import pyarrow
    import pyarrow.parquet

    wide, long, flat = (folder / name for name in ("wide.csv", "long.csv", "flat.parquet"))
    wide.write_text(",".join(f"c{i}" for i in range(200_000)) + "\n" + "0," * 199_999 + "0\n")
    long.write_text(GOOD + "0.022,0.02,8," + "9" * 10_000_000 + "\n")
    frame = pd.read_csv(io.StringIO(GOOD))
    group = {
        name: pyarrow.DictionaryArray.from_arrays(np.zeros(2**20, dtype=np.int8), values[:1])
        for name, values in frame.items()
    }
    with pyarrow.parquet.ParquetWriter(flat, pyarrow.table(group).schema) as writer:
        for _ in range(25):
            writer.write_table(pyarrow.table(group))
    assert flat.stat().st_size < 2**20
    n = 0
    for path in (wide, long, flat):
        for read in (rb.read_table, lambda path: import_files([path], Given())):
            try:
                bounded(functools.partial(read, path))
            except rb.InputError as refusal:
                n += 1
                message = str(refusal)
                assert len(message) < 5000, len(message)
                assert path.name in message, message
    assert n == 6
    return f"{n} refused"


@hard_case(
    "TOML and JSON with 10^5 nested brackets, and numbers of 10^5 digits",
    why="A recursive parser runs out of stack and raises RecursionError, which is not a "
    "ValueError. Python refuses to convert very long digit strings.",
    expected="Scene, map and run.json are each refused in one line.",
)
def deep(folder):
    brackets, digits = "[" * 100_000, "1" * 100_000
    seen = []
    for text in (f"x = {brackets}", f"x = {digits}", "[" + "a." * 20_000 + "a]"):
        path = folder / "deep.toml"
        path.write_text(text, encoding="utf-8")
        if not text.startswith("["):
            call = functools.partial(rb.Scene.from_toml, path)
            seen.append(refused(call, rb.InputError, "deep.toml"))
        table = folder / "t.csv"
        table.write_text(GOOD, encoding="utf-8")
        given = Given(map=(str(path),))
        call = functools.partial(import_files, [table], given)
        seen.append(refused(call, rb.InputError, "deep.toml"))
    with pytest.raises(
        rb.InputError, match="a = a value that is too deeply nested or too long: unknown key"
    ):
        rb.Scene.from_toml(path)
    for text in (brackets, '{"forms": ' + digits + "}"):
        run = put(folder / f"run{len(seen)}", **{"run.json": text.encode()})
        seen.append(refused(lambda run=run: rb.read_run(run), rb.InputError, "run.json: damaged"))
    return f"{len(seen)} refused"


@hard_case(
    "A device, a pipe or a file of 3 GiB in place of a table, scene, map or run file",
    why="/dev/zero never ends. A pipe may never begin. A sparse file of 3 GiB costs its sender "
    "nothing.",
    expected="Refused at once in one line; nothing is read.",
)
def endless(folder):
    names = []
    for suffix in (".csv", ".parquet", ".toml"):
        zero, pipe, large = (folder / f"{name}{suffix}" for name in ("zero", "pipe", "large"))
        zero.symlink_to("/dev/zero")
        os.mkfifo(pipe)
        with large.open("wb") as file:
            file.truncate(3 * 2**30)
        names += [zero, pipe, large]
    seen = []
    for path in names:
        for read in (
            rb.Scene.from_toml if path.suffix == ".toml" else rb.read_table,
            lambda path: import_files(
                [path] if path.suffix != ".toml" else [folder / "t.csv"],
                Given(map=(str(path),)) if path.suffix == ".toml" else Given(),
            ),
        ):
            (folder / "t.csv").write_text(GOOD, encoding="utf-8")
            seen.append(refused(functools.partial(read, path), rb.InputError, path.name))
    for name in ("run.json", "evidence.csv", "table.csv", "posterior-hybrid.nc"):
        run = put(folder / f"run-{name}")
        (run / name).unlink()
        (run / name).symlink_to("/dev/zero")
        seen.append(refused(lambda run=run: report_job(run), rb.InputError, name))
    return f"{len(seen)} refused"


@hard_case(
    "Formulas and long numbers in CSV, control characters in cells",
    why="A cell `=1+1` is a formula to a spreadsheet and text to a program. A line break in a "
    "label breaks every file that the label is written to.",
    expected="import refuses formulas and names file, line and column. A table keeps them as "
    "text, never as a number. Control characters are refused.",
)
def formulas(folder):
    path = folder / "t.csv"
    path.write_text(
        "a_over_R,b_over_R,Q,p_over_E,texture,own\n"
        "0.022,0.02,4,0.002,=1+1,=HYPERLINK(1)\n0.022,0.02,6,0.005,=1+1,@SUM(1)\n",
        encoding="utf-8",
    )
    table = rb.read_table(path)
    assert table.labels == ("=1+1",)
    assert table.frame["own"].tolist() == ["=HYPERLINK(1)", "@SUM(1)"]
    with pytest.raises(rb.InputError, match=r"not formulas: line 2 = '=1\+1'") as told:
        import_files([path], Given())
    said = [str(told.value)]
    labelled = GOOD.replace("p_over_E", "p_over_E,texture").replace("0.005", "0.005,a")
    for text, words in [
        (GOOD.replace("0.002", "=0.002"), "p_over_E = '=0.002'"),
        (labelled.replace("0.002", '0.002,"a\nb"'), "text on one line"),
        (labelled.replace("0.002", "0.002,a\x1bb"), "text on one line"),
    ]:
        path.write_text(text, encoding="utf-8")
        with pytest.raises(rb.InputError, match=words) as told:
            rb.read_table(path)
        said.append(str(told.value))
        assert "\x1b" not in said[-1]
    return f"{len(said)} refusals; formulas stay text"
