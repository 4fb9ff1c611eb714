"""Files that somebody else may have made: bytes, text and HDF5, bounded before they are read.

Nothing is followed out of an HDF5 file, and a dataset costs no more memory than its numbers: HDF5
itself trusts stated sizes, makes zeros of what was never written, and unpacks a chunk to whatever
length comes out. h5py is imported where it is used: most commands read no such file.
"""

import math
import tomllib
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from stat import S_ISREG
from typing import TYPE_CHECKING, Any

from ridgebayes._types import Json
from ridgebayes.errors import InputError
from ridgebayes.runtime.text import one_line_message

if TYPE_CHECKING:
    import h5py

LARGEST = 2**31  # bytes of a file: more is not read into memory
# Bytes of TOML or JSON: more takes a parser minutes. And of a chunk of HDF5: all of it is unpacked
# for a part of it.
LARGEST_TEXT = LARGEST_CHUNK = 2**26
_MOST_OBJECTS = 10_000  # groups and datasets; a posterior has thirty
_STEP = 2**20  # bytes that are unpacked at a time, to be counted
_NO_VARIABLE = b"This is a netCDF dimension but not a netCDF variable"
_PADDED = 4 / 3  # of a chunk: gzip and checksums never make one longer than that


def read_bytes(path: Path, most: int = LARGEST) -> bytes:
    """Return the content of a file.

    Parameters
    ----------
    path : pathlib.Path
        The file.
    most : int, optional
        Bytes that it may have; 2 GiB if not given.

    Returns
    -------
    bytes

    Raises
    ------
    InputError
        If it is not there, is not a file (a device never ends, a pipe may never begin), is larger,
        or cannot be read.
    """
    try:
        about = path.stat()
        if not S_ISREG(about.st_mode):
            raise InputError(f"{path}: is not a file")
        if about.st_size > most:
            raise InputError(f"{path}: {about.st_size} bytes; expected at most {most}")
        return path.read_bytes()
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from None
    except MemoryError:
        raise InputError(f"{path}: cannot be read: not enough memory") from None


def read_text(path: Path, most: int = LARGEST) -> str:
    """Return a file's text: UTF-8 with or without a byte order mark, lines ended in any way.

    Raises
    ------
    InputError
        As `read_bytes` and `decoded`.
    """
    return decoded(read_bytes(path, most), str(path))


def decoded(content: bytes, where: str) -> str:
    """Return bytes of UTF-8 as text, without a byte order mark, lines ended by newlines.

    Raises
    ------
    InputError
        If there is a zero byte, or it is not UTF-8: with the line.
    """
    if b"\0" in content:
        line = content[: content.index(b"\0")].count(b"\n") + 1
        raise InputError(f"{where}, line {line}: a zero byte: not a text file, or not UTF-8")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        byte = f"byte {content[error.start]:#04x} is not UTF-8"
        raise InputError(f"{where}, line {line}: {byte}; expected UTF-8") from None
    return text.replace("\r\n", "\n").replace("\r", "\n")


def read_toml(path: Path) -> Json:
    """Return the tables and keys of a TOML file.

    Raises
    ------
    InputError
        As `read_text`, or if it is not TOML.
    """
    # A thousand brackets in each other: RecursionError.
    with refusing(f"{path}: not TOML", RecursionError, ValueError):
        return tomllib.loads(read_text(path, LARGEST_TEXT))


@contextmanager
def refusing(
    where: str, *kinds: type[Exception], rule: str = "", most: int = 120
) -> Iterator[None]:
    """Refuse what a library cannot read, in the library's words.

    Parameters
    ----------
    where : str
        Beginning of the messages.
    *kinds : type of Exception
        Exceptions of the library; none for any: some libraries raise exceptions of many kinds.
    rule : str, optional
        End of the messages.
    most : int, optional
        Characters of the library's words.
    """
    try:
        yield
    except InputError:
        raise
    except Exception as error:
        if kinds and not isinstance(error, kinds):
            raise
        raise InputError(f"{where}: {one_line_message(error, most)}{rule}") from None


def extra(module: str, name: str, needed: str) -> Any:
    """Return a module of an optional package.

    Parameters
    ----------
    module : str
        The module.
    name : str
        Name of the extra that installs it.
    needed : str
        Beginning of the message, such as ``t.parquet: Parquet needs pyarrow``.

    Raises
    ------
    InputError
        If it is not installed.
    """
    try:
        import_module(module.partition(".")[0])
        return import_module(module)
    except ImportError:
        raise InputError(f"{needed}: pip install 'ridgebayes[{name}]'") from None


