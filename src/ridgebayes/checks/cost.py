"""Error and run time of each accuracy preset for posteriors, evidences and loads."""

import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from functools import partial
from numbers import Integral
from typing import TypeVar

import numpy as np
import pandas as pd

from ridgebayes._types import FloatArray, Rng
from ridgebayes.cautions import beyond_any_body
from ridgebayes.contact import halfplane
from ridgebayes.contact.scaling import Texture, reduced_load
from ridgebayes.errors import ComputationError, InputError, expect, warn_of
from ridgebayes.inference.importance import Drawn, at_least, importance_sample
from ridgebayes.inference.presets import PRESETS, REFERENCE
from ridgebayes.inference.target import ModelTarget
from ridgebayes.model.forms import Form, Hybrid, as_form
from ridgebayes.model.model import Model
from ridgebayes.model.noise import Noise
from ridgebayes.model.observations import Observations
from ridgebayes.request import TableLike
from ridgebayes.runtime.pool import map_ordered
from ridgebayes.runtime.randomness import seed_of
from ridgebayes.scene.scene import Scene
from ridgebayes.simulate.solvers import LOAD_PRESETS
from ridgebayes.table.table import read_table

COST_COLUMNS = ("task", "method", "preset", "target_error", "error", "cpu_s", "status")
_N_TRANSITIONS = 3  # transitions compared: finite elements take seconds for each
_Row = tuple[str, str, str, float, float, float, str]
_T = TypeVar("_T")


