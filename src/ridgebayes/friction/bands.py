"""Bands of the coefficient of friction, and the shares of terms and inputs in their variance.

Contact quantities of a draw depend on each other, and so do calibrated parameters. Sobol indices
are therefore computed for independent groups: the contact, each parameter with a prior (or all
calibrated parameters together), subject, session, rig and repeat. Two samples swap one group at a
time (pick and freeze). Draws of the contact are resampled with replacement.
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

_N_BATCH, _BATCH = 16, 1_024  # number and size of batches, whose spread gives standard errors
_N_KEPT = 4_096  # draws returned
_N_BIN = 16  # bins of a scene's value
_SCALES = [PARAMETERS.index(name) for name in PARAMETERS if name.startswith(("tau_", "sigma"))]
_SCENE = ("a_over_R", "b_over_R", "nu", "offset", "radius", "youngs_modulus", "p_over_E", "Q")
BAND_COLUMNS = ["load", "p_over_E", "mu_mean", "mu_sd", "mu_median", "mu_lower", "mu_upper"]
BAND_COLUMNS += ["prob", "extrapolation"]
SHARE_COLUMNS = ["load", "p_over_E", "kind", "name", "share", "share_se", "total", "total_se"]


@dataclass(frozen=True, eq=False)
class FrictionInputs:
    """Quantities of joint draws on which friction depends.

    Parameters
    ----------
    load : ndarray of float, shape (n_load,)
        Coordinate of the dataset.
    contact : ndarray of float, shape (n_draw, n_load, 3)
        E A/W, w/R and I/W.
    scene : dict of str to ndarray of float, shape (n_draw,) or (n_draw, n_load)
        Values of the scene, loads and counts.
    extrapolation : ndarray of float, shape (n_draw, n_load)
        1 where a draw is beyond the calibrated range.
    """

    load: FloatArray
    contact: FloatArray
    scene: dict[str, FloatArray]
    extrapolation: FloatArray

    @classmethod
    def of(cls, inputs: "xr.Dataset | FrictionInputs", *, edges: bool) -> "FrictionInputs":
        """Return the quantities from a dataset of `friction_inputs`.

        Raises
        ------
        InputError
            If a variable is missing, or edges of round ridges, which have no forces, are needed.
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
            # Proximal edges face the centre; the mean over both sliding directions is taken.
            proximal = side * np.nan_to_num(value["edge_x"]) < 0
            interlocking = 0.5 * np.where(proximal, G, 0.0).sum(axis=2) / (2 * p)
        contact = np.stack([length / (2 * p), half_width, interlocking], axis=2)
        scene = {name: value[name].astype(np.float64) for name in _SCENE if name in value}
        beyond = inputs["extrapolation"].to_numpy().astype(np.float64)
        return cls(inputs["load"].to_numpy(), contact, scene, beyond)

    @classmethod
    def joined(cls, parts: "Sequence[FrictionInputs]") -> "FrictionInputs":
        """Concatenate blocks of draws."""
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
        One row per load: load, p_over_E (mean over draws), mu_mean, mu_sd, mu_median, mu_lower,
        mu_upper, prob, extrapolation (share of draws beyond the calibrated range).
    shares : pandas.DataFrame
        Rows of each load: load, p_over_E, kind, name, share, share_se, total, total_se. Kind
        ``term``: cov(term, mu) over var(mu), which add up to 1. Kind ``input``: first-order and
        total Sobol indices of independent groups. Kind ``scene``: first-order indices of single
        quantities of the contact, which overlap if quantities depend on each other.
    mu : ndarray of float, shape (4096, n_load), dimensionless
        Draws of the coefficient of friction.

    Examples
    --------
    >>> import ridgebayes as rb
    >>> fit = rb.calibrate(rb.paper_sweep(), rb.Hybrid(), noise="iid", rng=1)
    >>> drawn = rb.friction_inputs(fit, rb.Scene.of([(0.022, 0.02)]), [0.003, 0.009], n=100, rng=1)
    >>> predicted_bands = rb.FrictionModel(kappa=0).predict(drawn, rng=1)
    >>> (predicted_bands.bands["mu_lower"] < predicted_bands.bands["mu_upper"]).tolist()
    [True, True]
    >>> predicted_bands.to_dataframe().equals(predicted_bands.bands)
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
        Function of a generator and n that returns n independent draws of the parameters, shape
        (n, 9).
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
    rng, n, n_draw = stream(seed, "friction", "bands"), _N_BATCH * _BATCH, len(inputs.contact)
    # Columns: index of a contact's draw, parameters, scores of the effects.
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
        by_term, mu = _evaluate(sample, contact)
        kept[:, j] = mu[:_N_KEPT]
        lower, median, upper = np.quantile(mu, [0.5 - prob / 2, 0.5, 0.5 + prob / 2])
        at = (load, float(inputs.scene["p_over_E"][:, j].mean()))
        beyond = float(inputs.extrapolation[:, j].mean())
        bands.append((*at, mu.mean(), mu.std(), median, lower, upper, prob, beyond))
        rows = [("term", *row) for row in _term_shares(by_term, mu)]
        swapped = {name: _evaluate(points, contact)[1] for name, points in swaps.items()}
        rows += [("input", *row) for row in _sobol(mu, _evaluate(other, contact)[1], swapped)]
        rows += [("scene", *row) for row in _scene_shares(inputs, j, sample, float(mu.var()))]
        shares += [(*at, *row) for row in rows]
    frame = pd.DataFrame(bands, columns=BAND_COLUMNS)
    return FrictionBands(frame, pd.DataFrame(shares, columns=SHARE_COLUMNS), kept)


