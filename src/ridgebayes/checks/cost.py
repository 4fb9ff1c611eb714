"""Error and run time of each accuracy: posteriors, their evidences, and loads."""

import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import pandas as pd

from ridgebayes._types import FloatArray, Rng
from ridgebayes.contact import halfplane
from ridgebayes.errors import ComputationError, InputError
from ridgebayes.inference.importance import Drawn, importance_sample
from ridgebayes.inference.presets import PRESETS, REFERENCE
from ridgebayes.inference.target import ModelTarget
from ridgebayes.model.forms import Form, Hybrid
from ridgebayes.model.model import Model
from ridgebayes.model.noise import Noise
from ridgebayes.model.observations import Observations
from ridgebayes.runtime.pool import map_ordered
from ridgebayes.runtime.randomness import seed_of
from ridgebayes.simulate.generation import LOAD_PRESETS
from ridgebayes.simulate.solvers import ELEMENTS_SE
from ridgebayes.table.table import ContactTable

COST_COLUMNS = ("task", "method", "preset", "target_error", "error", "cpu_s", "status")
_N_LOAD = 3  # transitions that are compared: finite elements take seconds for each
_Row = tuple[str, str, str, float, float, float, str]
_T = TypeVar("_T")


@dataclass(frozen=True)
class _Setting:
    """One preset of one task; holds all that a process of its own needs."""

    task: str
    preset: str
    model: Model
    exact: FloatArray  # moments of very many draws
    log_evidence: float
    texture: tuple[float, float]
    p_max: float
    repeats: int
    seed: int

    @property
    def name(self) -> str:
        """Name for errors."""
        return f"{self.task}, {self.preset}"


