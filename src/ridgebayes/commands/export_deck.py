"""`ridgebayes export-deck`: write a scene as an input deck for a finite-element program."""

from ridgebayes.commands import table_options as options
from ridgebayes.commands.parsing import medians_taken, refuse_output
from ridgebayes.commands.terminal import Answer
from ridgebayes.fea.deck_text import REACTION, SURFACE, export_deck
from ridgebayes.scene.scene import Scene


def command(asked: options.ExportDeck) -> Answer:
    """Write the deck; print the command that imports its results."""
    refuse_output(asked.out, asked.force, ".inp")
    disk = export_deck(asked.scene, asked.program, asked.out, edges=asked.edges)
    scene, out = Scene.from_toml(asked.scene), asked.out
    (texture,) = scene.textures
    corner = f" --corner {radius:g}" if (radius := texture.corner_radius_over_R) else ""
    n_cell, n_level = len(disk.cells), len(disk.displacements)
    lines = (
        f"{out}: {n_cell} elements, {n_level} levels, R = 1, E = 1",
        f"import the run with: ridgebayes import {out.with_suffix('.dat')} --deck {out} "
        f"--surface {SURFACE} --reaction {REACTION} --texture {texture.a_over_R:g},"
        f"{texture.b_over_R:g} --nu {scene.nu:g}{corner} -o TABLE.csv",
        *medians_taken(scene.uncertain_names),
    )
    return Answer(lines, {"elements": n_cell, "levels": n_level}, [out])
