"""`ridgebayes predict`: bands on Q at textures and loads, from a finished run."""

import math

from ridgebayes.commands import options
from ridgebayes.commands.parsing import parse_loads, parse_texture, refuse_existing
from ridgebayes.commands.run_files import read_run
from ridgebayes.commands.run_folder import write_csv
from ridgebayes.comparison.bands import bands_table


def command(asked: options.Predict) -> None:
    """Do what the command line asks for."""
    refuse_existing(asked.out, asked.force)
    textures, loads = [parse_texture(text) for text in asked.texture], parse_loads(asked.p_over_E)
    bands = bands_table(
        read_run(asked.folder),
        textures=textures,
        loads=loads,
        nu=asked.nu,
        forms=[asked.form],
        prob=asked.prob,
        compressed=True,
    )
    write_csv(bands, asked.out)
    outside, error = int(bands["extrapolation"].sum()), bands.attrs["error"]
    known = "under 0.005 (draws)" if math.isnan(error) else f"up to {error:.1g}"
    print(
        f"{asked.out}: {len(bands)} rows, {outside} of them extrapolation; "
        f"errors of probabilities {known}"
    )
