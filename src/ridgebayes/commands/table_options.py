"""Records of options, one per command on scenes and tables.

The docstring of a record is the help text of its options; `shared_options` describes fields that
the docstring omits. The module imports no slow packages, so that help is fast.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from ridgebayes.commands.shared_options import Argument, Natural, Positive


@dataclass(frozen=True)
class Generate:
    """Compute transition loads of textures and write them as a contact table.

    Parameters
    ----------
    out : Path
        File to write.
    scene : Path, optional
        Scene file. The embedded sweep if not given.
    texture : list of str, optional
        A,B: ridge and groove width, as shares of the radius, or with units (needs --R). May be
        repeated.
    R : str, optional
        Radius, such as '8 mm', with --texture.
    p_max : float, optional
        Highest load p/E, with --texture.
    nu : float, optional
        Poisson's ratio, with --texture.
    solver : str, optional
        auto, hertz, half-plane, two-scale, cylinder-linear or cylinder-fe.
    tol : float, optional
        Relative tolerance of each load. Set by --accuracy if not given.
    fields : Path, optional
        Folder to create for finite-element fields: XDMF, CSV, figures.
    """

    out: Path
    scene: Argument[Path | None] = None
    texture: list[str] | None = None
    R: str | None = None
    p_max: float = 0.02
    nu: float = 0.5
    solver: str = "auto"
    tol: float | None = None
    accuracy: str = "standard"
    fields: Path | None = None
    workers: Positive[int | None] = None
    scheduler: str | None = None
    force: bool = False
    resume: bool = False


@dataclass(frozen=True)
class PlanOptions:
    """Describe a scene: load, expected Q, contact width, and which effects matter.

    Parameters
    ----------
    scene : Path, optional
        Scene file.
    out : Path, optional
        .csv or .parquet to write.
    new : Path, optional
        Write a commented scene file to start from, such as my.toml.
    figures : Path, optional
        Folder for figures of the scene.
    """

    scene: Argument[Path | None] = None
    out: Path | None = None
    new: Path | None = None
    figures: Path | None = None
    force: bool = False


@dataclass(frozen=True)
class Cost:
    """Measure error and run time of each accuracy: posteriors, evidences and loads.

    Parameters
    ----------
    source : Path, optional
        Contact table or scene file. The embedded sweep if not given.
    elements : bool, optional
        Run finite elements too.
    repeats : int, optional
        Number of timed runs of each accuracy.
    workers : int, optional
        Worker processes. Parallel runs distort timings.
    """

    source: Annotated[Path | None, typer.Argument(metavar="[TABLE|SCENE]")] = None
    out: Path = Path("ridgebayes-cost")
    elements: bool = True
    repeats: Positive[int] = 3
    seed: Natural[int] = 0
    force: bool = False
    workers: Positive[int | None] = None
    scheduler: str | None = None


@dataclass(frozen=True)
class Import:
    r"""Read the output of your own finite elements or tests into a contact table.

    Headers such as 'Stegbreite \[mm]' or 'Line load (N/mm)', title lines,
    wide tables and increments are recognised. If something is missing, a
    message names it and prints the command to complete.

        ridgebayes import loads.csv --R '8 mm' --E '60 kPa' -o table.csv
        ridgebayes import t.xlsx --sheet 2 --map 'a=w1 \[mm]' --map 'line=F;N/mm'
        ridgebayes import run.dat --texture 0.06,0.03 --deck run.inp -o table.csv

    Keys of --map: a, b, pitch, R, D, offset (lengths), E, p (pressures),
    line (line loads), force, load (any, by its unit), p_lower, line_lower,
    force_lower, Q, nu, rel_se, a_over_R, b_over_R, offset_over_R, p_over_E,
    p_over_E_lower, load_sd, n_mean, kind, role, series, texture, solver, status, source.
    'p=Load at * \[kPa]' is one column for each Q, 'status Q=4' the contact at a
    corner by increment.

    Parameters
    ----------
    file : list[Path]
        File to read, or all files of a VTU series or of a run of FEBio or ANSYS.
    out : Path, optional
        Table to write.
    program : str, optional
        table, calculix, abaqus-dat, febio, ansys, series, or nodes (a table with a row for each
        node at each step). Detected if not given, except nodes.
    mapping : list of str, optional
        Column of a key, KEY=HEADER, such as 'a=Ridge width \[mm]', or KEY=HEADER;UNIT, or a
        TOML file of them. Other columns are recognised.
    write_map : Path, optional
        TOML file to write with the recognised columns, for --map.
    sheet : str, optional
        Name or number of a worksheet, or all for the sheets with the same header.
    skip_rows : int, optional
        Number of lines to skip at the top.
    header_row : int, optional
        Line of the header; 0 for no header.
    decimal : str, optional
        Decimal mark: point or comma.
    empty : list of str, optional
        Text that marks an empty cell, such as 'n/a'. May be repeated.
    skip_empty : bool, optional
        Leave out rows without a load.
    count_is : str, optional
        Counted quantity: edges (proximal), ridges, segments or per-side.
    closed_is : str, optional
        Comma-separated codes of a status that mean contact, such as 2,3.
    texture : str, optional
        A,B: ridge and groove width, as shares of the radius, or with units (needs --R).
    nu : str, optional
        Poisson's ratio.
    R : str, optional
        Radius, such as '8 mm'.
    E : str, optional
        Young's modulus, such as '60 kPa'.
    thickness : str, optional
        Length of the body along the ridges, such as '20 mm'. Needed for forces.
    load_se : str, optional
        Standard error of every load, such as '0.05 N' of the load cell.
    deck : Path, optional
        Input deck of the run. The .inp file of the same name if not given.
    surface : str, optional
        Node set of the body's rim. The set of the deck's *NODE PRINT of U if not given.
    reaction : str, optional
        Node set whose reaction is the load. The set of the deck's *NODE PRINT of RF if
        not given.
    symmetry : str, optional
        Which part of the body is meshed: half or full.
    top : float, optional
        Height of the ridge tops.
    corner : float, optional
        Corner radius of the ridges, as a share of the body's radius; read from the deck's
        nodes if not given.
    field : str, optional
        Name of the point data of a series. 'displacement' if not given.
    time : str, optional
        Meaning of a series' time: p_over_E or line.
    loads : str, optional
        Comma-separated p/E or line loads of several .vtu files.
    brackets : bool, optional
        Write each load as an interval, even if gaps are known.
    interpolate : bool, optional
        Write each load as the middle of its increment, not as an interval.
    role : str, optional
        Role of all rows: calibration or held-out.
    dry_run : bool, optional
        Show how the input is read. Write nothing.
    """

    file: Argument[list[Path]]
    out: Path | None = None
    program: str | None = None
    mapping: list[str] | None = None
    write_map: Path | None = None
    sheet: str | None = None
    skip_rows: Natural[int | None] = None
    header_row: Natural[int | None] = None
    decimal: str | None = None
    empty: list[str] | None = None
    skip_empty: bool = False
    count_is: str | None = None
    closed_is: str = ""
    texture: str | None = None
    nu: str | None = None
    R: str | None = None
    E: str | None = None
    thickness: str | None = None
    load_se: str | None = None
    deck: Path | None = None
    surface: str | None = None
    reaction: str | None = None
    symmetry: str | None = None
    top: float | None = None
    corner: float | None = None
    field: str | None = None
    time: str | None = None
    loads: str = ""
    brackets: bool = False
    interpolate: bool = False
    role: str | None = None
    dry_run: bool = False
    force: bool = False


@dataclass(frozen=True)
class ExportDeck:
    """Write a scene as an input deck for your own finite elements.

    Parameters
    ----------
    scene : Path
        Scene file of one texture.
    out : Path
        File to write, such as run.inp.
    program : str, optional
        Program that reads the deck: calculix or abaqus.
    edges : float, optional
        Number of element edges across a ridge.
    """

    scene: Argument[Path]
    out: Path
    program: str = "calculix"
    edges: float = 12.0
    force: bool = False
