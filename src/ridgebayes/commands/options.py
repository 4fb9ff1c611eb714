"""Records of the options of commands that fit and of commands on a finished run.

The docstring of a record is the help of its options; shared options are described in
`shared_options`. The module imports nothing heavy, so that help is fast.
"""

from dataclasses import dataclass
from pathlib import Path

from ridgebayes.commands.shared_options import DEFAULT_OUT, Argument, Natural, Positive


@dataclass(frozen=True, kw_only=True)
class FitOptions:
    """Options of all commands that fit."""

    noise: str = "auto"
    out: Path = DEFAULT_OUT
    force: bool = False
    seed: Natural[int] = 0
    accuracy: str = "standard"
    priors: Path | None = None
    time_limit: float | None = None


@dataclass(frozen=True)
class Run(FitOptions):
    """Calibrate all forms, compare them, predict, and write a report.

    Parameters
    ----------
    table : Path, optional
        Contact table. The embedded sweep if not given.
    workers : int, optional
        Worker processes. One for each processor if not given.
    """

    table: Path | None = None
    forms: str | None = None
    resume: bool = False
    workers: Positive[int | None] = None
    scheduler: str | None = None
    prior_odds: str = ""


@dataclass(frozen=True)
class FitOne(FitOptions):
    """Sample the posterior of one form.

    Parameters
    ----------
    table : Path
        Contact table, .csv or .parquet.
    form : str
        Form to fit, such as hybrid.
    """

    table: Argument[Path]
    form: str
    resume: bool = False


@dataclass(frozen=True)
class Compare(FitOptions):
    """Compare forms: evidences, Bayes factors, model probabilities, leave-one-out, stacking.

    Parameters
    ----------
    table : Path
        Contact table, .csv or .parquet.
    """

    table: Argument[Path]
    forms: str | None = None
    prior_odds: str = ""


@dataclass(frozen=True)
class Predict:
    """Predict Q with uncertainty bands at given textures and loads, from a finished run.

    Parameters
    ----------
    out : Path
        Bands to write, .csv or .parquet.
    texture : list of str, optional
        A,B: ridge and groove width, as shares of the radius, or with units (needs --R or
        --scene). May be repeated. The textures of --scene if not given.
    p_over_E : str, optional
        Loads p/E: a number such as 0.01, LO:HI:N (evenly spaced) or log:LO:HI:N
        (log-spaced).
    load : str, optional
        Loads with units, instead of --p-over-E: a pressure on the projected area ('1.2 kPa'),
        a force per length ('20 N/m'), a force ('5 N'), or a range LO:HI:N of loads. A single
        load may have an uncertainty ('20 N/m ± 3 %').
    scene : Path, optional
        Scene file that gives textures, Poisson's ratio, radius, modulus and highest load.
    R : str, optional
        Radius, such as '8 mm' or '8 mm ± 5 %'.
    E : str, optional
        Young's modulus, such as '60 kPa' or '60 kPa ± 20 %' (or +-).
    thickness : str, optional
        Length of the body along the ridges, such as '20 mm'. Needed for forces.
    nu : float, optional
        Poisson's ratio. The value of --scene or 0.5 if not given.
    kind : str, optional
        simulation (band for a further simulation or measurement, with its errors), curve
        (band of the form's loads without errors) or both.
    form : str, optional
        Form of the run, or average (over all forms).
    prob : float, optional
        Probability inside the band.
    plot : Path, optional
        Figure to draw, .png, .svg or .pdf.
    width : str, optional
        Width of the figure, such as '85 mm' for a journal's column. '188 mm' if not given.
    """

    folder: Argument[Path]
    out: Path
    texture: list[str] | None = None
    p_over_E: str | None = None
    load: str | None = None
    scene: Path | None = None
    R: str | None = None
    E: str | None = None
    thickness: str | None = None
    nu: float | None = None
    kind: str = "simulation"
    form: str = "average"
    prob: float = 0.9
    plot: Path | None = None
    width: str | None = None
    force: bool = False


@dataclass(frozen=True)
class Friction:
    """Draw random counts and contacts, as input to friction models, from a finished run.

    Parameters
    ----------
    scene : Path
        Scene file of one texture.
    out : Path
        File to write: .nc, .parquet or .csv.
    p_over_E : str, optional
        Loads p/E as LO:HI:N, evenly spaced, or log:LO:HI:N, log-spaced.
    loads : int, optional
        Number of equal load steps up to the scene's largest load. 20 if not given.
    n : int, optional
        Number of draws.
    edges : bool, optional
        Add the forces on ridge edges.
    model : bool, optional
        Add bands on the coefficient of friction: FILE-mu.csv, -mu-shares.csv.
    """

    folder: Argument[Path]
    scene: Argument[Path]
    out: Path
    p_over_E: str | None = None
    loads: Positive[int | None] = None
    n: Positive[int] = 4000
    edges: bool = False
    model: bool = False
    seed: Natural[int] = 0
    force: bool = False


@dataclass(frozen=True)
class DesignOptions:
    """Find textures that meet a goal under all uncertainties, from a finished run.

    Parameters
    ----------
    scene : Path
        Scene file of body and load, whose values may be distributions.
    goal : list of str
        Goal, such as 'P(Q >= 8) >= 0.95', 'P(6 <= Q <= 10 at p/E = 0.01) >= 90 %',
        'P(Q(0.2 N) < 8 <= Q(0.8 N)) >= 0.9' or 'sd(Q) <= 1'. May be repeated.
    a : str, optional
        Range of ridge widths LO:HI, as shares of the radius or with units. The calibrated
        range if not given.
    b : str, optional
        Range of groove widths LO:HI, in the same way.
    step : str, optional
        Consider only widths that are multiples of this length, such as '10 um'.
    tolerance : str, optional
        Manufacturing tolerance of both widths: a standard deviation ('5 %' or '10 um') or
        bounds ('worst 5 %').
    p_over_E : str, optional
        Loads of goals without a load: p/E or with units, LO:HI:N or log:LO:HI:N. A goal must
        be met at the worst of these loads; --objective min-load finds the smallest load that
        meets it. The scene's largest load if not given.
    objective : str, optional
        Which feasible texture is recommended: margin, max-pitch, min-pitch, max-ridge,
        min-ridge, max-groove, min-groove or min-load.
    """

    folder: Argument[Path]
    scene: Path
    goal: list[str]
    a: str | None = None
    b: str | None = None
    step: str | None = None
    tolerance: str | None = None
    p_over_E: str | None = None
    objective: str = "margin"
    seed: Natural[int] = 0
    out: Path = Path("ridgebayes-design")
    force: bool = False


@dataclass(frozen=True)
class Coverage:
    """Leave each texture out in turn and count how often the bands contain its loads.

    Parameters
    ----------
    table : Path, optional
        Contact table. The embedded sweep if not given.
    noise : str, optional
        Comma-separated error models: STRUCTURE or STRUCTURE:student, where STRUCTURE is one
        of iid, texture, step, texture+step, step-smooth, each also with +series where a
        table has several series or sources. All ten without series if not given.
    workers : int, optional
        Worker processes, 2 if not given. Results do not depend on their number.
    """

    table: Argument[Path | None] = None
    out: Path = Path("ridgebayes-coverage")
    forms: str | None = None
    noise: str | None = None
    seed: Natural[int] = 0
    force: bool = False
    workers: Positive[int | None] = None
    scheduler: str | None = None


@dataclass(frozen=True)
class Report:
    """Write the report of a finished run again."""

    folder: Argument[Path]
