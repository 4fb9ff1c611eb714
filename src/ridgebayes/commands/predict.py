"""`ridgebayes predict`: bands on Q at textures and loads, from a finished run."""

import math

from ridgebayes.commands import options
from ridgebayes.commands.parsing import parse_loads, parse_texture, refuse_existing
from ridgebayes.commands.run_files import read_run
from ridgebayes.commands.run_folder import write_csv
from ridgebayes.commands.terminal import Answer
from ridgebayes.comparison.bands import bands_table
from ridgebayes.predict.extrapolation import NAMES


def command(asked: options.Predict) -> Answer:
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
    beyond, error = bands["extrapolation_of"][bands["extrapolation"]], bands.attrs["error"]
    known = "under 0.005 (draws)" if math.isnan(error) else f"up to {error:.1g}"
    told = (
        f"{asked.out}: {len(bands)} rows, {len(beyond)} of them extrapolation; "
        f"errors of probabilities {known}"
    )
    warnings = []
    if len(beyond):
        names = dict.fromkeys(name for names in beyond.unique() for name in names.split(","))
        warnings.append(
            f"{len(beyond)} of {len(bands)} rows lie beyond the calibrated range of "
            f"{', '.join(name for name in NAMES if name in names)}"
        )
    return Answer((told,), bands, [asked.out], warnings=warnings)
