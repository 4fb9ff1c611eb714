"""The job behind `import`: a file of any known format to a contact table."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Any

from ridgebayes.errors import InputError
from ridgebayes.fea.abaqus_dat import read_abaqus_dat
from ridgebayes.fea.abaqus_rpt import read_abaqus_rpt
from ridgebayes.fea.calculix import read_calculix
from ridgebayes.fea.calculix_contact import read_calculix_contact
from ridgebayes.fea.columns import read_columns
from ridgebayes.fea.mapping import parse_map, read_mapping
from ridgebayes.fea.mesh_series import read_series
from ridgebayes.fea.record import Imported
from ridgebayes.fea.surface import Body
from ridgebayes.runtime.reading import read_bytes
from ridgebayes.table.table import ContactTable

_TABLES = (".csv", ".tsv", ".txt", ".xlsx", ".parquet", ".rpt")
_LOOKED_AT = 20_000  # bytes
_ABAQUS = (b"THE FOLLOWING TABLE IS PRINTED", b"A B A Q U S", b"Abaqus")
_CALCULIX = (b"displacements (", b"contact stress (", b") for set ")
_OF_RUNS = ("deck", "surface", "reaction")
_OF_BODIES = ("texture", "symmetry", "top", "thickness", "corner")
_RUNS: dict[str, Callable[..., Imported]] = {
    "calculix": read_calculix,
    "calculix-contact": read_calculix_contact,
    "abaqus-dat": read_abaqus_dat,
    "abaqus-rpt": read_abaqus_rpt,
}
# Options that are not of every format.
_ALLOWED: dict[str, tuple[str, ...]] = {
    "table": ("map", "sheet", "texture"),
    **dict.fromkeys(_RUNS, (*_OF_BODIES, *_OF_RUNS)),
    "series": (*_OF_BODIES, "field", "time", "loads"),
}
FORMATS = tuple(_ALLOWED)


@dataclass(frozen=True)
class Given:
    """What a file does not say and the user does: of each only what its format asks for.

    Parameters
    ----------
    map : tuple of str
        ``key=header``, or paths of TOML files with them.
    sheet : str or None
        Of a workbook.
    texture : (float, float) or None
        Ridge and groove width over R.
    nu, R, E : str or None
        As typed; lengths and stresses with units for tables, plain numbers in a run's own units.
    symmetry : str or None
        "half" or "full".
    top, thickness, corner : float or None
        Height of the ridges' tops, thickness of the slice, corner radius over R.
    deck : Path or None
        Of a run.
    surface, reaction : str or None
        Node sets.
    field, time : str or None
        Of a series: name of the displacements, and what its time is.
    loads : tuple of float
        Of several ``.vtu``, which have no time: the same for each.
    """

    map: tuple[str, ...] = ()
    sheet: str | None = None
    texture: tuple[float, float] | None = None
    nu: str | None = None
    R: str | None = None
    E: str | None = None
    symmetry: str | None = None
    top: float | None = None
    thickness: float | None = None
    corner: float | None = None
    deck: Path | None = None
    surface: str | None = None
    reaction: str | None = None
    field: str | None = None
    time: str | None = None
    loads: tuple[float, ...] = ()


def import_files(
    paths: Sequence[Path],
    given: Given,
    *,
    program: str | None = None,
    brackets: bool = False,
    role: str | None = None,
) -> Imported:
    """Read a file, or the files of a series.

    Parameters
    ----------
    paths : sequence of Path
        One, or several ``.vtu`` in the order of their loads.
    given : Given
        What they do not say.
    program : str or None
        One of `ridgebayes.fea.read.FORMATS`; None looks.
    brackets : bool, optional
        Give the increment in which a ridge was reached, even where gaps tell the load within.
    role : str or None
        Role of every row, if not None.

    Returns
    -------
    Imported

    Raises
    ------
    InputError
        If a file cannot be understood, the format needs what is not given, or takes not what is.
    """
    path = paths[0]
    name = recognise(path) if program is None else program
    if name not in FORMATS:
        raise InputError(f"--format {name}: expected {', '.join(FORMATS)}")
    if len(paths) > 1 and name != "series":
        raise InputError(f"{len(paths)} files of format {name}: expected one (several of .vtu)")
    _check_given(name, given)
    found = _read(name, paths, given, brackets=brackets)
    if role is not None:
        frame = found.table.frame.assign(role=role)
        table = ContactTable.from_frame(frame, where=found.table.where)
        found = replace(found, table=table, messages=(*found.messages, f"role: {role}"))
    return replace(found, messages=(f"format: {name}", *found.messages))


def recognise(path: Path) -> str:
    """Return the format of a file.

    Parameters
    ----------
    path : pathlib.Path
        The file.

    Returns
    -------
    str
        One of `FORMATS`.

    Raises
    ------
    InputError
        If it cannot be read, or is none that is known.
    """
    suffix = path.suffix.lower()
    content = read_bytes(path)
    head = content[:_LOOKED_AT]
    if suffix in (".vtu", ".xdmf", ".xmf"):
        return "series"
    if b"Field Output Report" in head:
        return "abaqus-rpt"
    if suffix == ".dat":
        if any(mark in head for mark in _ABAQUS):
            return "abaqus-dat"
        if any(mark in head for mark in _CALCULIX):
            # Contact stresses alone tell which faces carry; displacements tell more.
            return "calculix" if b"displacements (" in content else "calculix-contact"
    if suffix in _TABLES:
        return "table"
    raise InputError(
        f"{path}: its format is not recognised; expected --format {', '.join(FORMATS)}, or a "
        f"suffix of {', '.join(_TABLES)}, .dat, .rpt, .vtu or .xdmf"
    )


def _check_given(name: str, given: Given) -> None:
    for option in dict.fromkeys(chain(*_ALLOWED.values())):
        if getattr(given, option) not in (None, ()) and option not in _ALLOWED[name]:
            raise InputError(f"--{option}: not used by format {name}; remove it")


def _read(name: str, paths: Sequence[Path], given: Given, *, brackets: bool) -> Imported:
    path = paths[0]
    if name == "table":
        mapping, values = _mapping(given)
        return read_columns(path, mapping, values=values, sheet=given.sheet, brackets=brackets)
    body = _body(given, name)
    options: dict[str, Any] = {"brackets": brackets}
    if name == "series":
        options |= {key: getattr(given, key) or None for key in ("field", "time", "loads")}
        return read_series(paths, body, **{k: v for k, v in options.items() if v is not None})
    run = {option: getattr(given, option) for option in _OF_RUNS}
    missing = [f"--{option}" for option, value in run.items() if value is None]
    if missing and name != "abaqus-rpt":
        raise InputError(
            f"{', '.join(missing)}: missing; expected the run's deck and its node sets of the "
            f"body's surface and of the driven nodes ({name})"
        )
    if name.startswith("calculix"):
        # CalculiX writes its status beside its results.
        options["sta"] = sta if (sta := path.with_suffix(".sta")).is_file() else None
    if name == "calculix-contact":
        del options["brackets"]  # of which all of its loads are
    return _RUNS[name](path, body, **run, **options)


def _mapping(given: Given) -> tuple[dict[str, str], Mapping[str, str | float]]:
    mapping: dict[str, str] = {}
    values: dict[str, str | float] = {}
    files = [one for one in given.map if one.endswith(".toml") and "=" not in one]
    for file in files:
        columns, constants = read_mapping(Path(file))
        mapping |= columns
        values |= constants
    mapping |= parse_map(one for one in given.map if one not in files)
    values |= _numbers(given)
    if given.texture is not None:
        values["a_over_R"], values["b_over_R"] = given.texture
    return mapping, values


def _body(given: Given, name: str) -> Body:
    if given.texture is None:
        raise InputError(
            f"--texture: missing; expected A,B, ridge and groove width over R ({name})"
        )
    if given.nu is None:
        raise InputError(f"--nu: missing; expected Poisson's ratio of the run ({name})")
    return Body(
        *given.texture,
        **{key: _plain(key, text) for key, text in _numbers(given).items()},
        symmetry=given.symmetry or "half",
        top=given.top,
        thickness=1.0 if given.thickness is None else given.thickness,
        corner_over_R=given.corner or 0.0,
    )


def _numbers(given: Given) -> dict[str, str]:
    typed = {"nu": given.nu, "R": given.R, "E": given.E}
    return {key: text for key, text in typed.items() if text is not None}


def _plain(option: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise InputError(
            f"--{option} {text!r}: expected a plain number, in the units of the run"
        ) from None