def accuracy_costs(
    table: ContactTable,
    form: Form | None = None,
    *,
    texture: tuple[float, float] | None = None,
    elements: bool = False,
    repeats: int = 1,
    rng: Rng = 0,
    executor: Executor | None = None,
) -> pd.DataFrame:
    """Measure error and CPU seconds of each preset.

    Parameters
    ----------
    table : ContactTable
        Its calibration rows are fitted with independent errors.
    form : Form, optional
        Contact form; Hybrid if not given.
    texture : (float, float), optional
        a/R and b/R of the loads; the middle texture of the table if not given.
    elements : bool, optional
        Whether loads are also computed by finite elements, which takes a minute.
    repeats : int, optional
        Timed runs of each preset; the median time counts.
    rng : int or numpy.random.Generator, optional
        Seed.
    executor : concurrent.futures.Executor, optional
        Executor of the presets; one after another if not given. Parallel runs distort timings.

    Returns
    -------
    pandas.DataFrame
        Columns task, method, preset, target_error, error, cpu_s, status. Errors of a ``posterior``
        are the largest of a mean, sd, 5 or 95 % quantile, in posterior sds; of an ``evidence`` in
        ln Z; of ``loads`` the largest relative one of the first three transitions. Posteriors and
        evidences are compared with some hundred thousand draws, half-plane loads with 24
        coefficients a strip, finite elements with the finest mesh, whose own error is NaN.
        `status`: ``ok``, or why there is no number.

    Examples
    --------
    >>> import ridgebayes as rb
    >>> costs = accuracy_costs(rb.paper_sweep(), rb.Modified(), rng=1)
    >>> bool((costs["error"] < costs["target_error"]).all()), len(costs)
    (True, 9)
    """
    data, rows = Observations.from_table(table), table.calibration
    textures = rows.textures
    texture = texture or textures[len(textures) // 2]
    p_max = float(rows.frame["p_over_E"].max())
    model, seed = Model(data, form or Hybrid(), Noise()), seed_of(rng)
    try:
        exact = importance_sample(ModelTarget(model, seed), REFERENCE.effort.doubled, seed + 1)
        best = _moments(model, exact), exact.evidence.value
    except ComputationError:  # the presets fail likewise, and say why
        best = np.array(np.nan), np.nan
    settings = [
        _Setting(task, preset, model, *best, texture, p_max, repeats, seed)
        for task in list(_TASKS)[: 3 if elements else 2]
        for preset in PRESETS
    ]
    measured = map_ordered(_measured, settings, executor, name=lambda setting: setting.name)
    return pd.DataFrame([row for rows in measured for row in rows], columns=list(COST_COLUMNS))


def _measured(setting: _Setting) -> list[_Row]:
    """Return the rows of a preset; the reason where it fails."""
    try:
        return list(_TASKS[setting.task](setting))
    except (InputError, ComputationError) as error:
        nothing = (np.nan, np.nan, np.nan)
        return [(setting.task, "", setting.preset, *nothing, str(error))]


def _posterior(setting: _Setting) -> Iterator[_Row]:
    """Draw a posterior, and compare with many more draws."""
    preset, model, seed = PRESETS[setting.preset], setting.model, setting.seed

    def draw() -> Drawn:
        return importance_sample(ModelTarget(model, seed), preset.effort, seed)

    drawn, cpu_s = _timed(draw, setting.repeats)
    exact = setting.exact
    error = float((np.abs(_moments(model, drawn) - exact) / exact[1]).max())
    how = ("importance sampling", preset.name)
    yield "posterior", *how, preset.moment_error, error, cpu_s, "ok"
    error = abs(drawn.evidence.value - setting.log_evidence)
    yield "evidence", *how, preset.evidence_error, error, cpu_s, "ok"


def _moments(model: Model, drawn: Drawn) -> FloatArray:
    """Return mean, sd, 5 and 95 % quantile of each outer parameter."""
    theta = model.outer_theta(drawn.u.reshape(-1, drawn.u.shape[-1]))
    return np.stack([theta.mean(axis=0), theta.std(axis=0), *np.quantile(theta, (0.05, 0.95), 0)])


def _half_plane(setting: _Setting) -> Iterator[_Row]:
    """Solve for loads by the half-plane equation, without the loads kept from earlier calls."""
    preset, (a, b) = LOAD_PRESETS[setting.preset], setting.texture

    def loads() -> FloatArray:
        halfplane.forget_loads()
        return halfplane.transition_loads(a, b, _N_LOAD, rel_tol=preset.load_error).F

    F, cpu_s = _timed(loads, setting.repeats)
    error = float(np.abs(F / halfplane.solve_strips(2 * b / a, _N_LOAD, 24).F - 1).max())
    yield "loads", "half-plane", preset.name, preset.load_error, error, cpu_s, "ok"


def _elements(setting: _Setting) -> Iterator[_Row]:
    """Solve for loads by finite elements, and compare with the finest mesh."""
    from ridgebayes.contact.cylinder.cylinder import Cylinder, transition_curve
    from ridgebayes.contact.rigid_profile import Profile

    a, b = setting.texture
    half_plane = halfplane.transition_loads(a, b, _N_LOAD).p_over_E(a + b, nu=0.5)
    p_max = min(setting.p_max, 1.02 * float(half_plane[-1]))

    def loads(edges: int) -> FloatArray:
        _, p_over_E, _ = transition_curve(Cylinder(Profile(a, b), p_max=p_max, edges=edges), p_max)
        return p_over_E[np.isfinite(p_over_E)]

    edges, finest = (LOAD_PRESETS[name].meshes[0] for name in (setting.preset, REFERENCE.name))
    p_over_E, cpu_s = _timed(lambda: loads(edges), 1)
    error = np.nan
    if edges != finest:
        exact = loads(finest)
        if not 0 < len(p_over_E) == len(exact):
            raise ComputationError(f"{len(p_over_E)} of {len(exact)} transitions")
        error = float(np.abs(p_over_E / exact - 1).max())
    target = ELEMENTS_SE[edges]
    yield "loads", f"finite elements, {edges} edges", setting.preset, target, error, cpu_s, "ok"


def _timed(work: Callable[[], _T], repeats: int) -> tuple[_T, float]:
    """Return a result, and the median of the CPU seconds of repeated runs."""
    seconds = []
    for _ in range(repeats):
        began = time.process_time()
        result = work()
        seconds.append(time.process_time() - began)
    return result, float(np.median(seconds))


_TASKS = {"posterior": _posterior, "half-plane": _half_plane, "finite elements": _elements}