def check_tree(file: "h5py.File", where: str) -> None:
    """Refuse a file with anything but groups and datasets of numbers and text, all of them in it.

    Parameters
    ----------
    file : h5py.File
        Open for reading.
    where : str
        Name that messages show.

    Raises
    ------
    InputError
        If it has links, virtual or external data, objects or types of other kinds, too many or too
        large datasets, or datasets of which parts are missing.
    """
    import h5py

    left, groups = LARGEST, [file["/"]]
    seen: set[int] = set()
    while groups:
        group = groups.pop()
        for key in group:
            here = f"{where}: {_shown(group.name, key)}"
            if not isinstance(group.get(key, getlink=True), h5py.HardLink):
                raise InputError(f"{here} is a link; expected none")
            item = group[key]
            place = h5py.h5o.get_info(item.id).addr
            if place in seen or len(seen) >= _MOST_OBJECTS:
                raise InputError(f"{here}: expected each object once, at most {_MOST_OBJECTS}")
            seen.add(place)
            if isinstance(item, h5py.Group):
                groups.append(item)
                continue
            check_inside(item, here, text=True)
            left -= item.size * item.dtype.itemsize
            if left < 0:
                raise InputError(f"{here} is {item.shape}; expected at most {LARGEST} bytes in all")
            if not bytes(item.attrs.get("NAME", b"")).startswith(_NO_VARIABLE):
                check_stored(item, here)


def check_inside(data: Any, where: str, *, text: bool = False) -> None:
    """Refuse what is not a dataset of plain numbers in this file.

    Parameters
    ----------
    data : h5py.Dataset
        Or anything else that stands in a file.
    where : str
        Name that messages show.
    text : bool, optional
        Whether text will do as well.

    Raises
    ------
    InputError
        If it is a group, stands in another file, or holds anything else.
    """
    import h5py

    if isinstance(data, h5py.Dataset) and not data.is_virtual and not data.external:
        kind = data.dtype
        if kind.kind in "fiu" and kind.itemsize <= 8:
            return
        if text and (kind.kind == "b" or h5py.check_string_dtype(kind) is not None):
            return
    raise InputError(f"{where}: expected a dataset of numbers, in this file")


def check_stored(data: "h5py.Dataset", where: str) -> None:
    """Refuse a dataset of which parts are not there, or one that costs more than its numbers.

    Parameters
    ----------
    data : h5py.Dataset
        In the file itself, see `check_inside`.
    where : str
        Name that messages show.

    Raises
    ------
    InputError
        If parts are missing, a chunk is too large, or it would unpack to more than it states.
    """
    import h5py

    properties = data.id.get_create_plist()
    if properties.get_layout() != h5py.h5d.CHUNKED:  # a compact one stands in its own header
        compact = properties.get_layout() == h5py.h5d.COMPACT
        if data.size and not compact and data.id.get_offset() is None:
            raise InputError(f"{where}: 0 of 1 pieces are stored; expected all of them")
        return
    size = data.dtype.itemsize * math.prod(data.chunks)
    if size > max(data.dtype.itemsize * data.size, LARGEST_CHUNK):
        raise InputError(f"{where}: a chunk of {size} bytes; expected at most {LARGEST_CHUNK}")
    there = data.id.get_num_chunks()
    pieces = math.prod(-(-n // max(m, 1)) for n, m in zip(data.shape, data.chunks, strict=True))
    if data.size and there < pieces:
        raise InputError(f"{where}: {there} of {pieces} pieces are stored; expected all of them")
    filters = [properties.get_filter(i)[0] for i in range(properties.get_nfilters())]
    if h5py.h5z.FILTER_DEFLATE in filters:
        _check_unpacked(data, filters, size, where)


def _check_unpacked(data: "h5py.Dataset", filters: list[int], size: int, where: str) -> None:
    """Refuse gzip that unpacks to more than its chunk, before HDF5 does it."""
    from h5py import h5z

    at = filters.index(h5z.FILTER_DEFLATE)
    before, after = set(filters[:at]), set(filters[at + 1 :])
    checks = {h5z.FILTER_FLETCHER32}
    if not before <= checks | {h5z.FILTER_SHUFFLE} or not after <= checks:
        raise InputError(f"{where}: filters {filters}; expected gzip with shuffle and checksums")
    most = size + 4 * len(before)

    # An exception inside HDF5's own loop becomes another error, so the checks run after it.
    chunks: list[Any] = []
    data.id.chunk_iter(chunks.append)
    for chunk in chunks:
        if chunk.size > _PADDED * size + 1024:
            packed = f"a chunk of {chunk.size} packed bytes"
            raise InputError(f"{where}: {packed}; expected at most {most}")
        mask, packed = data.id.read_direct_chunk(chunk.chunk_offset)
        if not mask >> at & 1 and not _fits(packed, most):
            unpacked = f"a chunk of over {most} bytes unpacked"
            raise InputError(f"{where}: {unpacked}; expected what the file states")


def _fits(packed: bytes, most: int) -> bool:
    unpack, n = zlib.decompressobj(), 0
    try:
        while packed and not unpack.eof:
            n += len(unpack.decompress(packed, _STEP))
            if n > most:
                return False
            packed = unpack.unconsumed_tail
    except zlib.error:
        return True  # which HDF5 refuses
    return True


def _shown(*words: str) -> str:
    return repr("/".join(words).replace("//", "/")[:80])
