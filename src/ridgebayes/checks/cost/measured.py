"""One setting of one method, timed and compared; and which settings are worth their price."""

import math
import time
import tracemalloc
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

import numpy as np
import pandas as pd

from ridgebayes.comparison.comparison import Comparison
from ridgebayes.comparison.ranking import best_form
from ridgebayes.contact.halfplane import transition_loads
from ridgebayes.errors import ComputationError, InputError
from ridgebayes.inference.importance import importance_sample
from ridgebayes.inference.posterior import Posterior, posterior_of
from ridgebayes.inference.presets import QUICK
from ridgebayes.inference.target import ModelTarget

_KNOWN = ("task", "method", "setting", "quantity", "error", "reference")
_SPENT = ("wall_s", "cpu_s", "cpu_s_spread", "peak_MiB", "repeats", "status")
COST_COLUMNS = _KNOWN + _SPENT
SHORT_COLUMNS = ("task", "method", "error", "cpu_s")  # of the version in a run's report
LEVELS = (0.1, 0.01, 0.001)
_SLOW = 2.0  # seconds: what takes longer is not repeated
_QUICK, _MANY = 0.01, 25  # seconds under which so many runs are timed, after one that is not
_T = TypeVar("_T")
_Knob = TypeVar("_Knob")
_Row = dict[str, float | int | str]


@dataclass(frozen=True)
class Setting:
    """A way to compute something.

    Parameters
    ----------
    task, method, setting : str
        Names of the task and of the method, and the value of the option that varies.
    compute : callable
        Returns a dict of quantity to relative or scaled error.
    reference : str
        Name of the result that errors are measured against.
    """

    task: str
    method: str
    setting: str
    compute: Callable[[], dict[str, float]]
    reference: str


Way = tuple[str, str, Callable[[], _T]]  # method, setting, what computes it


def turned(
    method: str, setting: str, compute: Callable[[_Knob], _T], knobs: Iterable[_Knob]
) -> list[Way[_T]]:
    """List the ways to compute something that one knob gives; ``{}`` in the setting is its."""
    return [(method, setting.format(knob), partial(compute, knob)) for knob in knobs]


def settings(
    task: str, reference: str, errors: Callable[[_T], dict[str, float]], ways: Iterable[Way[_T]]
) -> list[Setting]:
    """Return ways to compute something as settings; `errors` says how far off a result is."""

    def off(compute: Callable[[], _T]) -> dict[str, float]:
        return errors(compute())

    return [
        Setting(task, method, setting, partial(off, compute), reference)
        for method, setting, compute in ways
    ]


def measure(one: Setting, *, repeats: int = 3) -> list[_Row]:
    """Run a setting, and return its rows: one for each quantity.

    Parameters
    ----------
    one : Setting
        Setting to run.
    repeats : int, optional
        Timed runs where one takes under two seconds (25 where it takes under a hundredth); their
        medians count, and half the range between quartiles of their CPU times is their spread.

    Returns
    -------
    list of dict
        With the keys `COST_COLUMNS`. Where it fails there is one row, whose status says why.

    Notes
    -----
    Peak memory is that of arrays and objects allocated by Python, in a run of its own, which is
    not timed.
    """
    walls, cpus = list[float](), list[float]()
    found: dict[str, float] = {}

    def row(quantity: str, error: float, spent: Sequence[float], status: str) -> _Row:
        known = (one.task, one.method, one.setting, quantity, error, one.reference)
        return dict(zip(COST_COLUMNS, (*known, *spent, len(walls), status), strict=True))

    def run() -> None:
        nonlocal found
        wall, cpu = time.perf_counter(), time.process_time()
        found = one.compute()
        walls.append(time.perf_counter() - wall)
        cpus.append(time.process_time() - cpu)

    peak = math.nan
    try:
        run()
        if walls[0] < _QUICK:  # the first run is not warm
            walls, cpus, repeats = [], [], max(repeats, _MANY)
        while len(walls) < repeats and not (walls and walls[0] > _SLOW):
            run()
        if walls[0] <= _SLOW:
            tracemalloc.start()
            one.compute()
            peak = tracemalloc.get_traced_memory()[1] / 2**20
    except Exception as failed:  # a method that fails is a row, not the end
        return [row("", math.nan, [math.nan] * 4, f"failed: {failed}")]
    finally:
        tracemalloc.stop()
    spread = np.subtract(*np.quantile(cpus, [0.75, 0.25])) / 2
    spent = [float(np.median(walls)), float(np.median(cpus)), float(spread), peak]
    return [row(quantity, abs(error), spent, "ok") for quantity, error in found.items()]


def pareto(frame: pd.DataFrame) -> "pd.Series[bool]":
    """Tell which rows no other of the same task and quantity beats in both error and time."""
    ok = frame[(frame["status"] == "ok") & frame["error"].notna()]
    found = []
    for _, group in ok.groupby(["task", "quantity"]):
        ordered = group.sort_values(["cpu_s", "error"])
        before = ordered["error"].cummin().shift(fill_value=np.inf)
        found += ordered.index[ordered["error"] < before].tolist()
    return pd.Series(frame.index.isin(found), index=frame.index)


