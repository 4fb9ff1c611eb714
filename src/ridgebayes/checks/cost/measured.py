"""One setting of one method, timed and compared; and which settings are worth their price."""

import time
import tracemalloc
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pandas as pd

COST_COLUMNS = (
    "task",
    "method",
    "setting",
    "quantity",
    "error",
    "reference",
    "wall_s",
    "cpu_s",
    "cpu_s_spread",
    "peak_MiB",
    "repeats",
    "status",
)
SHORT_COLUMNS = ("task", "method", "error", "cpu_s")  # of the version in a run's report
LEVELS = (0.1, 0.01, 0.001)
_SLOW = 2.0  # seconds: what takes longer is not repeated
_QUICK, _MANY = 0.01, 25  # seconds under which so many runs are timed, after one that is not


@dataclass(frozen=True)
class Setting:
    """A way to compute something.

    Parameters
    ----------
    task, method, setting : str
        What is computed, how, and with which knob turned how far.
    compute : callable
        Returns a dict of quantity to relative or scaled error.
    reference : str
        What errors are counted from.
    """

    task: str
    method: str
    setting: str
    compute: Callable[[], dict[str, float]]
    reference: str


def measure(one: Setting, *, repeats: int = 3) -> list[dict[str, float | int | str]]:
    """Run a setting, and return its rows: one for each quantity.

    Parameters
    ----------
    one : Setting
        What to run.
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
    known = {"task": one.task, "method": one.method, "setting": one.setting}
    found: dict[str, float] = {}
    try:
        left, warm = repeats, False
        while left:
            wall, cpu = time.perf_counter(), time.process_time()
            found = one.compute()
            walls.append(time.perf_counter() - wall)
            cpus.append(time.process_time() - cpu)
            left -= 1
            if len(walls) == 1 and walls[0] > _SLOW:
                left = 0
            elif not warm and walls[0] < _QUICK:
                warm, walls, cpus, left = True, [], [], max(repeats, _MANY)
        tracemalloc.start()
        try:
            if walls[0] <= _SLOW:
                one.compute()
            peak = tracemalloc.get_traced_memory()[1] / 2**20 if walls[0] <= _SLOW else np.nan
        finally:
            tracemalloc.stop()
    except Exception as failed:  # a method that fails is a row, not the end
        row = dict.fromkeys(COST_COLUMNS, np.nan)
        text = {"quantity": "", "reference": one.reference, "status": f"failed: {failed}"}
        return [row | known | text | {"repeats": len(walls)}]
    return [
        {
            **known,
            "quantity": quantity,
            "error": abs(error),
            "reference": one.reference,
            "wall_s": float(np.median(walls)),
            "cpu_s": float(np.median(cpus)),
            "cpu_s_spread": float(np.subtract(*np.quantile(cpus, [0.75, 0.25]))) / 2,
            "peak_MiB": peak,
            "repeats": len(walls),
            "status": "ok",
        }
        for quantity, error in found.items()
    ]


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
            if enough.empty:
                said.append(f"{task}, {quantity}: nothing here reaches {level:.3g}.")
                continue
            row = enough.iloc[0]
            said.append(
                f"{task}, {quantity}: {level:.3g} is reached most cheaply by {row['method']} "
                f"({row['setting']}), in {row['cpu_s']:.2g} CPU seconds with an error of "
                f"{row['error']:.1e}."
            )
    return said
