"""Make the samples of files that `ridgebayes import` reads: `python data/make_import_samples.py`.

Numbers are those of the run in `fea/calculix`, but for `fea/series`, which the package's own finite
elements make (seconds). Abaqus wrote none of them: its layouts are written here from that run by
`tests/fea/abaqus_writer.py`, and say so.
"""

import runpy
from pathlib import Path

import pandas as pd

from ridgebayes.commands.fields import generate_fields
from ridgebayes.fea.calculix import read_calculix
from ridgebayes.fea.deck import Run, read_deck
from ridgebayes.fea.record import Given
from ridgebayes.scene.scene import Scene
from ridgebayes.table.table import read_table

FEA = Path(__file__).parent / "fea"
WRITER = Path(__file__).parents[1] / "tests" / "fea" / "abaqus_writer.py"


def abaqus() -> None:
    """Write the run's rim and force as Abaqus prints them."""
    writer, folder = runpy.run_path(str(WRITER)), FEA / "abaqus"
    folder.mkdir(exist_ok=True)
    calculix = FEA / "calculix"
    facts, deck = Given(surface="NARC", reaction="NTOP"), read_deck(calculix / "ridges.inp")
    run = Run(0.03, 0.02, paths=[calculix / "ridges.dat"], facts=facts, deck=deck)
    history = read_calculix(run)
    force, nodes = history.load, history.undeformed
    moved = history.at - nodes
    text = writer["dat_text"](force, nodes, nodes + moved, surface="RIM", reaction="TOP")
    (folder / "ridges.dat").write_text(text, encoding="ascii")
    rim = [f"{i}, {x:.13g}, {y:.13g}" for i, (x, y) in enumerate(nodes, start=1)]
    driven = len(nodes) + 1
    rigid = [deck.nodes[n] for n in deck.nsets["NRID"]]
    ridges = [f"{driven + 1 + i}, {x:.13g}, {y:.13g}" for i, (x, y) in enumerate(rigid)]
    lines = ["** not from Abaqus: nodes, sets and body of fea/calculix/ridges.inp"]
    lines += ["*NODE, NSET=RIM", *rim, "*NODE, NSET=TOP", f"{driven}, 0., 0."]
    lines += ["*NODE, NSET=RIDGES", *ridges, "*MATERIAL, NAME=BODY"]
    lines += [f"*ELASTIC\n{deck.E:.9g}, {deck.nu:.9g}"]
    (folder / "ridges.inp").write_text("\n".join(lines) + "\n", encoding="ascii")


def tables() -> None:
    """Write the run's table with a reader's own columns and units, for R = 8 mm and E = 60 kPa."""
    folder = FEA / "tables"
    folder.mkdir(exist_ok=True)
    frame = read_table(FEA / "calculix" / "ridges.csv").frame
    R, E = 8.0, 60.0
    own = pd.DataFrame(
        {
            "Ridge width [mm]": (frame["a_over_R"] * R).round(9),
            "Groove width [mm]": (frame["b_over_R"] * R).round(9),
            "Ridges touched": frame["Q"],
            "Line load [N/m]": frame["p_over_E"] * 2 * R * E,  # mm kPa
        }
    )
    own.to_csv(folder / "long.csv", index=False)
    own.to_csv(folder / "long.tsv", index=False, sep="\t")
    own.to_parquet(folder / "long.parquet", index=False)
    own.to_excel(folder / "long.xlsx", index=False)
    loads = {
        f"Q={q}": [p] for q, p in zip(own["Ridges touched"], own["Line load [N/m]"], strict=True)
    }
    wide = pd.DataFrame({**own.iloc[:1, :2].to_dict("list"), **loads})
    # Decimal commas and semicolons, as spreadsheets of half the world write them.
    wide.to_csv(folder / "wide.csv", index=False, sep=";", decimal=",")


if __name__ == "__main__":
    abaqus()
    tables()
    scene = Scene.of([(0.03, 0.02)], p_over_E=0.006, nu=0.49)
    generate_fields(scene, FEA / "series", solver="cylinder-fe", force=True)
    for name in (FEA / "series").glob("deformed-*"):
        name.unlink()
