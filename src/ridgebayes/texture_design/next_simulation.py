"""Propose the texture whose next simulation discriminates best between two forms."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from scipy import special, stats

from ridgebayes._types import FloatArray
from ridgebayes.contact.scaling import Texture
from ridgebayes.inference.posterior import Posterior
from ridgebayes.predict.extrapolation import CalibratedRange
from ridgebayes.predict.joint_draws import RatioLoads
from ridgebayes.runtime.randomness import stream
from ridgebayes.texture_design.goal_values import ratio_loads
from ridgebayes.texture_design.sensitivity import N_INNER

_MAX_TEXTURES = 64  # candidates
_COLUMNS = ["a_over_R", "b_over_R", "Q", "p_over_E", "information", "form_a", "form_b"]
Form = Sequence[tuple[Posterior, float]]  # posteriors and weights of a form


def next_simulation(forms: Sequence[Form], textures: Sequence[Texture], seed: int) -> pd.DataFrame:
    """Rank textures by how well one further load discriminates between two forms.

    Parameters
    ----------
    forms : sequence of Form
        The two leading forms.
    textures : sequence of (float, float)
        Candidates, of which at most 64, evenly spaced, are considered.
    seed : int
        Seed.

    Returns
    -------
    pandas.DataFrame
        Columns a_over_R, b_over_R, Q (the highest count whose load was calibrated), p_over_E (its
        median load), information (expected, in nats, on which form is right if both are equally
        probable; at most ln 2), form_a and form_b. The best texture is first.

    Notes
    -----
    Nested Monte Carlo: loads are drawn from each form, and their densities under both forms are
    averages over draws of coefficients. Only the highest load is considered. A simulation also
    gives the lower loads, whose errors depend on that of the highest, so the information is a lower
    bound.
    """
    if len(forms) < 2 or not textures:
        return pd.DataFrame(columns=_COLUMNS)
    names = [form[0][0].form.name for form in forms]
    places = np.linspace(0, len(textures) - 1, _MAX_TEXTURES).astype(int)
    chosen = list(dict.fromkeys(textures[i] for i in places))
    ratios = [a / (a + b) for a, b in chosen]
    ends = min(ratios), max(ratios)
    parts = [ratio_loads(form, ends) for form in forms]
    ranges = [CalibratedRange.of(form[0][0]) for form in forms]
    load_max, count_max = (min(getattr(x, name) for x in ranges) for name in ("load_max", "Q_max"))
    rows = []
    for a, b in chosen:
        count, load = _count_within(parts[0][0][0], (a, b), load_max, count_max)
        drawn = [_log_loads(form, (a, b), count) for form in parts]
        gained = _information(drawn, stream(seed, "next simulation"))
        rows.append((a, b, count, load, gained, *names))
    frame = pd.DataFrame(rows, columns=_COLUMNS)
    return frame.sort_values("information", ascending=False, kind="stable", ignore_index=True)


def _count_within(
    loads: RatioLoads, texture: Texture, load_max: float, count_max: int
) -> tuple[int, float]:
    """Return the highest count (at least 4) whose median load was calibrated, and the load."""
    a, b = texture
    highest = 4, 0.0
    for count in range(4, count_max + 2, 2):
        location, _ = loads.at_count(count, slice(None), a / (a + b))
        load = float(np.exp(np.median(location))) * (a + b) ** 2
        if count > 4 and load > load_max:
            break
        highest = count, load
    return highest


def _log_loads(
    form: Sequence[tuple[RatioLoads, float]], texture: Texture, count: int
) -> tuple[FloatArray, FloatArray]:
    """Return location and scale of draws of a form, divided among its error models."""
    a, b = texture
    parts = []
    for loads, weight in form:
        n = max(round(N_INNER * weight), 1)
        which = np.linspace(0, len(loads.loads) - 1, n).astype(int)
        location, scale = loads.at_count(count, which, a / (a + b))
        parts.append((location, np.broadcast_to(scale, location.shape)))
    location, scale = (np.concatenate(column) for column in zip(*parts, strict=True))
    kept = np.isfinite(location)
    return location[kept], scale[kept]


def _information(forms: Sequence[tuple[FloatArray, FloatArray]], rng: np.random.Generator) -> float:
    """Return the expected information on which of two normal mixtures a value comes from."""
    gained = 0.0
    for i, (location, scale) in enumerate(forms):
        y = location + scale * rng.standard_normal(len(location))
        densities = np.stack([_log_density(y, *form) for form in forms])
        mixture = special.logsumexp(densities, axis=0) - np.log(2)
        gained += 0.5 * float(np.mean(densities[i] - mixture))
    return max(gained, 0.0)


def _log_density(y: FloatArray, location: FloatArray, scale: FloatArray) -> FloatArray:
    with np.errstate(over="ignore"):  # of values far from a draw without error
        log_terms = stats.norm.logpdf(y[:, None], location, scale)
    return np.asarray(special.logsumexp(log_terms, axis=1) - np.log(len(location)))
