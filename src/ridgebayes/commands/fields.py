"""Files of finite-element results for each texture: fields, contact tables and figures."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from ridgebayes.commands.run_folder import new_folder, write_csv
from ridgebayes.contact.cylinder.cylinder import Cylinder, Transition
from ridgebayes.contact.cylinder.fields import surface_table, write_fields
from ridgebayes.drawing.style import save
from ridgebayes.errors import InputError
from ridgebayes.report.figures.bodies import plot_deformed
from ridgebayes.scene.effects import plan_label
from ridgebayes.scene.scene import Scene, Texture
from ridgebayes.simulate.generation import generate
from ridgebayes.table.table import ContactTable

LOADS_CSV = "loads.csv"


def generate_fields(
    scene: Scene, folder: Path, *, force: bool = False, **solving: Any
) -> ContactTable:
    """Generate a table as `ridgebayes.generate` does, and write finite-element results.

    Parameters
    ----------
    scene : Scene
        Textures and loads.
    folder : Path
        Folder to create. It contains the table, ``loads.csv``, and for each texture and offset
        simulated by finite elements the states at the transitions: ``fields-*.xdmf`` with
        ``.h5``, a time series whose time is p/E; ``contact-*.csv``, the segments of the rigid
        surface in contact; ``deformed-*`` as PNG and SVG, the last transition.
    force : bool, optional
        Whether an existing folder of this kind may be replaced.
    **solving
        Solver, rel_tol and accuracy, as in `ridgebayes.generate`.

    Returns
    -------
    ContactTable
        Table of transition loads.

    Raises
    ------
    InputError
        If `ridgebayes.generate` raises it, the folder cannot be created, or no texture is
        simulated by finite elements.
    """
    simulated: list[Texture] = []
    with new_folder(folder, force=force, about=LOADS_CSV) as partial:

        def write(texture: Texture, body: Cylinder, reached: Sequence[Transition]) -> None:
            simulated.append(texture)
            if reached:
                _write(partial, texture, body, reached)

        table = generate(scene, pressed=write, **solving)
        if not simulated:
            raise InputError(
                f"--fields {folder}: no texture is simulated by finite elements; use --solver "
                "cylinder-fe, or a scene whose `relative` calls for them"
            )
        table.write(partial / LOADS_CSV)
    return table


def _write(folder: Path, texture: Texture, body: Cylinder, reached: Sequence[Transition]) -> None:
    """Write the states of a cylinder at its transitions to a folder."""
    label = plan_label(texture)
    if texture.offset == "uniform" and body.profile is not None:
        label = f"{label}_{body.profile.offset:g}"
    # A texture has several files if a coarser mesh takes over; its first count is in the name.
    if (folder / f"contact-{label}.csv").exists():
        label = f"{label}_from_Q{reached[0].Q}"
    write_fields(body, [end.state for end in reached], folder / f"fields-{label}.xdmf")
    tables = {(end.Q, end.p_over_E): surface_table(body, end.state) for end in reached}
    table = pd.concat(tables, names=["Q", "p_over_E"]).reset_index(["Q", "p_over_E"])
    write_csv(table, folder / f"contact-{label}.csv")
    save(plot_deformed(body, reached[-1].state), folder / f"deformed-{label}")
