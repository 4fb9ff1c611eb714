"""`ridgebayes cost`: error and run time of each accuracy for a table on this machine."""

from warnings import catch_warnings

from ridgebayes.cautions import beyond_any_body
from ridgebayes.checks.cost import cost
from ridgebayes.commands import table_options as options
from ridgebayes.commands.run_folder import new_folder, write_csv
from ridgebayes.commands.terminal import Answer, files_in, warn
from ridgebayes.errors import CautionWarning
from ridgebayes.runtime.pool import executor_for
from ridgebayes.runtime.progress import Progress
from ridgebayes.scene.scene import Scene
from ridgebayes.simulate.generation import generate
from ridgebayes.table.datafiles import paper_sweep
from ridgebayes.table.table import read_table

COST_CSV = "cost.csv"


def command(asked: options.Cost) -> Answer:
    """Measure error and run time of each accuracy and write them to cost.csv."""
    if asked.source is not None and asked.source.suffix == ".toml":
        scene = Scene.from_toml(asked.source)
        table, first = generate(scene, solver="half-plane"), scene.textures[0]
        texture = first.a_over_R, first.b_over_R
    else:
        table, texture = paper_sweep() if asked.source is None else read_table(asked.source), None
    warned = warn(*beyond_any_body(table))
    with (
        catch_warnings(action="ignore", category=CautionWarning),  # the answer has them
        new_folder(asked.out, force=asked.force, about=COST_CSV) as partial,
        Progress(1) as progress,
        executor_for(asked.workers, asked.scheduler) as executor,
    ):
        with progress.stage("accuracies"):
            costs = cost(
                table,
                texture=texture,
                elements=asked.elements,
                repeats=asked.repeats,
                rng=asked.seed,
                executor=executor,
            )
        write_csv(costs, partial / COST_CSV)
    failed = costs[costs["status"] != "ok"]
    problem = "\n".join(failed["task"] + ", " + failed["preset"] + ": " + failed["status"])
    shown = costs.drop(columns="status")
    return Answer((shown,), costs, files_in(asked.out), early=warned, problem=problem)
