"""Checkpoints of a walk, so that an interrupted run can be resumed.

A checkpoint holds the steps of a walk and the state of each ensemble's random stream; a resumed
walk is bitwise identical to an uninterrupted walk. Files are NumPy's ``.npz``, whose members have
checksums, and are written atomically.
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
    """Steps of several ensembles; the first step is the end of burn-in.

    Parameters
    ----------
    u : ndarray of float, shape (n_ensemble, 1 + n_step, n_walker, d)
        Positions of the walkers, in normal scores.
    log_density : ndarray of float, shape (n_ensemble, 1 + n_step, n_walker)
        Log density at these positions.
    extras : ndarray of float, shape (n_ensemble, 1 + n_step, n_walker, n_extra)
        Extras of each step, see `ridgebayes.inference.emcee_sampling`.
    accepted : ndarray of float, shape (n_ensemble,)
        Number of accepted moves of all walkers.
    tau : ndarray of float, shape (d + 1,)
        Autocorrelation times at the last check.
    random_keys : ndarray of uint32, shape (n_ensemble, 624)
        Key of each ensemble's `numpy.random.RandomState`.
    random_places : ndarray of float, shape (n_ensemble, 3)
        Position in the key, whether a normal number is cached, and the cached number.
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
    """Pack states of random streams, from `RandomState.get_state`, into two arrays."""
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
    """A file that stores a walk and identifies the sampled density.

    Parameters
    ----------
    path : Path
        File.
    fingerprint : mapping of str to str
        Values that must be equal for the walk to be resumed, such as the table's digest and the
        form.
    """

    path: Path
    fingerprint: Mapping[str, str]

    def save(self, walk: Walk) -> None:
        """Write a walk; an existing file is overwritten."""
        content = io.BytesIO()
        np.savez(content, fingerprint=np.array(json.dumps(dict(self.fingerprint))), **vars(walk))
        write_bytes(content.getvalue(), self.path)

    def load(self) -> Walk | None:
        """Return the stored walk, or None if the file does not exist.

        Raises
        ------
        InputError
            If the file is damaged, or if the fingerprint differs; the message names the values that
            changed.
        """
        if not self.path.is_file():
            return None
        try:
            with np.load(io.BytesIO(self.path.read_bytes())) as file:
                before = json.loads(file["fingerprint"].item())
                walk = Walk(**{entry.name: file[entry.name] for entry in fields(Walk)})
        # zipfile and NumPy raise exceptions of many types for a damaged file.
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
