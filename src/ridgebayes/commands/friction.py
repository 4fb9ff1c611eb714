"""`ridgebayes friction`: joint draws for friction models, given a finished run and a scene.

With --model the command also computes bands of the friction model and their sources of variance.
"""

from collections.abc import Iterator
from functools import reduce

import pandas as pd
import xarray as xr

from ridgebayes.commands import options
from ridgebayes.commands.parsing import refuse_output
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
from ridgebayes.scene.typed import parse_loads

_SHOWN = ("p_over_E", "Q", "contact_length_over_R", "ridge_force_mean", "penetration_over_R")
_MAX_MODEL_DRAWS = 20_000  # draws for the bands; limits memory


def command(asked: options.Friction) -> Answer:
    """Write joint draws and, with --model, the bands and variance shares of friction."""
    mu_path, shares_path = (
        asked.out.with_name(f"{asked.out.stem}-{name}.csv") for name in ("mu", "mu-shares")
    )
    for path in (asked.out, mu_path, shares_path)[: 3 if asked.model else 1]:
        refuse_output(path, asked.force)
    check_name(asked.out)
    if asked.p_over_E is not None and asked.loads is not None:
        raise InputError("--p-over-E and --loads: expected only one of the two, got both")
    scene, warnings = Scene.from_toml(asked.scene), []
    model = None
    if asked.model:  # interlocking needs edge forces, which round edges do not have
        is_round = any(texture.corner_radius_over_R > 0 for texture in scene.textures)
        model = FrictionModel(kappa=0) if is_round else FrictionModel()
    draws = InputDraws(
        read_run(asked.folder),
        scene,
        asked.loads or 20 if asked.p_over_E is None else parse_loads(asked.p_over_E),
        n=asked.n,
        rng=asked.seed,
        edges=asked.edges or (model is not None and model.kappa != 0),
    )
    sums: list[pd.DataFrame] = []  # over each block of draws
    kept: list[FrictionInputs] = []

    def summed(progress: Progress) -> Iterator[xr.Dataset]:
        done = 0
        for block in draws.blocks():
            if model is not None and done < _MAX_MODEL_DRAWS:
                kept.append(FrictionInputs.of(block, edges=model.kappa != 0))
            yield block if asked.edges else block.drop_dims("edge", errors="ignore")
            sums.append(block[[*_SHOWN, "extrapolation"]].sum("draw").to_dataframe())
            done += block.sizes["draw"]
            progress.count(done, draws.n)

    with Progress(1) as progress, progress.stage("draws"):
        write_inputs(summed(progress), asked.out)
    means = (reduce(pd.DataFrame.add, sums) / draws.n).reset_index()
    outside = float(means["extrapolation"].mean())
    summary = (
        f"{asked.out}: {draws.n} draws at {len(means)} loads; relative error of contacts up to "
        f"{draws.contact_relative_error:.1g}. Means over draws:"
    )
    if outside:
        warnings.append(f"{100 * outside:.3g} % of draws and loads lie beyond the calibrated range")
    if model is None:
        return Answer((summary, means.round(6)), means, [asked.out], warnings=warnings)
    if not model.kappa:
        warnings.append("bands without interlocking (kappa = 0): it needs sharp corners")
    friction = model.predict(FrictionInputs.joined(kept), rng=asked.seed)
    write_csv(friction.bands, mu_path)
    write_csv(friction.shares, shares_path)
    parts = (summary, means.round(6), *_answer(friction))
    return Answer(parts, friction.bands, [asked.out, mu_path, shares_path], warnings=warnings)


def _answer(friction: FrictionBands) -> tuple[str | pd.DataFrame, ...]:
    """Return the bands, and the variance shares of terms and inputs at the largest load."""
    last = friction.shares["load"] == friction.shares["load"].max()
    shown = friction.shares[last & (friction.shares["kind"] != "scene")].round(3).astype(object)
    return (
        "Coefficient of friction before any measurement:",
        friction.bands.round(4),
        "Shares of its variance at the largest load:",
        shown.where(shown.notna(), "")[["kind", "name", "share", "share_se", "total"]],
    )
