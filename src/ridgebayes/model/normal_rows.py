"""Normals that stand for rows with shared offsets: what is near enough to integrate about.

Exact rows with normal errors are normal in their offsets as they are. A Student row is taken with
the mean variance of its error given its residual, a bracket or a count by expectation propagation.
A count has two offsets, at the load of Q and at that of Q + 2, and a normal of each.
"""

from typing import NamedTuple

import numpy as np

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.model.conditional_offsets import Design, OffsetPosterior, Root, given_rows
from ridgebayes.model.interval_sites import IntervalSites, count_sites, interval_sites
from ridgebayes.model.rows import Rows
from ridgebayes.model.shared_offsets import Offsets
from ridgebayes.model.tails import Tail

# Outliers' weights, and the normals that stand for intervals, settle; what is left is the
# estimates' to correct. Of seven tables with outliers, brackets or counts, the variance of
# estimates is then within a third of that after eight passes.
_PASSES, _PASSES_NORMAL = 6, 2
_SETTLED = 0.2  # largest relative change of a weight, as far as it counts beside the prior's
_OFF = 3.0  # sds of a row, its variance as if it were normal, beyond which offsets miss it
_LEAST = 1e-12  # share of an offset's precision that other rows give, at least


class OffsetsOfNormals(NamedTuple):
    """The scores given rows taken as normal, and as which normals.

    Parameters
    ----------
    root : DiagonalRoot or FullRoot
        L.
    given : OffsetPosterior
        The scores.
    weight, mean : ndarray of float, shape (..., n_normal)
        One over the variance, and mean, of each normal: of every row, then of the counts' ends.
    """

    root: Root
    given: OffsetPosterior
    weight: FloatArray
    mean: FloatArray


class _Normals(NamedTuple):
    """L, what it is at the normals, the rows' own variance, and the normals of a pass."""

    root: Root
    loading: FloatArray  # (Z L)'
    prior: FloatArray  # variances of the normals' offsets, before any row
    own: FloatArray
    mean: FloatArray
    weight: FloatArray
    variance: FloatArray  # of the rows' own errors, given what residuals say of a Student one


class _Scores(NamedTuple):
    """Mean and variance of the normals' offsets given all of them, and R^-1 (Z L)'."""

    at: FloatArray
    half: FloatArray
    spread: FloatArray


