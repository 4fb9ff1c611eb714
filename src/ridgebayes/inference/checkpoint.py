"""Chains on disk while they grow, so that a killed run goes on where it was.

A checkpoint holds all that a walk needs to go on bit for bit: its steps, and the state of each
ensemble's random stream. Files are NumPy's ``.npz``, whose members have checksums, and are written
whole or not at all.
"""

import io
import json
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from ridgebayes._types import FloatArray
from ridgebayes.errors import InputError
from ridgebayes.runtime.atomic import write_bytes
from ridgebayes.runtime.text import one_line_message


@dataclass(frozen=True, eq=False)
class Walk:
    """Steps of several ensembles; the first one is where burn-in ended.

    Parameters
    ----------
    u : ndarray of float, shape (n_ensemble, 1 + n_step, n_walker, d)
        Walkers' places, normal scores.
    log_density : ndarray of float, shape (n_ensemble, 1 + n_step, n_walker)
        Log density there.
    extras : ndarray of float, shape (n_ensemble, 1 + n_step, n_walker, n_extra)
        Extras of each step, see `ridgebayes.inference.emcee_sampling`.
    accepted : ndarray of float, shape (n_ensemble,)
        Accepted moves of all walkers so far.
    tau : ndarray of float, shape (d + 1,)
        Autocorrelation times at the last check.
    random_keys : ndarray of uint32, shape (n_ensemble, 624)
        Key of each ensemble's `numpy.random.RandomState`.
    random_places : ndarray of float, shape (n_ensemble, 3)
        Place in the key, whether a normal number is in store, and that number.
    """

    u: FloatArray
    log_density: FloatArray
    extras: FloatArray
    accepted: FloatArray
    tau: FloatArray
    random_keys: Any
    random_places: FloatArray

    @property
    def n_step(self) -> int:
        """Steps after burn-in."""
        return int(self.u.shape[1]) - 1


def packed(states: list[Any]) -> dict[str, Any]:
    """Return the two arrays that hold states of random streams, as `RandomState.get_state` does."""
    return {
        "random_keys": np.stack([state[1] for state in states]),
        "random_places": np.array([state[2:] for state in states], float),
    }


def unpacked(walk: Walk) -> list[Any]:
    """Return the states of a walk's random streams, for `RandomState.set_state`."""
    return [
        ("MT19937", key, int(place), int(has_gauss), float(cached))
        for key, (place, has_gauss, cached) in zip(
            walk.random_keys, walk.random_places, strict=True
        )
    ]


@dataclass(frozen=True)
class Checkpoint:
    """A file that a walk is kept in, tied to what is sampled.

    Parameters
    ----------
    path : Path
        File.
    fingerprint : mapping of str to str
        Values that must be equal for the walk to go on, such as the table's digest and the form.
    """

    path: Path
    fingerprint: Mapping[str, str]

    def save(self, walk: Walk) -> None:
        """Write a walk in place of the one before it."""
        content = io.BytesIO()
        np.savez(content, fingerprint=np.array(json.dumps(dict(self.fingerprint))), **vars(walk))
        write_bytes(content.getvalue(), self.path)

    def load(self) -> Walk | None:
        """Return the walk kept, or None if there is none.

        Raises
        ------
        InputError
            If the file is damaged, or what is sampled has changed; the message names what.
        """
        if not self.path.is_file():
            return None
        try:
            with np.load(io.BytesIO(self.path.read_bytes())) as file:
                before = json.loads(file["fingerprint"].item())
                walk = Walk(**{entry.name: file[entry.name] for entry in fields(Walk)})
        # Damage turns up as errors of many kinds.
        except Exception as error:
            raise InputError(
                f"{self.path}: not a readable chain file ({one_line_message(error)}); remove it "
                "and use --resume to compute it again"
            ) from None
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
        return walk
