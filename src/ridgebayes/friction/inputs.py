"""Draw counts, contacts, and forces on ridges and edges of a body on a texture jointly."""

import json
import math
import os
from collections.abc import Iterator

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from ridgebayes._types import FloatArray, IntArray, Rng, __version__
from ridgebayes.comparison.comparison import Comparison
from ridgebayes.contact import two_scale
from ridgebayes.contact.axes import Spread
from ridgebayes.contact.contact_solution import load_factor
from ridgebayes.contact.response_table import (
    CLOSEST,
    MOST_DISTINCT,
    ContactValues,
    ResponseTable,
    shapes_of,
    solved,
)
from ridgebayes.errors import ComputationError, InputError, expect
from ridgebayes.predict.extrapolation import names_of
from ridgebayes.predict.joint_draws import MOST_TEXTURES, PredictiveSampler, textures_of
from ridgebayes.results import Fit
from ridgebayes.runtime.pool import one_blas_thread
from ridgebayes.runtime.randomness import seed_of, stream, streams
from ridgebayes.scene.draws import SceneDraws, draw_scene
from ridgebayes.scene.scene import Scene, as_scene
from ridgebayes.scene.typed import MOST_LOADS
from ridgebayes.table.columns import LARGEST_LOAD

SMALL_STRAIN = 0.015  # p/E: small strain is within 1 % of finite strain, for moderate grooves
_BLOCK = 1_000  # draws in memory at a time
_N_CHECKED = 24  # contacts solved to measure the error of interpolation
_PROFILE = ("a", "b", "depth", "corner", "offset")
_DEPTH, _CORNER = _PROFILE.index("depth"), _PROFILE.index("corner")
# Name: dimensions, unit, meaning.
_VARIABLES = {
    "Q": ("dl", "1", "proximal edges in contact, drawn from the posterior predictive"),
    "form": ("d", "", "form of the draw"),
    "error_model": ("d", "", "error model of the draw"),
    "draw_index": ("d", "1", "index of the posterior's draw"),
    "p_over_E": ("dl", "E", "load per projected area"),
    "p_over_E_mechanics": ("dl", "E", "nearest load at which the mechanics counts Q"),
    "contact_length_over_R": ("dl", "R", "sum of touching widths"),
    "contact_fraction": ("dl", "1", "touching widths over the distance of the outermost ends"),
    "ridge_force_mean": ("dl", "E R", "mean force on a touched ridge, per length"),
    "ridge_force_max": ("dl", "E R", "largest force on a ridge, per length"),
    "penetration_over_R": ("dl", "R", "deepest, into any groove"),
    "extrapolation": ("dl", "", "whether a quantity is beyond the calibrated range"),
    "extrapolation_of": ("dl", "", "their names; strain: p/E above 0.33, or 0.015 if nu < 0.3"),
    "a_over_R": ("d", "R", "ridge width"),
    "b_over_R": ("d", "R", "groove width"),
    "nu": ("d", "1", "Poisson's ratio"),
    "offset": ("d", "pitch", "of the body's centre from a groove's centre"),
    "radius": ("d", "m", "radius of the body"),
    "youngs_modulus": ("d", "Pa", "Young's modulus"),
    "edge_x": ("dle", "R", "where contact ends, from the body's axis; NaN beyond the last edge"),
    "edge_side": ("dle", "1", "-1 left, 1 right; 0 beyond the last edge"),
    "edge_K": ("dle", "E sqrt(R)", "pressure near the edge is K/sqrt(2 pi r); NaN if round"),
    "edge_G": ("dle", "E R", "(1 - nu^2) K^2/(2 E): force on the body, into the groove; NaN as K"),
}
_DIMS = {"d": "draw", "l": "load", "e": "edge"}