class NormalRows:
    """Rows taken as normal.

    Parameters
    ----------
    rows : Rows
        Rows.
    offsets : Offsets
        What they share.
    tail : Tail
        Distribution of their own errors.
    """

    def __init__(self, rows: Rows, offsets: Offsets, tail: Tail) -> None:
        self._rows, self._offsets, self._tail = rows, offsets, tail
        # Counts whose load and that of Q + 2 have different offsets.
        self.counts = np.flatnonzero((offsets.codes != offsets.codes_next).any(axis=0))
        codes = np.concatenate([offsets.codes, offsets.codes_next[:, self.counts]], axis=1)
        self.design = Design(codes, offsets.n_level)
        self._brackets = np.setdiff1d(np.flatnonzero(~rows.exact), self.counts)
        self._n_row, self._is_student = len(rows.upper), bool(tail.parameter_names)

    def at_ends(self, offset: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return each row's offset at its upper and at its lower end, from those of normals."""
        upper = offset[..., : self._n_row]
        if not len(self.counts):
            return upper, upper
        lower = upper.copy()
        lower[..., self.counts] = offset[..., self._n_row :]
        return upper, lower

    def by_row(self, weight: FloatArray) -> FloatArray:
        """Return what normals' weights, (..., n_normal), say of an offset common to both ends."""
        value = weight[..., : self._n_row]
        if len(self.counts):
            value = value.copy()
            value[..., self.counts] += weight[..., self._n_row :]
        return value

    def given(self, residual: FloatArray, eta: FloatArray) -> OffsetsOfNormals:
        """Return the scores given rows.

        Parameters
        ----------
        residual : ndarray of float, shape (..., n_row)
            The rows' middles, less what the form says.
        eta : ndarray of float, shape (..., n_noise)
            The error model's parameters.
        """
        n_pass = _PASSES if self._is_student else _PASSES_NORMAL * int(not self._rows.exact.all())
        now = self._begun(residual, eta)
        given = given_rows(self.design, now.root, now.weight, now.mean)
        for i in range(n_pass):
            before, now = now, self._renewed(residual, eta, now, given, is_first=not i)
            given = given_rows(self.design, now.root, now.weight, now.mean)
            if i and _change(before, now) < _SETTLED:
                break
        return OffsetsOfNormals(now.root, given, now.weight, now.mean)

    def weights(self, residual: FloatArray, eta: FloatArray) -> tuple[Root, FloatArray]:
        """Return L, and the weights of normals that outliers stand aside of: not settled ones."""
        now = self._begun(residual, eta)
        if not self._is_student:
            return now.root, now.weight
        given = given_rows(self.design, now.root, now.weight, now.mean)
        at = self.design.spread(now.root.times(given.mean))
        weight = now.weight.copy()
        weight[..., : self._n_row] = 1 / self._of_missed(residual, eta, now, at)
        return now.root, weight

    def _begun(self, residual: FloatArray, eta: FloatArray) -> _Normals:
        # A count is at first a normal of its middle, and says nothing at its other end.
        root, n = self._offsets.root(eta), self._n_row
        own = np.broadcast_to(eta[..., :1] ** 2 + self._rows.rel_se**2, residual.shape)
        mean = np.concatenate([residual, residual[..., self.counts]], axis=-1)
        weight = np.zeros(mean.shape)
        weight[..., :n] = 1 / (own + self._rows.centre[1])
        loading = root.loading(self.design)
        return _Normals(root, loading, (loading * loading).sum(axis=-2), own, mean, weight, own)

    def _renewed(
        self,
        residual: FloatArray,
        eta: FloatArray,
        now: _Normals,
        given: OffsetPosterior,
        *,
        is_first: bool,
    ) -> _Normals:
        """Return the normals that the scores given the normals so far call for."""
        n, df, own = self._n_row, eta[..., -1:], now.own
        at, half = self.design.spread(now.root.times(given.mean)), given.half(now.loading)
        spread = (half * half).sum(axis=-2)
        square = ((now.mean - at) ** 2)[..., :n]
        share = np.minimum((spread * now.weight)[..., :n], 1.0)
        variance = now.variance
        sites = self._sites(residual, now, _Scores(at, half, spread))
        if self._is_student and is_first:
            variance = self._of_missed(residual, eta, now, at)
        elif self._is_student:
            for rows, _, site in sites:
                square[..., rows], share[..., rows] = site.error_square, site.error_share
            # A t is a normal of unknown variance: this is its mean given what the residual may be.
            # The offset adds a share of the row's own variance: with the share kept the mean is
            # solved for, where putting it in takes a pass for each factor df + 1.
            variance = (df * own + square) / (df + 1 - share)
        mean, weight = now.mean.copy(), now.weight.copy()
        weight[..., :n] = 1 / variance
        for _, places, site in sites:
            for place, one, precision in zip(places, site.mean, site.precision, strict=True):
                mean[..., place], weight[..., place] = one, precision
        return now._replace(variance=variance, mean=mean, weight=weight)

    def _of_missed(
        self, residual: FloatArray, eta: FloatArray, now: _Normals, at: FloatArray
    ) -> FloatArray:
        """Return the variances of Student rows' errors, of those that offsets miss a priori ones.

        Outliers never pull at their neighbours then. The others begin with their own variance,
        which is soon settled.
        """
        n, df, own = self._n_row, eta[..., -1:], now.own
        missed = residual * residual + now.prior[..., :n]
        is_off = ((now.mean - at) ** 2)[..., :n] > _OFF**2 * (own + self._rows.centre[1])
        return np.where(is_off, (df * own + missed) / (df + 1), now.variance)

    def _sites(
        self, residual: FloatArray, now: _Normals, scores: _Scores
    ) -> list[tuple[IntArray, list[IntArray], IntervalSites]]:
        """Return brackets and counts, with the places of their normals and these themselves."""
        sites = []
        for rows, find in ((self._brackets, self._of_brackets), (self.counts, self._of_counts)):
            if len(rows):
                low, high = (
                    (residual + end - self._rows.centre[0])[..., rows]
                    for end in (self._rows.lower, self._rows.upper)
                )
                places, site = find(low, high, now, scores)
                sites.append((rows, places, site))
        return sites

    def _of_brackets(
        self, low: FloatArray, high: FloatArray, now: _Normals, scores: _Scores
    ) -> tuple[list[IntArray], IntervalSites]:
        rows = self._brackets
        mean, at, weight, spread = (
            x[..., rows] for x in (now.mean, scores.at, now.weight, scores.spread)
        )
        rest = spread / np.maximum(1 - spread * weight, _LEAST)  # what all others say
        own = now.variance[..., rows]
        site = interval_sites(low, high, at + rest * weight * (at - mean), rest, own)
        return [rows], site._replace(mean=site.mean[None], precision=site.precision[None])

    def _of_counts(
        self, low: FloatArray, high: FloatArray, now: _Normals, scores: _Scores
    ) -> tuple[list[IntArray], IntervalSites]:
        places = [self.counts, self._n_row + np.arange(len(self.counts))]
        mean, at, weight, (v, w) = (
            np.stack([x[..., place] for place in places])
            for x in (now.mean, scores.at, now.weight, scores.spread)
        )
        c = (scores.half[..., places[0]] * scores.half[..., places[1]]).sum(axis=-2)
        p, q = weight
        det = np.maximum((1 - v * p) * (1 - w * q) - c * c * p * q, _LEAST)
        rest = np.stack([(1 - w * q) * v + c * c * q, (1 - v * p) * w + c * c * p, c]) / det
        pull = weight * (at - mean)
        cavity = at + rest[:2] * pull + rest[2] * pull[::-1]
        own = now.variance[..., self.counts]
        return places, count_sites(low, high, cavity, rest, own)


def _change(before: _Normals, now: _Normals) -> float:
    """Return by how much weights change, the largest of each draw's, on average over draws."""
    with np.errstate(all="ignore"):
        known = 1 / (1 + 1 / (before.weight * now.prior))
        change = (np.abs(now.weight / before.weight - 1) * known).max(axis=-1)
    found = change[np.isfinite(change)]
    return float(found.mean()) if found.size else 0.0
