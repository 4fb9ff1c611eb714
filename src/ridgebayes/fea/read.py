"""The job behind `import`: a file of any known format to a contact table."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, TypedDict

from ridgebayes.errors import InputError
from ridgebayes.fea.recognise import FORMATS, recognise
from ridgebayes.table.table import ContactTable

if TYPE_CHECKING:
    from ridgebayes.fea.levels import Body
    from ridgebayes.fea.record import Imported

_OF_TABLES = ("map", "sheet")
_OF_RUNS = ("texture", "symmetry", "top", "thickness", "corner")
_OF_SERIES = ("field", "time", "loads")
_ALLOWED = {
    "table": (*_OF_TABLES, "texture"),
    "calculix": (*_OF_RUNS, "deck", "surface", "reaction"),
    "calculix-contact": (*_OF_RUNS, "deck", "surface", "reaction"),
    "abaqus-dat": (*_OF_RUNS, "deck", "surface", "reaction"),
    "abaqus-rpt": (*_OF_RUNS, "deck", "surface", "reaction"),
    "series": (*_OF_RUNS, *_OF_SERIES),
}


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
) -> "Imported":
    """Read a file, or the files of a series.

    Parameters
    ----------
    paths : sequence of Path
        One, or several ``.vtu`` in the order of their loads.
    given : Given
        What they do not say.
    program : str or None
        One of `ridgebayes.fea.recognise.FORMATS`; None looks.
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
    if program is not None and program not in FORMATS:
        raise InputError(f"--format {program}: expected {', '.join(FORMATS)}")
    name = program or recognise(path)
    if len(paths) > 1 and name != "series":
        raise InputError(
            f"{len(paths)} files of format {name}: expected one, but of a series of .vtu"
        )
    _check_given(name, given)
    found = _READERS[name](paths, given, brackets)
    if role is not None:
        frame = found.table.frame.assign(role=role)
        table = ContactTable.from_frame(frame, where=found.table.where)
        found = replace(found, table=table, said=(*found.said, f"role: {role}"))
    return replace(found, said=(f"format: {name}", *found.said))


def _check_given(name: str, given: Given) -> None:
    for option in (*_OF_TABLES, *_OF_RUNS, "deck", "surface", "reaction", *_OF_SERIES):
        value = getattr(given, option)
        if value not in (None, ()) and option not in _ALLOWED[name]:
            raise InputError(f"--{option}: not for format {name}; leave it out")


def _table(paths: Sequence[Path], given: Given, brackets: bool) -> "Imported":
    from ridgebayes.fea.columns import read_columns

    mapping, values = _mapping(given)
    return read_columns(paths[0], mapping, values=values, sheet=given.sheet, brackets=brackets)


def _mapping(given: Given) -> tuple[dict[str, str], Mapping[str, str | float]]:
    from ridgebayes.fea.map_file import parse_map, read_mapping

    mapping: dict[str, str] = {}
    values: dict[str, str | float] = {}
    for file in (one for one in given.map if one.endswith(".toml") and "=" not in one):
        columns, constants = read_mapping(Path(file))
        mapping |= columns
        values |= constants
    mapping |= parse_map(one for one in given.map if not one.endswith(".toml") or "=" in one)
    for name in ("nu", "R", "E"):
        if (value := getattr(given, name)) is not None:
            values[name] = value
    if given.texture is not None:
        values["a_over_R"], values["b_over_R"] = given.texture
    return mapping, values


def _body(given: Given, name: str) -> "Body":
    from ridgebayes.fea.levels import Body

    if given.texture is None:
        raise InputError(
            f"--texture: missing; expected A,B, ridge and groove width over R ({name})"
        )
    numbers = {"nu": given.nu, "R": given.R, "E": given.E}
    plain = {}
    for option, text in numbers.items():
        if text is None:
            continue
        try:
            plain[option] = float(text)
        except ValueError:
            raise InputError(
                f"--{option} {text!r}: expected a plain number, in the units of the run"
            ) from None
    if "nu" not in plain:
        raise InputError(f"--nu: missing; expected Poisson's ratio of the run ({name})")
    symmetry = given.symmetry or "half"
    if symmetry not in ("half", "full"):
        raise InputError(f"--symmetry {symmetry}: expected half or full")
    return Body(
        *given.texture,
        **plain,
        symmetry="half" if symmetry == "half" else "full",
        top=given.top,
        thickness=1.0 if given.thickness is None else given.thickness,
        corner_over_R=given.corner or 0.0,
    )


class _RunFiles(TypedDict):
    deck: Path
    surface: str
    reaction: str


def _run_files(given: Given, name: str) -> _RunFiles:
    missing = [
        f"--{option}"
        for option in ("deck", "surface", "reaction")
        if getattr(given, option) is None
    ]
    if missing:
        raise InputError(
            f"{', '.join(missing)}: missing; expected the run's deck and its node sets of the "
            "body's "
            f"surface and of the driven nodes ({name})"
        )
    assert given.deck is not None
    return {"deck": given.deck, "surface": str(given.surface), "reaction": str(given.reaction)}


def _sta(path: Path) -> Path | None:
    """Return the status file that CalculiX writes beside its results, if it is there."""
    beside = path.with_suffix(".sta")
    return beside if beside.is_file() else None


def _calculix(paths: Sequence[Path], given: Given, brackets: bool) -> "Imported":
    from ridgebayes.fea.calculix import read_calculix

    body = _body(given, "calculix")
    files = _run_files(given, "calculix")
    return read_calculix(paths[0], body, **files, sta=_sta(paths[0]), brackets=brackets)


def _calculix_contact(paths: Sequence[Path], given: Given, brackets: bool) -> "Imported":
    from ridgebayes.fea.calculix_contact import read_calculix_contact

    body = _body(given, "calculix-contact")
    files = _run_files(given, "calculix-contact")
    return read_calculix_contact(paths[0], body, **files, sta=_sta(paths[0]))


def _abaqus_dat(paths: Sequence[Path], given: Given, brackets: bool) -> "Imported":
    from ridgebayes.fea.abaqus_dat import read_abaqus_dat

    body = _body(given, "abaqus-dat")
    files = _run_files(given, "abaqus-dat")
    return read_abaqus_dat(paths[0], body, **files, brackets=brackets)


def _abaqus_rpt(paths: Sequence[Path], given: Given, brackets: bool) -> "Imported":
    from ridgebayes.fea.abaqus_rpt import read_abaqus_rpt

    body = _body(given, "abaqus-rpt")
    return read_abaqus_rpt(
        paths[0],
        body,
        surface=given.surface,
        reaction=given.reaction,
        deck=given.deck,
        brackets=brackets,
    )


def _series(paths: Sequence[Path], given: Given, brackets: bool) -> "Imported":
    from ridgebayes.fea.mesh_series import read_series

    time = given.time or "p_over_E"
    if time not in ("p_over_E", "line"):
        raise InputError(f"--time {time}: expected p_over_E or line")
    return read_series(
        paths,
        _body(given, "series"),
        field=given.field or "displacement",
        time="line" if time == "line" else "p_over_E",
        loads=given.loads or None,
        brackets=brackets,
    )


_READERS = {
    "table": _table,
    "calculix": _calculix,
    "calculix-contact": _calculix_contact,
    "abaqus-dat": _abaqus_dat,
    "abaqus-rpt": _abaqus_rpt,
    "series": _series,
}
