"""`ridgebayes friction`: joint draws for friction models, from a finished run and a scene.

With --model also bands of the worked friction model, and what their variance comes from.
"""

from collections.abc import Iterator

import pandas as pd
import xarray as xr

from ridgebayes.commands import options
from ridgebayes.commands.parsing import parse_loads, refuse_existing
from ridgebayes.commands.run_files import read_run
from ridgebayes.commands.run_folder import write_csv
from ridgebayes.commands.terminal import Answer
from ridgebayes.errors import InputError
from ridgebayes.friction.bands import FrictionBands, FrictionInputs
from ridgebayes.friction.files import check_name, write_inputs
from ridgebayes.friction.friction_model import FrictionModel
from ridgebayes.friction.inputs import InputDraws
from ridgebayes.runtime.progress import Progress
from ridgebayes.scene.scene import Scene

_SHOWN = ("p_over_E", "Q", "contact_length_over_R", "ridge_force_mean", "penetration_over_R")
_N_MODEL = 20_000  # draws that bands are made of: more would only cost memory


def command(asked: options.Friction) -> Answer:
    """Do what the command line asks for."""
    bands, shares = (
        asked.out.with_name(f"{asked.out.stem}-{name}.csv") for name in ("mu", "mu-shares")
    )
    for path in (asked.out, bands, shares)[: 3 if asked.model else 1]:
        refuse_existing(path, asked.force)
    check_name(asked.out)
    if asked.p_over_E is not None and asked.loads is not None:
        raise InputError("--p-over-E and --loads: expected one of them, got both")
    draws = InputDraws(
        read_run(asked.folder),
        Scene.from_toml(asked.scene),
        asked.loads or 20 if asked.p_over_E is None else parse_loads(asked.p_over_E),
        n=asked.n,
        rng=asked.seed,
        edges=asked.edges or asked.model,
    )
    sums: list[pd.DataFrame] = []
    kept: list[FrictionInputs] | None = [] if asked.model else None
    with Progress(1) as progress, progress.stage("draws"):
        write_inputs(_told(draws, sums, kept, asked.edges, progress), asked.out)
    table = (sums[0] / draws.n).reset_index()
    outside = float(table["extrapolation"].mean())
    told = (
        f"{asked.out}: {draws.n} draws at {len(table)} loads; relative error of contacts up to "
        f"{draws.contact_relative_error:.1g}. Means over draws:"
    )
    warnings = []
    if outside:
        warnings.append(f"{outside:.2%} of draws and loads lie beyond the calibrated range")
    if kept is None:
        return Answer((told, table.round(6)), table, [asked.out], warnings=warnings)
    found = FrictionModel().predict(FrictionInputs.joined(kept), rng=asked.seed)
    write_csv(found.bands, bands)
    write_csv(found.shares, shares)
    parts = (told, table.round(6), *_answer(found))
    files = [asked.out, bands, shares]
    return Answer(parts, found.bands, files, warnings=warnings)


def _answer(found: FrictionBands) -> tuple[str | pd.DataFrame, ...]:
    """Return bands, and the shares of terms and inputs at the largest load."""
    last = found.shares["load"] == found.shares["load"].max()
    shown = found.shares[last & (found.shares["kind"] != "scene")].round(3).astype(object)
    return (
        "Coefficient of friction before any measurement:",
        found.bands.round(4),
        "Shares of its variance at the largest load:",
        shown.where(shown.notna(), "")[["kind", "name", "share", "share_se", "total"]],
    )


def _told(
    draws: InputDraws,
    sums: list[pd.DataFrame],
    kept: list[FrictionInputs] | None,
    edges: bool,
    progress: Progress,
) -> Iterator[xr.Dataset]:
    """Yield blocks of draws; keep their sum, alone in `sums`, and what friction needs."""
    done = 0
    for block in draws.blocks():
        if kept is not None and done < _N_MODEL:
            kept.append(FrictionInputs.of(block, edges=True))
        yield block if edges else block.drop_dims("edge", errors="ignore")
        own = block[[*_SHOWN, "extrapolation"]].sum("draw").to_dataframe()
        sums[:] = [sums[0] + own if sums else own]
        done += block.sizes["draw"]
        progress.count(done, draws.n)