@one_blas_thread()
def friction_inputs(
    source: Fit | Comparison,
    scene: Scene | str | os.PathLike[str],
    loads: int | ArrayLike = 20,
    *,
    n: int = 4000,
    rng: Rng = 0,
    edges: bool = False,
) -> xr.Dataset:
    """Draw counts and the corresponding contacts jointly, as input to friction models.

    Parameters
    ----------
    source : Fit or Comparison
        Posterior; draws are divided among its forms and error models by their weights.
    scene : Scene or path
        Scene of one texture. Its values may be distributions.
    loads : int or array_like of float, shape (n_load,), dimensionless
        Loads p/E, or the number of equal steps up to each draw's largest load of the scene.
    n : int, optional
        Number of draws.
    rng : int or numpy.random.Generator, optional
        Seed; the same seed gives the same draws.
    edges : bool, optional
        Whether to add the forces on edges.

    Returns
    -------
    xarray.Dataset
        Coordinates draw, load and, with `edges`, edge. Each variable has its unit and meaning as
        attributes. The dataset has the scene, seed, version, digest of the fitted rows, and
        ``contact_relative_error`` as attributes.

    Raises
    ------
    InputError
        If the scene has several textures, a load or `n` is not positive, or a count exceeds 2,000.
    ComputationError
        If a contact cannot be solved, or the comparison has no form with an evidence.

    Notes
    -----
    Q is drawn with one score of the error model for all loads of a draw, so it never falls as the
    load rises. At each load it has the distribution of `predict`. The contact is computed at
    ``p_over_E_mechanics``, the load nearest to p at which the mechanics count Q. It is inside the
    interval of such loads by 0.01 % of its length (1 % for more than 32 distinct shapes with
    different offsets). Forces and K are scaled by p over that load, so that they balance p; G
    follows from K. If the body is off centre, Q is the count of a centred body, because forms have
    no offset. For net forces, which are differences of G, use `edge_forces`.

    *Validity.* Contacts are frictionless. Large deformation is that of a smooth cylinder, as with
    the two-scale solver of `contact_at_loads`; for nu under 0.3, strain is small. Above
    p/E = 0.33, or 0.015 at small strain, ``extrapolation`` is set.

    *Accuracy.* Contacts are interpolated. ``contact_relative_error`` is three times the largest
    error of any quantity in 24 contacts that are also solved, and at least 1e-4. Errors of edges
    are relative to the largest x and K of the contact.

    *Cost.* A few seconds for the table, then 0.1 ms per draw of 20 loads.

    Examples
    --------
    >>> import ridgebayes as rb
    >>> fit = rb.calibrate(rb.paper_sweep(), rb.Hybrid(), noise="iid", rng=1)
    >>> scene = rb.Scene.of([(0.022, 0.02)])
    >>> drawn = rb.friction_inputs(fit, scene, [0.003, 0.009], n=100, rng=1)
    >>> drawn["Q"].median("draw").values.tolist()
    [4.0, 8.0]
    """
    return joined(list(InputDraws(source, scene, loads, n=n, rng=rng, edges=edges).blocks()))


def joined(blocks: list[xr.Dataset]) -> xr.Dataset:
    """Concatenate blocks of draws."""
    if len(blocks) == 1:
        return blocks[0]
    # Blocks differ in their number of edges; missing edges have NaN, and side 0.
    blank = {"edge_side": np.int8(0)}
    return xr.concat(blocks, "draw", join="outer", fill_value=blank, combine_attrs="override")