def _effects(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the parameters of points, and the factors of their effects on mu."""
    theta, score = np.split(points[:, 1:], [len(PARAMETERS)], axis=1)
    return theta, np.exp((score * theta[:, _SCALES]).sum(axis=1))


def _evaluate(points: FloatArray, contact: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the terms with effects, (n, 3), and mu, (n,), at the contacts of one load."""
    theta, effect = _effects(points)
    shares_of_terms = terms(contact[points[:, 0].astype(np.int64)], theta) * effect[:, None]
    return shares_of_terms, shares_of_terms.sum(axis=1)


_Row = tuple[str, float, float, float, float]


def _mean_and_se(values: FloatArray) -> tuple[float, float]:
    """Return the mean over batches and its standard error."""
    return float(values.mean()), float(values.std(ddof=1) / np.sqrt(len(values)))


def _term_shares(by_term: FloatArray, mu: FloatArray) -> list[_Row]:
    """Return cov(term, mu)/var(mu) of all terms that are not 0."""
    batches = mu.reshape(_N_BATCH, _BATCH)
    dev = batches - batches.mean(axis=1, keepdims=True)
    indices = []
    for name, values in zip(TERMS, by_term.T, strict=True):
        if values.any():
            share = (values.reshape(_N_BATCH, _BATCH) * dev).sum(axis=1) / (dev * dev).sum(axis=1)
            indices.append((name, *_mean_and_se(share), np.nan, np.nan))
    return indices


def _sobol(row: FloatArray, other: FloatArray, swapped: Mapping[str, FloatArray]) -> list[_Row]:
    """Return first-order and total indices of each group, with errors from batches."""
    from scipy import stats  # imported here because it takes a third of a second

    of_batches = {
        "f_A": row.reshape(_N_BATCH, _BATCH),
        "f_B": other.reshape(_N_BATCH, _BATCH),
        "f_AB": np.stack([values.reshape(_N_BATCH, _BATCH) for values in swapped.values()]),
    }
    summands = stats.sobol_indices(func=of_batches, n=_BATCH)
    first = summands.first_order.reshape(_N_BATCH, -1).T  # SciPy drops the axis of a single group
    total = summands.total_order.reshape(_N_BATCH, -1).T
    rows = zip(swapped, first, total, strict=True)
    return [(name, *_mean_and_se(share), *_mean_and_se(sum_)) for name, share, sum_ in rows]


def _scene_shares(
    inputs: FrictionInputs, j: int, points: FloatArray, variance: float
) -> Iterator[_Row]:
    """Yield var(E[mu | value])/var(mu) of single values, from the draws of the contact.

    Parameters and effects are independent of the contact, so E[mu | contact] is known.
    """
    theta, effect = _effects(points)
    factors = (coefficients(theta) * effect[:, None]).mean(axis=0)
    mean = inputs.contact[:, j] @ factors[:3] + factors[3]
    for name, values in inputs.scene.items():
        value = values if values.ndim == 1 else values[:, j]
        if np.ptp(value) > 0 and len(value) >= _BATCH:
            batches = zip(*(np.array_split(x, _N_BATCH) for x in (value, mean)), strict=True)
            _, se = _mean_and_se(np.array([_between(*pair) for pair in batches]))
            yield name, _between(value, mean) / variance, se / variance, np.nan, np.nan


def _between(value: FloatArray, mean: FloatArray) -> float:
    """Return the variance of the means of bins, minus its expectation by chance."""
    distinct, codes = np.unique(value, return_inverse=True)
    if len(distinct) > _N_BIN:
        codes = np.argsort(np.argsort(value)) * _N_BIN // len(value)
    number = np.bincount(codes)
    means = np.bincount(codes, weights=mean) / number
    between = float((number * (means - mean.mean()) ** 2).sum())
    within = float(((mean - means[codes]) ** 2).sum()) / max(len(mean) - len(number), 1)
    return (between - (len(number) - 1) * within) / len(mean)