def cost(
    table: TableLike,
    form: Form | str | None = None,
    *,
    texture: Texture | None = None,
    elements: bool = False,
    repeats: int = 1,
    rng: Rng = 0,
    executor: Executor | None = None,
) -> pd.DataFrame:
    """Measure error and CPU seconds of each preset.

    Parameters
    ----------
    table : ContactTable, path or pandas.DataFrame
        Table whose calibration rows are fitted with independent errors.
    form : Form or str, optional
        Contact form; Hybrid if not given.
    texture : (float, float), optional
        a/R and b/R of the loads; the middle texture of the table if not given.
    elements : bool, optional
        Whether loads are also computed by finite elements, which takes a minute.
    repeats : int, optional
        Number of timed runs of each preset; the median time is returned.
    rng : int or numpy.random.Generator, optional
        Seed.
    executor : concurrent.futures.Executor, optional
        Executor of the presets, which run in turn if not given. Parallel runs distort timings.

    Returns
    -------
    pandas.DataFrame
        Columns task, method, preset, target_error, error, cpu_s, status. The error of a
        ``posterior`` is the largest error of a mean, sd, 5 or 95 % quantile in posterior sds, for
        the number of draws kept by a fit. The error of an ``evidence`` is in ln Z. The error of
        ``loads`` is the largest relative error of the first three transitions. The references are
        some hundred thousand draws for posteriors and evidences, a tolerance of 1e-12 for
        half-plane loads, and the finest mesh, whose own error is NaN. `status` is ``ok`` or the
        reason of a failure.

    Raises
    ------
    InputError
        If no row can be fitted, or an argument breaks a rule.

    Warns
    -----
    CautionWarning
        For widths and loads that no soft cylinder can have, such as those in another unit.

    Examples
    --------
    >>> import ridgebayes as rb
    >>> costs = rb.cost(rb.paper_sweep(), rb.Modified(), rng=1)
    >>> bool((costs["error"] < costs["target_error"]).all()), len(costs)
    (True, 9)
    """
    rows, seed = read_table(table).calibration, seed_of(rng)
    expect(Integral, repeats=repeats)
    expect(tuple, None, texture=texture)
    expect(bool, elements=elements)
    if repeats < 1:
        raise InputError(f"repeats: expected at least 1, got {repeats}")
    warn_of(beyond_any_body(rows))
    if texture is None:
        texture = rows.textures[len(rows.textures) // 2]
    (shape,) = Scene.of([texture]).textures  # checks the widths
    texture = shape.a_over_R, shape.b_over_R
    loads = reduced_load(rows.frame["p_over_E"].to_numpy(float), rows.frame["nu"].to_numpy(float))
    model = Model(Observations.from_table(rows), as_form(form or Hybrid()), Noise())
    try:
        exact = importance_sample(ModelTarget(model, seed), REFERENCE.effort.doubled, seed + 1)
        reference = _moments(model, exact), exact.evidence.value
    except ComputationError:  # the presets fail too, and report the reason
        reference = np.array(np.nan), np.nan
    tasks = {
        "posterior": partial(_posterior, model, *reference, repeats, seed),
        "half-plane": partial(_half_plane, texture, repeats),
        "finite elements": partial(_elements, texture, float(loads.max())),
    }
    names = list(tasks)[: 3 if elements else 2]
    settings = [(name, preset, tasks[name]) for name in names for preset in PRESETS]
    measured = map_ordered(_measured, settings, executor, name=lambda task: f"{task[0]}, {task[1]}")
    return pd.DataFrame([row for rows in measured for row in rows], columns=list(COST_COLUMNS))


def _measured(setting: tuple[str, str, Callable[[str], Iterator[_Row]]]) -> list[_Row]:
    """Return the rows of a preset, or a row with the reason of a failure."""
    task, preset, work = setting
    try:
        return list(work(preset))
    except (InputError, ComputationError) as error:
        return [(task, "", preset, np.nan, np.nan, np.nan, str(error))]


def _posterior(
    model: Model, exact: FloatArray, log_evidence: float, repeats: int, seed: int, name: str
) -> Iterator[_Row]:
    """Draw a posterior, and compare it with one of many more draws."""
    preset, method = PRESETS[name], "importance sampling"
    target = ModelTarget(model, seed)

    def draws() -> Drawn:
        drawn = importance_sample(target, preset.effort, seed)
        return at_least(drawn, target, preset.n_kept, preset.effort, seed + 2)  # as in a fit

    drawn, cpu_s = _timed(draws, repeats)
    error = float((np.abs(_moments(model, drawn) - exact) / exact[1]).max())
    yield "posterior", method, name, preset.moment_error, error, cpu_s, "ok"
    error = abs(drawn.evidence.value - log_evidence)
    yield "evidence", method, name, preset.evidence_error, error, cpu_s, "ok"


def _moments(model: Model, drawn: Drawn) -> FloatArray:
    """Return mean, sd, 5 and 95 % quantile of each outer parameter."""
    theta = model.outer_theta(drawn.u.reshape(-1, drawn.u.shape[-1]))
    return np.stack([theta.mean(axis=0), theta.std(axis=0), *np.quantile(theta, (0.05, 0.95), 0)])


def _half_plane(texture: Texture, repeats: int, name: str) -> Iterator[_Row]:
    """Compute loads by the half-plane equation, without cached loads of earlier calls."""
    (a, b), target = texture, LOAD_PRESETS[name].load_error

    def loads() -> FloatArray:
        halfplane.forget_loads()
        return halfplane.transition_loads(a, b, _N_TRANSITIONS, rel_tol=target).F

    F, cpu_s = _timed(loads, repeats)
    exact = halfplane.transition_loads(a, b, _N_TRANSITIONS, rel_tol=1e-12).F
    yield "loads", "half-plane", name, target, float(np.abs(F / exact - 1).max()), cpu_s, "ok"


def _elements(texture: Texture, p_max: float, name: str) -> Iterator[_Row]:
    """Compute loads by finite elements, and compare them with the finest mesh."""
    from ridgebayes.contact.cylinder.cylinder import Cylinder, transition_curve
    from ridgebayes.contact.rigid_profile import Profile

    a, b = texture
    half_plane = halfplane.transition_loads(a, b, _N_TRANSITIONS).p_over_E(a + b, nu=0.5)
    p_max = min(p_max, 1.02 * float(half_plane[-1]))

    def loads(edges: int) -> FloatArray:
        _, p_over_E, _ = transition_curve(Cylinder(Profile(a, b), p_max=p_max, edges=edges), p_max)
        return p_over_E[np.isfinite(p_over_E)]

    preset, finest = LOAD_PRESETS[name], LOAD_PRESETS[REFERENCE.name].edges
    edges = preset.edges
    p_over_E, cpu_s = _timed(lambda: loads(edges), 1)
    exact = p_over_E if edges == finest else loads(finest)
    n = min(len(p_over_E), len(exact))  # a coarse mesh may reach one more below the same load
    if n == 0:
        raise ComputationError(f"expected a transition under p/E = {p_max:g} at nu = 0.5, got none")
    error = np.nan if edges == finest else float(np.abs(p_over_E[:n] / exact[:n] - 1).max())
    yield "loads", f"finite elements, {edges} edges", name, preset.mesh_error, error, cpu_s, "ok"


def _timed(work: Callable[[], _T], repeats: int) -> tuple[_T, float]:
    """Return a result, and the median of the CPU seconds of repeated runs."""
    seconds = []
    for _ in range(repeats):
        began = time.process_time()
        result = work()
        seconds.append(time.process_time() - began)
    return result, float(np.median(seconds))