class InputDraws:
    """Draws of `friction_inputs` in blocks of 1,000; parameters are the same."""

    def __init__(
        self,
        source: Fit | Comparison,
        scene: Scene | str | os.PathLike[str],
        loads: int | ArrayLike = 20,
        *,
        n: int = 4000,
        rng: Rng = 0,
        edges: bool = False,
    ) -> None:
        if isinstance(n, bool) or not isinstance(n, int | np.integer) or n < 1:
            raise InputError(f"n: expected a whole number >= 1, got {n!r}")
        self._seed, self.n, self._edges = seed_of(rng), int(n), edges
        expect(Fit, Comparison, source=source)
        self._scene = scene = as_scene(scene)
        self._ogden = scene.ogden
        self._loads, self._is_share = _read_loads(loads)
        self._shapes, textures = Spread(MOST_DISTINCT), Spread(MOST_TEXTURES)
        # Bodies are drawn twice, here and in `blocks`, so that memory holds a single block.
        for bodies in self._bodies():
            self._shapes.add(shapes_of(_profiles(bodies)))
            textures.add(textures_of(bodies.profile["a"], bodies.profile["b"]))
        self._table = ResponseTable(self._shapes)
        self._parts = source.averaged
        self._samplers = [PredictiveSampler(fit, textures) for fit, _ in self._parts]
        self.contact_relative_error = math.nan
        self._attrs = {
            "scene": json.dumps(scene.model_dump(mode="json")),
            "seed": self._seed,
            "n_draw": self.n,
            "ridgebayes_version": __version__,
            "fitted_rows_digest": self._parts[0][0].model.data.digest(),
        }
        if scene.uncertain is not None:
            self._attrs["scene_distributions"] = json.dumps(scene.uncertain.texts)
        if isinstance(source, Comparison):
            self._attrs["table_digest"] = source.table.digest()

    def _bodies(self) -> Iterator[SceneDraws]:
        """Yield the draws of the scene, 1,000 at a time."""
        random = streams(self._seed)
        for first in range(0, self.n, _BLOCK):
            yield draw_scene(self._scene, min(_BLOCK, self.n - first), random)

    def blocks(self) -> Iterator[xr.Dataset]:
        """Yield the draws, 1,000 at a time."""
        first = 0
        for bodies in self._bodies():
            self._shapes.check(shapes_of(_profiles(bodies)))
            yield self._block(np.arange(first, first + len(bodies.nu)), bodies)
            first += len(bodies.nu)

    def _block(self, index: IntArray, bodies: SceneDraws) -> xr.Dataset:
        rng = stream(self._seed, "friction", f"from {index[0]}")
        p, nu = self._p(bodies), bodies.nu
        textures = textures_of(bodies.profile["a"], bodies.profile["b"])
        weight = np.array([share for _, share in self._parts])
        part = rng.choice(len(weight), size=len(index), p=weight / weight.sum())
        Q, flags = np.empty(p.shape, dtype=np.int64), np.empty(p.shape, dtype=np.uint8)
        draw_index = np.empty(len(index), dtype=np.int64)
        for j, sampler in enumerate(self._samplers):
            here = np.flatnonzero(part == j)
            if len(here):
                drawn = sampler.draw(textures[here], p[here], nu[here], rng)
                Q[here], draw_index[here], flags[here] = drawn
        values = self._contacts(_profiles(bodies), Q, p, nu, rng)
        beyond = names_of(flags)
        is_large = nu[:, None] >= two_scale.LEAST_NU
        strained = p > np.where(is_large, two_scale.checked(self._ogden), SMALL_STRAIN)
        beyond[strained] = [f"{text},strain".lstrip(",") for text in beyond[strained]]
        fits = [fit for fit, _ in self._parts]
        values |= {
            "Q": Q,
            "form": np.array([fit.form.name for fit in fits])[part],
            "error_model": np.array([fit.noise.name for fit in fits])[part],
            "draw_index": draw_index,
            "p_over_E": p,
            "extrapolation": beyond != "",
            "extrapolation_of": beyond.astype(str),
            "a_over_R": bodies.profile["a"],
            "b_over_R": bodies.profile["b"],
            "offset": bodies.profile["offset"],
            "nu": nu,
        }
        return self._dataset(index, values | bodies.physical)

    def _p(self, bodies: SceneDraws) -> FloatArray:
        largest = bodies.p_over_E if self._is_share else np.ones(len(bodies.nu))
        return largest[:, None] * self._loads

    def _contacts(
        self,
        profiles: FloatArray,
        Q: IntArray,
        p: FloatArray,
        nu: FloatArray,
        rng: np.random.Generator,
    ) -> dict[str, np.ndarray]:
        """Return the variables of the mechanics at the drawn counts."""
        names = ["p_over_E_mechanics", "contact_length_over_R", "contact_fraction"]
        names += ["ridge_force_mean", "ridge_force_max", "penetration_over_R"]
        out = {name: np.empty(p.shape) for name in names}
        if self._edges:
            edge_shape = (*p.shape, 2 * int(Q.max()))
            out |= {f"edge_{name}": np.full(edge_shape, np.nan) for name in ("x", "K", "G")}
            out["edge_side"] = np.zeros(edge_shape, dtype=np.int8)
        factor = np.broadcast_to(load_factor(0.0) * (1 - nu**2)[:, None], p.shape)
        # Load at which the half-plane behaves as the body does under p, or NaN.
        half_plane = two_scale.half_plane_load(p, nu[:, None], self._ogden)
        is_large = np.isfinite(half_plane)
        W = factor * np.where(is_large, half_plane, p)
        for count in np.unique(Q).tolist():
            i, j = here = np.nonzero(count == Q)
            contact = self._table.at(profiles[i], count, W[here])
            if math.isnan(self.contact_relative_error):
                self.contact_relative_error = self._table_error(profiles, Q, W, rng)
            p_half_plane, line_load = contact.W / factor[here], 2 * p[here]
            p_large = two_scale.load_of(p_half_plane, nu[i], self._ogden)
            p_mechanics = np.where(is_large[here] & np.isfinite(p_large), p_large, p_half_plane)
            out["p_over_E_mechanics"][here] = p_mechanics
            out["contact_length_over_R"][here] = contact.length
            out["contact_fraction"][here] = contact.length / contact.extent
            out["ridge_force_mean"][here] = line_load * contact.share / count
            out["ridge_force_max"][here] = line_load * contact.largest_share
            penetration = contact.penetration * p_mechanics / p_half_plane
            out["penetration_over_R"][here] = np.minimum(penetration, profiles[i, _DEPTH])
            if self._edges:
                modulus = 1 / (1 - nu[i][:, None] ** 2)
                K = np.maximum(contact.K, 0.0) * modulus * (p[here] / p_half_plane)[:, None]
                K[profiles[i, _CORNER] > 0] = np.nan
                for name, column in (("x", contact.x), ("K", K), ("G", 0.5 * K**2 / modulus)):
                    out[f"edge_{name}"][i, j, : 2 * count] = column
                out["edge_side"][i, j, : 2 * count] = np.tile([-1, 1], count)
        return out

    def _table_error(
        self, profiles: FloatArray, Q: IntArray, W: FloatArray, rng: np.random.Generator
    ) -> float:
        """Return three times the largest error of the table in some solved contacts."""
        worst = CLOSEST / 3  # a load near the end of its interval is moved by this share
        for i, j in zip(*(rng.integers(size, size=_N_CHECKED) for size in Q.shape), strict=True):
            contact = self._table.at(profiles[[i]], int(Q[i, j]), W[i, [j]])
            try:
                exact = solved(profiles[i], int(Q[i, j]), float(contact.W[0]))
            except ComputationError:  # the count differs from the table's
                return math.inf
            worst = max(worst, _largest_error(contact, exact))
        return 3 * worst

    def _dataset(self, index: IntArray, values: dict[str, np.ndarray]) -> xr.Dataset:
        variables = {
            name: ([_DIMS[key] for key in dims], values[name], {"units": unit, "long_name": what})
            for name, (dims, unit, what) in _VARIABLES.items()
            if name in values
        }
        coords = {"draw": index, "load": self._loads}
        if self._edges:
            coords["edge"] = np.arange(values["edge_x"].shape[2])
        error = {"contact_relative_error": self.contact_relative_error}
        return xr.Dataset(variables, coords, self._attrs | error)


