"""Chains on disk while they grow, so that a killed run goes on where it was.

A checkpoint holds all that a walk needs to go on bit for bit: steps so far, walkers' places, and
the state of each ensemble's random stream. Files are HDF5, written whole or not at all.
"""

import hashlib
import io
import json
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.errors import InputError
from ridgebayes.runtime.atomic import write_bytes
from ridgebayes.runtime.text import one_line_message

_RANDOM = ("random_keys", "random_rest")


@dataclass(frozen=True, eq=False)
class Walk:
    """Where several ensembles are, and every step that led there.

    Parameters
    ----------
    u : ndarray of float, shape (n_ensemble, n_step, n_walker, d)
        Steps so far, normal scores.
    log_density : ndarray of float, shape (n_ensemble, n_step, n_walker)
        Log density of those.
    extras : ndarray of float, shape (n_ensemble, n_step, n_walker, n_extra)
        Extras of each step, see `ridgebayes.inference.emcee_sampling`.
    accepted : ndarray of float, shape (n_ensemble,)
        Accepted moves of all walkers so far.
    last_u, last_log_density, last_extras : ndarray of float, first axes (n_ensemble, n_walker)
        The same where the walkers are.
    tau : ndarray of float, shape (d + 1,)
        Autocorrelation times at the last check.
    weights, charts, centres, factors : ndarray
        Proposal, see `ridgebayes.inference.proposal.Mixture`.
    random_states : tuple
        State of each ensemble's `numpy.random.RandomState`, as `get_state` returns it.
    """

    u: FloatArray
    log_density: FloatArray
    extras: FloatArray
    accepted: FloatArray
    last_u: FloatArray
    last_log_density: FloatArray
    last_extras: FloatArray
    tau: FloatArray
    weights: FloatArray
    charts: IntArray
    centres: FloatArray
    factors: FloatArray
    random_states: tuple[Any, ...]

    @property
    def n_step(self) -> int:
        """Steps so far."""
        return int(self.u.shape[1])


_ARRAYS = tuple(entry.name for entry in fields(Walk) if entry.name != "random_states")


@dataclass(frozen=True)
class Checkpoint:
    """A file that a walk is kept in, tied to what is sampled.

    Parameters
    ----------
    path : Path
        HDF5 file.
    fingerprint : mapping of str to str
        Values that must be equal for the walk to go on, such as the table's digest and the form.
    """

    path: Path
    fingerprint: Mapping[str, str]

    def save(self, walk: Walk) -> None:
        """Write a walk in place of the one before it."""
        write_bytes(self._content(walk), self.path)

    def _content(self, walk: Walk) -> bytes:
        """Return the file, made in memory: a full disk ends HDF5 on a file.

        A function of its own: a closed HDF5 object that an error's traceback keeps to the
        interpreter's end may crash it there (h5py 3.16 under Python 3.12).
        """
        import h5py

        arrays = {name: getattr(walk, name) for name in _ARRAYS}
        arrays["random_keys"] = np.stack([state[1] for state in walk.random_states])
        arrays["random_rest"] = np.array([state[2:] for state in walk.random_states], float)
        fingerprint = json.dumps(dict(self.fingerprint))
        content = io.BytesIO()
        with h5py.File(content, "w") as file:
            file.attrs["fingerprint"] = fingerprint
            file.attrs["sha256"] = _digest(fingerprint, arrays)
            for name, values in arrays.items():
                file[name] = values
        return content.getvalue()

    def load(self) -> Walk | None:
        """Return the walk kept, or None if there is none.

        Raises
        ------
        InputError
            If the file is damaged, or what is sampled has changed; the message names what.
        """
        import h5py

        if not self.path.is_file():
            return None
        try:
            with h5py.File(io.BytesIO(self.path.read_bytes()), "r") as file:
                fingerprint, digest = file.attrs["fingerprint"], file.attrs["sha256"]
                arrays = {name: file[name][()] for name in (*_ARRAYS, *_RANDOM)}
            if digest != _digest(fingerprint, arrays):
                raise ValueError("checksum mismatch")
            before = json.loads(fingerprint)
        # Damage turns up as errors of many kinds.
        except Exception as error:
            raise InputError(
                f"{self.path}: not a readable chain file ({one_line_message(error)}); remove it "
                "and use --resume to compute it again"
            ) from None
        keys, rest = (arrays.pop(name) for name in _RANDOM)
        changed = [
            f"{name} was {before.get(name)!r} and is {value!r}"
            for name, value in self.fingerprint.items()
            if before.get(name) != value
        ]
        if changed:
            raise InputError(
                f"{self.path}: cannot resume, {'; '.join(changed)}; expected the same run, or no "
                "--resume to start again"
            )
        states = tuple(
            ("MT19937", key, int(pos), int(has_gauss), float(cached))
            for key, (pos, has_gauss, cached) in zip(keys, rest, strict=True)
        )
        return Walk(**arrays, random_states=states)


def _digest(fingerprint: str, arrays: Mapping[str, Any]) -> str:
    """Return what tells that a walk came back as it went: HDF5 does not look for flipped bits."""
    digest = hashlib.sha256(fingerprint.encode())
    for name, values in arrays.items():
        kind = np.asarray(values)
        digest.update(f"{name} {kind.dtype.str} {kind.shape}".encode())
        digest.update(np.ascontiguousarray(kind).data)
    return digest.hexdigest()
