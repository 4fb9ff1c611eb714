"""Bands of the coefficient of friction, and what share of their variance each term and input has.

Contact quantities of one draw depend on each other, and so do calibrated parameters. Sobol indices
are therefore those of groups that are independent: the contact as a whole, each parameter that is
known by a prior of its own, or all of them together where they were calibrated, subject, session,
rig and repeat. In two samples one group at a time is swapped (pick and freeze). Draws of the
contact are taken with replacement.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
import xarray as xr

from ridgebayes._types import FloatArray, Tabular
from ridgebayes.errors import InputError
from ridgebayes.friction.terms import EFFECTS, PARAMETERS, TERMS, coefficients, terms
from ridgebayes.runtime.randomness import stream

_N_BATCH, _N = 16, 1_024  # the spread between batches gives standard errors
_N_KEPT = 4_096
_N_BIN, _LEAST = 16, 64  # bins of a scene's value, and draws that a bin has in all batches
_SCALES = [PARAMETERS.index(name) for name in PARAMETERS if name.startswith(("tau_", "sigma"))]
_SCENE = ("a_over_R", "b_over_R", "nu", "offset", "radius", "youngs_modulus", "p_over_E", "Q")
BAND_COLUMNS = ["load", "p_over_E", "mu_mean", "mu_sd", "mu_median", "mu_lower", "mu_upper"]
BAND_COLUMNS += ["prob", "extrapolation"]
SHARE_COLUMNS = ["load", "p_over_E", "kind", "name", "share", "share_se", "total", "total_se"]


@dataclass(frozen=True, eq=False)
class FrictionInputs:
    """Quantities of joint draws that friction needs, without the edges.

    Parameters
    ----------
    load : ndarray of float, shape (n_load,)
        The dataset's coordinate.
    contact : ndarray of float, shape (n_draw, n_load, 3)
        E A/W, w/R and I/W.
    scene : dict of str to ndarray of float, shape (n_draw,) or (n_draw, n_load)
        Values of the scene, loads and counts.
    extrapolation : ndarray of float, shape (n_draw, n_load)
        1 where a draw lies beyond what was calibrated.
    """

    load: FloatArray
    contact: FloatArray
    scene: dict[str, FloatArray]
    extrapolation: FloatArray

    @classmethod
    def of(cls, inputs: "xr.Dataset | FrictionInputs", *, edges: bool) -> "FrictionInputs":
        """Return what a dataset of `friction_inputs` holds of it.

        Raises
        ------
        InputError
            If it lacks a variable, or edges have no forces: of round ridges.
        """
        if isinstance(inputs, FrictionInputs):
            return inputs
        needed = ["p_over_E", "contact_length_over_R", "contact_fraction"]
        needed += ["edge_x", "edge_side", "edge_G"] if edges else []
        if missing := [name for name in needed if name not in inputs]:
            hint = " (friction_inputs with edges=True, or kappa=0)" if "edge_G" in missing else ""
            raise InputError(f"inputs: expected {', '.join(needed)}, got no {missing[0]}{hint}")
        value = {name: inputs[name].to_numpy() for name in inputs if name in {*needed, *_SCENE}}
        p, length = value["p_over_E"], value["contact_length_over_R"]
        half_width = 0.5 * length / value["contact_fraction"]
        interlocking = np.zeros(p.shape)
        if edges:
            side, G = value["edge_side"], value["edge_G"]
            if np.isnan(G[side != 0]).any():
                raise InputError(
                    "inputs: interlocking needs sharp corners, and edge_G is NaN (round corners); "
                    "expected a scene without corner_radius, or FrictionModel(kappa=0)"
                )
            # Edges that face the centre, on ridges of each side; the mean of both directions.
            proximal = side * np.nan_to_num(value["edge_x"]) < 0
            interlocking = 0.5 * np.where(proximal, G, 0.0).sum(axis=2) / (2 * p)
        contact = np.stack([length / (2 * p), half_width, interlocking], axis=2)
        scene = {name: value[name].astype(np.float64) for name in _SCENE if name in value}
        beyond = inputs["extrapolation"].to_numpy().astype(np.float64)
        return cls(inputs["load"].to_numpy(), contact, scene, beyond)

    @classmethod
    def joined(cls, parts: "Sequence[FrictionInputs]") -> "FrictionInputs":
        """Return blocks of draws as one."""
        names = parts[0].scene
        scene = {name: np.concatenate([part.scene[name] for part in parts]) for name in names}
        contact = np.concatenate([part.contact for part in parts])
        beyond = np.concatenate([part.extrapolation for part in parts])
        return cls(parts[0].load, contact, scene, beyond)


@dataclass(frozen=True, eq=False, repr=False)
class FrictionBands(Tabular):
    """Bands of the coefficient of friction, with the shares of terms and inputs in their variance.

    Parameters
    ----------
    bands : pandas.DataFrame
        A row a load: load, p_over_E (its mean over draws), mu_mean, mu_sd, mu_median, mu_lower,
        mu_upper, prob, extrapolation (share of draws beyond what was calibrated).
    shares : pandas.DataFrame
        Rows of each load: load, p_over_E, kind, name, share, share_se, total, total_se. Kind
        ``term`` has cov(term, mu) over var(mu), which add up to 1. Kind ``input`` has first-order
        and total Sobol indices of independent groups. Kind ``scene`` has first-order indices of
        single quantities of the contact's draws, which overlap where they depend on each other.
    mu : ndarray of float, shape (4096, n_load), dimensionless
        Draws.

    Examples
    --------
    >>> import ridgebayes as rb
    >>> fit = rb.calibrate(rb.paper_sweep(), rb.Hybrid(), noise="iid", rng=1)
    >>> drawn = rb.friction_inputs(fit, rb.Scene.of([(0.022, 0.02)]), [0.003, 0.009], n=100, rng=1)
    >>> found = rb.FrictionModel(kappa=0).predict(drawn, rng=1)
    >>> (found.bands["mu_lower"] < found.bands["mu_upper"]).tolist()
    [True, True]
    >>> found.to_dataframe().equals(found.bands)
    True
    """

    bands: pd.DataFrame
    shares: pd.DataFrame
    mu: FloatArray

    def to_dataframe(self) -> pd.DataFrame:
        """Return the bands.

        Returns
        -------
        pandas.DataFrame
            A copy of `bands`.
        """
        return self.bands.copy()

    def __repr__(self) -> str:
        last = self.bands.iloc[-1]
        band = f"{last['mu_lower']:.3g} to {last['mu_upper']:.3g}"
        return f"FrictionBands(mu = {band} with {last['prob']:g} at p/E = {last['p_over_E']:.3g})"


def predicted(
    inputs: FrictionInputs,
    draw: Callable[[np.random.Generator, int], FloatArray],
    parameters: Mapping[str, Sequence[int]],
    *,
    seed: int,
    prob: float = 0.9,
) -> FrictionBands:
    """Predict friction from draws of the contact and of the parameters.

    Parameters
    ----------
    inputs : FrictionInputs
        Draws of the contact.
    draw : callable
        Generator and n to n independent draws of the parameters, shape (n, 9).
    parameters : mapping of str to sequence of int
        Independent groups of parameters, and their columns.
    seed : int
        Seed.
    prob : float, optional
        Probability inside the bands.

    Raises
    ------
    InputError
        If `prob` is not between 0 and 1.
    """
    if not 0 < prob < 1:
        raise InputError(f"prob: expected above 0 and below 1, got {prob!r}")
    rng, n, n_draw = stream(seed, "friction", "bands"), _N_BATCH * _N, len(inputs.contact)
    # Columns: which draw of the contact, parameters, scores of the effects.
    sample, other = (
        np.column_stack(
            [rng.integers(n_draw, size=n), draw(rng, n), rng.standard_normal((n, len(EFFECTS)))]
        )
        for _ in range(2)
    )
    groups = {"contact": [0]} | {k: [1 + j for j in columns] for k, columns in parameters.items()}
    for i, (name, j) in enumerate(zip(EFFECTS, _SCALES, strict=True)):
        if sample[:, 1 + j].any():
            groups[name] = [1 + len(PARAMETERS) + i]
    swaps = {name: sample.copy() for name in groups}
    for name, columns in groups.items():
        swaps[name][:, columns] = other[:, columns]
    bands, shares, kept = [], [], np.empty((_N_KEPT, len(inputs.load)))
    for j, load in enumerate(inputs.load.tolist()):
        contact = inputs.contact[:, j]
        by_term, mu = _evaluated(sample, contact)
        kept[:, j] = mu[:_N_KEPT]
        lower, median, upper = np.quantile(mu, [0.5 - prob / 2, 0.5, 0.5 + prob / 2])
        at = (load, float(inputs.scene["p_over_E"][:, j].mean()))
        beyond = float(inputs.extrapolation[:, j].mean())
        bands.append((*at, mu.mean(), mu.std(), median, lower, upper, prob, beyond))
        rows = [("term", *row) for row in _term_shares(by_term, mu)]
        swapped = {name: _evaluated(points, contact)[1] for name, points in swaps.items()}
        rows += [("input", *row) for row in _sobol(mu, _evaluated(other, contact)[1], swapped)]
        rows += [("scene", *row) for row in _scene_shares(inputs, j, sample, float(mu.var()))]
        shares += [(*at, *row) for row in rows]
    frame = pd.DataFrame(bands, columns=BAND_COLUMNS)
    return FrictionBands(frame, pd.DataFrame(shares, columns=SHARE_COLUMNS), kept)


def _effects(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return parameters of points, and what effects multiply mu by."""
    theta, score = np.split(points[:, 1:], [len(PARAMETERS)], axis=1)
    return theta, np.exp((score * theta[:, _SCALES]).sum(axis=1))