def cheapest(frame: pd.DataFrame) -> list[str]:
    """Say, for each task and quantity, the cheapest setting that reaches 10, 1 and 0.1 %."""
    said = []
    ok = frame[frame["status"] == "ok"]
    for (task, quantity), group in ok.groupby(["task", "quantity"], sort=False):
        for level in LEVELS:
            enough = group[group["error"] <= level].sort_values("cpu_s")
            said.append(f"{task}, {quantity}: nothing here reaches {level:.3g}.")
            for row in enough.head(1).to_dict("records"):
                said[-1] = (
                    f"{task}, {quantity}: {level:.3g} is reached most cheaply by {row['method']} "
                    f"({row['setting']}), in {row['cpu_s']:.2g} CPU seconds with an error of "
                    f"{row['error']:.1e}."
                )
    return said


def short_costs(comparison: Comparison, stages: Sequence[dict[str, Any]]) -> pd.DataFrame:
    """Measure errors and CPU seconds of a few ways to a comparison's best form.

    Parameters
    ----------
    comparison : Comparison
        Finished.
    stages : sequence of dict
        Its stages' names and times.

    Returns
    -------
    pandas.DataFrame
        Columns `SHORT_COLUMNS`. Errors of loads are the largest relative to the table's, of
        posteriors the largest of a mean over its sd, of evidences in ln Z, against the run's own
        numbers; of the run's own they are the Monte Carlo standard errors.
    """
    name = best_form(comparison) or next(iter(comparison.fits))
    fit, own = comparison.fits[name], comparison.own_evidence
    spent = {str(stage["name"]): float(stage["cpu_s"]) for stage in stages}
    # CPU seconds of all forms under all error models.
    drawn = spent.get("evidences", math.nan) + spent.get("posteriors", math.nan)
    walked = spent.get(f"walk {name}", math.nan)
    error = float((fit.summary["mcse_mean"] / fit.summary["sd"]).max())
    rows: list[tuple[str, str, float, float]] = [*_loads(comparison, fit)]
    own = own[own["form"] == name].set_index("method")
    value = own["log_evidence"].get("importance", math.nan)
    rows += _second_look(fit, float(value))
    rows.append(("posterior", "this run, every form and error model", error, drawn))
    for method, found in own.iterrows():
        seconds = walked if method == "bridge" else drawn
        rows.append(("evidence", f"this run, {method}", float(found["log_evidence_se"]), seconds))
    return pd.DataFrame(rows, columns=list(SHORT_COLUMNS))


def _timed(work: Callable[[], _T]) -> tuple[_T, float]:
    began = time.process_time()
    found = work()
    return found, time.process_time() - began


def _loads(comparison: Comparison, fit: Posterior) -> Iterator[tuple[str, str, float, float]]:
    """Yield the best form and the half-plane on one calibrated texture."""
    frame = comparison.table.calibration.frame
    frame = frame[(frame["kind"] == "transition") & (frame["offset_over_R"] == 0)]
    textures = list(dict.fromkeys(zip(frame["a_over_R"], frame["b_over_R"], strict=True)))
    if not textures:
        return
    a, b = textures[len(textures) // 2]
    rows = frame[(frame["a_over_R"] == a) & (frame["b_over_R"] == b)].sort_values("Q")
    rows = rows.drop_duplicates("Q")
    Q, p = rows["Q"].to_numpy(), rows["p_over_E"].to_numpy()
    nu = float(rows["nu"].to_numpy()[0])
    mean = fit.summary["mean"].to_numpy()[: fit.model.n_coefficient]
    found, seconds = _timed(lambda: fit.form.load(Q, a, b, mean, nu))
    what = f"{fit.form.name} form, a/R = {a:g}, b/R = {b:g}"
    yield "loads", what, float(np.abs(found / p - 1).max()), seconds
    try:
        loads, seconds = _timed(lambda: transition_loads(a, b, int(Q.max()) // 2 - 1))
    except InputError:
        return
    off = loads.p_over_E(a + b, nu=nu)[Q // 2 - 2] / p - 1
    yield "loads", "half-plane, same texture", float(np.abs(off).max()), seconds


def _second_look(fit: Posterior, value: float) -> Iterator[tuple[str, str, float, float]]:
    """Yield the quick preset's draws, beside the run's own means and evidence."""
    mean, sd = fit.summary["mean"], fit.summary["sd"]

    def quick() -> tuple[float, float]:
        drawn = importance_sample(ModelTarget(fit.model, fit.seed), QUICK.effort, fit.seed)
        again = posterior_of(fit.model, drawn, fit.seed).summary["mean"]
        return float((np.abs(again - mean) / sd).max()), abs(drawn.evidence.value - value)

    try:
        (error, apart), seconds = _timed(quick)
    except ComputationError:
        return
    yield "posterior", "importance sampling, preset quick", error, seconds
    yield "evidence", "importance sampling, preset quick", apart, seconds
