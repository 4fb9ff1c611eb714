"""`ridgebayes friction`: joint draws for friction models, from a finished run and a scene."""

from collections.abc import Iterator

import pandas as pd
import xarray as xr

from ridgebayes.commands import options
from ridgebayes.commands.parsing import parse_loads, refuse_existing
from ridgebayes.commands.run_files import read_run
from ridgebayes.commands.terminal import Answer
from ridgebayes.errors import InputError
from ridgebayes.friction.files import check_name, write_inputs
from ridgebayes.friction.inputs import InputDraws
from ridgebayes.runtime.progress import Progress
from ridgebayes.scene.scene import Scene

_SHOWN = ("p_over_E", "Q", "contact_length_over_R", "ridge_force_mean", "penetration_over_R")


def command(asked: options.Friction) -> Answer:
    """Do what the command line asks for."""
    refuse_existing(asked.out, asked.force)
    check_name(asked.out)
    if asked.p_over_E is not None and asked.loads is not None:
        raise InputError("--p-over-E and --loads: expected one of them, got both")
    draws = InputDraws(
        read_run(asked.folder),
        Scene.from_toml(asked.scene),
        asked.loads or 20 if asked.p_over_E is None else parse_loads(asked.p_over_E),
        n=asked.n,
        rng=asked.seed,
        edges=asked.edges,
    )
    means: list[pd.DataFrame] = []
    with Progress(1) as progress, progress.stage("draws"):
        write_inputs(_told(draws, means, progress), asked.out)
    table = (sum(means[1:], means[0]) / draws.n).reset_index()
    outside = float(table["extrapolation"].mean())
    told = (
        f"{asked.out}: {draws.n} draws at {len(table)} loads; contacts within "
        f"{draws.contact_relative_error:.1g}; means over draws:"
    )
    warnings = []
    if outside:
        warnings.append(f"{outside:.2%} of draws and loads lie beyond what was calibrated")
    return Answer((told, table.round(6)), table, [asked.out], warnings=warnings)


def _told(draws: InputDraws, sums: list[pd.DataFrame], progress: Progress) -> Iterator[xr.Dataset]:
    """Yield blocks of draws, and keep what they add up to at each load."""
    done = 0
    for block in draws.blocks():
        yield block
        sums.append(block[[*_SHOWN, "extrapolation"]].sum("draw").to_dataframe())
        done += block.sizes["draw"]
        progress.count(done, draws.n)