def _profiles(bodies: SceneDraws) -> FloatArray:
    return np.stack([bodies.profile[name] for name in _PROFILE], axis=1)


def _read_loads(loads: int | ArrayLike) -> tuple[FloatArray, bool]:
    """Return loads, and whether they are shares of the scene's largest load."""
    if isinstance(loads, int | np.integer) and not isinstance(loads, bool):
        if not 1 <= loads <= MOST_LOADS:
            raise InputError(f"loads: expected 1 to {MOST_LOADS} of them, got {loads}")
        return np.arange(1, int(loads) + 1) / int(loads), True
    try:
        p_over_E = np.atleast_1d(np.asarray(loads, dtype=np.float64))
    except (TypeError, ValueError):
        raise InputError(f"loads: expected a number of loads, or loads, got {loads!r}") from None
    within = (p_over_E > 0) & (p_over_E <= LARGEST_LOAD)
    if p_over_E.ndim != 1 or not p_over_E.size or not within.all():
        bad = p_over_E[~within][0] if (~within).any() else f"shape {p_over_E.shape}"
        rule = f"a row of p/E, finite and > 0, at most {LARGEST_LOAD:g}"
        raise InputError(f"loads: expected {rule}, got {bad}")
    return p_over_E, False


def _largest_error(table: ContactValues, exact: ContactValues) -> float:
    """Return the largest error of a contact's quantities, over their largest values."""
    worst = 0.0
    for name in ("length", "extent", "penetration", "share", "largest_share", "x", "K"):
        value, other = getattr(table, name), getattr(exact, name)
        scale = np.abs(other).max()
        if scale > 0:  # False for NaN: penetration of a single ridge, K of round corners
            worst = max(worst, float(np.abs(value - other).max() / scale))
    return worst
