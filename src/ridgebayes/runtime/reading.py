"""Reading of untrusted files: bytes, text and HDF5, with limits that are checked first.

Links out of an HDF5 file are refused, and a dataset takes no more memory than its numbers. HDF5
itself trusts stated sizes, fills missing data with zeros, and unpacks a chunk to any length. h5py
is imported where it is used, because most commands read no HDF5 file.
"""

import math
import tomllib
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path
from stat import S_ISREG
from typing import TYPE_CHECKING, Any

from ridgebayes._types import Json
from ridgebayes.errors import InputError
from ridgebayes.runtime.text import one_line_message

if TYPE_CHECKING:
    import h5py

_MEBIBYTE = 2**20  # bytes
LARGEST = 2048 * _MEBIBYTE  # of a file that is read into memory
# Bytes of TOML or JSON, which would take minutes to parse above it; and bytes of an HDF5 chunk,
# which is always unpacked as a whole.
LARGEST_TEXT = LARGEST_CHUNK = 64 * _MEBIBYTE
_MAX_OBJECTS = 10_000  # groups and datasets; a posterior has thirty
_NO_VARIABLE = b"This is a netCDF dimension but not a netCDF variable"


def read_bytes(path: Path, most: int = LARGEST) -> bytes:
    """Return the content of a file.

    Parameters
    ----------
    path : pathlib.Path
        File to read.
    most : int, optional
        Maximum number of bytes; 2 GiB if not given.

    Returns
    -------
    bytes

    Raises
    ------
    InputError
        If the path does not exist, is not a regular file (a device never ends, and a pipe may
        never begin), is too large, or cannot be read.
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
    """Return the text of a file in UTF-8, with or without byte order mark, with any newlines.

    Raises
    ------
    InputError
        See `read_bytes` and `decoded`.
    """
    return decoded(read_bytes(path, most), str(path))


def decoded(content: bytes, where: str) -> str:
    """Return UTF-8 bytes as text without byte order mark, with newlines converted.

    Raises
    ------
    InputError
        If the bytes contain a zero or are not UTF-8; the message has the line.
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
        If the file cannot be read as text, or is not TOML.
    """
    # A thousand nested brackets raise RecursionError.
    with refusing(f"{path}: not TOML", RecursionError, ValueError):
        return tomllib.loads(read_text(path, LARGEST_TEXT))


@contextmanager
def refusing(
    where: str, *kinds: type[Exception], rule: str = "", most: int = 120
) -> Iterator[None]:
    """Convert exceptions of a library to `InputError`, with the library's message.

    Parameters
    ----------
    where : str
        Beginning of the message.
    *kinds : type of Exception
        Exceptions of the library; if none are given, all exceptions are converted.
    rule : str, optional
        End of the message.
    most : int, optional
        Maximum number of characters of the library's message.
    """
    try:
        yield
    except Exception as error:
        if isinstance(error, InputError) or (kinds and not isinstance(error, kinds)):
            raise
        raise InputError(f"{where}: {one_line_message(error, most)}{rule}") from None


def extra(module: str, name: str, needed: str) -> Any:
    """Return a module of an optional package.

    Parameters
    ----------
    module : str
        Name of the module.
    name : str
        Name of the extra that installs it.
    needed : str
        Beginning of the message, such as ``t.parquet: Parquet needs pyarrow``.

    Raises
    ------
    InputError
        If the module is not installed.
    """
    try:
        import_module(module.partition(".")[0])
        return import_module(module)
    except ImportError:
        raise InputError(f"{needed}: pip install 'ridgebayes[{name}]'") from None


def check_tree(file: "h5py.File", where: str) -> None:
    """Refuse an HDF5 file with other content than groups and datasets of numbers and text.

    Parameters
    ----------
    file : h5py.File
        File open for reading.
    where : str
        Name for messages.

    Raises
    ------
    InputError
        If it has links, virtual or external data, unknown objects or types, too many or too large
        datasets, or incomplete datasets.
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
            if place in seen or len(seen) >= _MAX_OBJECTS:
                raise InputError(f"{here}: expected each object once, at most {_MAX_OBJECTS}")
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
    """Refuse an object that is not a dataset of numbers stored in this file.

    Parameters
    ----------
    data : h5py.Dataset
        Dataset, or any other object of a file.
    where : str
        Name for messages.
    text : bool, optional
        Whether text is allowed too.

    Raises
    ------
    InputError
        If the object is a group, is stored in another file, or holds other data.
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
    """Refuse an incomplete dataset, or one that takes more memory than its numbers.

    Parameters
    ----------
    data : h5py.Dataset
        Dataset stored in the file, see `check_inside`.
    where : str
        Name for messages.

    Raises
    ------
    InputError
        If parts are missing, a chunk is too large, or it would unpack to more than its stated size.
    """
    import h5py

    properties = data.id.get_create_plist()
    if properties.get_layout() != h5py.h5d.CHUNKED:  # contiguous, or compact in the header
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
    """Refuse a gzip chunk that would unpack to more than its stated size, before unpacking it."""
    from h5py import h5z

    at = filters.index(h5z.FILTER_DEFLATE)
    before, after = set(filters[:at]), set(filters[at + 1 :])
    checks = {h5z.FILTER_FLETCHER32}
    if not before <= checks | {h5z.FILTER_SHUFFLE} or not after <= checks:
        raise InputError(f"{where}: filters {filters}; expected gzip with shuffle and checksums")
    most = size + 4 * len(before)

    # HDF5's loop replaces exceptions raised inside it, so the checks run afterwards.
    chunks: list[Any] = []
    data.id.chunk_iter(chunks.append)
    for chunk in chunks:
        if chunk.size > (limit := max(most, LARGEST_CHUNK)):
            packed = f"a chunk of {chunk.size} packed bytes"
            raise InputError(f"{where}: {packed}; expected at most {limit}")
        mask, packed = data.id.read_direct_chunk(chunk.chunk_offset)
        if not mask >> at & 1 and not _fits(packed, most):
            unpacked = f"a chunk of over {most} bytes unpacked"
            raise InputError(f"{where}: {unpacked}; expected what the file states")


def _fits(packed: bytes, most: int) -> bool:
    with suppress(zlib.error):  # HDF5 refuses a damaged chunk
        return len(zlib.decompressobj().decompress(packed, most + 1)) <= most
    return True


def _shown(*words: str) -> str:
    return repr("/".join(words).replace("//", "/")[:80])