def _evaluated(points: FloatArray, contact: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the terms with their effects, (n, 3), and mu at contacts of one load."""
    theta, effect = _effects(points)
    shares_of_terms = terms(contact[points[:, 0].astype(np.int64)], theta) * effect[:, None]
    return shares_of_terms, shares_of_terms.sum(axis=1)


_Row = tuple[str, float, float, float, float]


def _mean_and_se(values: FloatArray) -> tuple[float, float]:
    """Return the mean over batches and its standard error."""
    return float(values.mean()), float(values.std(ddof=1) / np.sqrt(len(values)))


def _term_shares(by_term: FloatArray, mu: FloatArray) -> list[_Row]:
    """Return cov(term, mu)/var(mu) of every term that is there."""
    batches = mu.reshape(_N_BATCH, _N)
    off = batches - batches.mean(axis=1, keepdims=True)
    indices = []
    for name, values in zip(TERMS, by_term.T, strict=True):
        if values.any():
            share = (values.reshape(_N_BATCH, _N) * off).sum(axis=1) / (off * off).sum(axis=1)
            indices.append((name, *_mean_and_se(share), np.nan, np.nan))
    return indices


def _sobol(row: FloatArray, other: FloatArray, swapped: Mapping[str, FloatArray]) -> list[_Row]:
    """Return first-order and total indices of every group, of each batch by itself."""
    from scipy import stats  # a third of a second that not every command spends

    of_batches = {
        "f_A": row.reshape(_N_BATCH, _N),
        "f_B": other.reshape(_N_BATCH, _N),
        "f_AB": np.stack([values.reshape(_N_BATCH, _N) for values in swapped.values()]),
    }
    summands = stats.sobol_indices(func=of_batches, n=_N)
    first = summands.first_order.reshape(_N_BATCH, -1).T  # one group alone comes without its axis
    total = summands.total_order.reshape(_N_BATCH, -1).T
    rows = zip(swapped, first, total, strict=True)
    return [(name, *_mean_and_se(share), *_mean_and_se(most)) for name, share, most in rows]


def _scene_shares(
    inputs: FrictionInputs, j: int, points: FloatArray, variance: float
) -> Iterator[_Row]:
    """Yield var(E[mu | value])/var(mu) of single values, from the draws that there are.

    Parameters and effects do not depend on the contact: given it, mu has a known mean.
    """
    theta, effect = _effects(points)
    factors = (coefficients(theta) * effect[:, None]).mean(axis=0)
    mean = inputs.contact[:, j] @ factors[:3] + factors[3]
    for name, values in inputs.scene.items():
        value = values if values.ndim == 1 else values[:, j]
        if np.ptp(value) > 0 and len(value) >= _LEAST * _N_BATCH:
            batches = zip(*(np.array_split(x, _N_BATCH) for x in (value, mean)), strict=True)
            _, se = _mean_and_se(np.array([_between(*pair) for pair in batches]))
            yield name, _between(value, mean) / variance, se / variance, np.nan, np.nan


def _between(value: FloatArray, mean: FloatArray) -> float:
    """Return the variance of the means of bins, less what it has by chance."""
    distinct, codes = np.unique(value, return_inverse=True)
    if len(distinct) > _N_BIN:
        codes = np.argsort(np.argsort(value)) * _N_BIN // len(value)
    number = np.bincount(codes)
    means = np.bincount(codes, weights=mean) / number
    between = float((number * (means - mean.mean()) ** 2).sum())
    within = float(((mean - means[codes]) ** 2).sum()) / max(len(mean) - len(number), 1)
    return (between - (len(number) - 1) * within) / len(mean)
