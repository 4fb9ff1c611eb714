"""`ridgebayes predict`: bands on Q at textures and loads, from a finished run."""

import math
from pathlib import Path

from ridgebayes.commands.parsing import parse_loads, parse_texture, refuse_existing
from ridgebayes.commands.run_files import read_run
from ridgebayes.commands.run_folder import write_csv
from ridgebayes.comparison.bands import bands_table


def command(
    *,
    folder: Path,
    texture: list[str],
    p_over_E: str,
    out: Path,
    nu: float,
    form: str,
    prob: float,
    force: bool,
) -> None:
    """Do what the command line asks for."""
    refuse_existing(out, force)
    textures, loads = [parse_texture(text) for text in texture], parse_loads(p_over_E)
    bands = bands_table(
        read_run(folder),
        textures=textures,
        loads=loads,
        nu=nu,
        forms=[form],
        prob=prob,
        compressed=True,
    )
    write_csv(bands, out)
    error = bands.attrs["error"]
    known = "under 0.005 (draws)" if math.isnan(error) else f"up to {error:.1g}"
    print(
        f"{out}: {len(bands)} rows, {int(bands['extrapolation'].sum())} of them extrapolation; "
        f"errors of probabilities {known}"
    )
