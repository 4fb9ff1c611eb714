"""emcee's ensemble sampler on a density of many points a call.

This is the only module that imports emcee.
"""

from collections.abc import Callable
from typing import Any

import emcee
import numpy as np

from ridgebayes._types import FloatArray
from ridgebayes.inference.moves import MOVES, Independence


class Ensemble(emcee.EnsembleSampler):
    """An ensemble that moves by an independence proposal and by differential evolution.

    emcee takes the densities of a vectorised function one walker at a time, in Python; here they
    stay an array.

    Parameters
    ----------
    log_density : callable
        (n, n_coordinate) to (n,): log density; not NaN.
    n_walker, n_coordinate : int
        Walkers and dimensions.
    proposal : Independence
        Fitted proposal.
    moves : str, optional
        One of `ridgebayes.inference.moves.MOVES`, which holds the shares of the three kinds.
    """

    def __init__(
        self,
        log_density: Callable[[FloatArray], FloatArray],
        n_walker: int,
        n_coordinate: int,
        proposal: Independence,
        moves: str = "mixture",
    ) -> None:
        kinds = (emcee.moves.MHMove(proposal), emcee.moves.DEMove(), emcee.moves.StretchMove())
        shares = [one for one in zip(kinds, MOVES[moves], strict=True) if one[1] > 0]
        super().__init__(n_walker, n_coordinate, log_density, vectorize=True, moves=shares)
        self.log_prob_fn = log_density  # emcee's own wrapper prints a traceback on Ctrl-C

    def compute_log_prob(self, coords: FloatArray) -> tuple[FloatArray, None]:
        """Return the log densities at `coords`, shape (n,), and no blobs."""
        if not np.isfinite(coords).all():
            raise ValueError("a walker's coordinate is not finite")
        log_density = self.log_prob_fn(coords)
        if np.isnan(log_density).any():
            raise ValueError("the log density is NaN")
        return log_density, None


def state_at(
    z: FloatArray, random_state: Any, log_density: FloatArray | None = None
) -> emcee.State:
    """Return walkers at `z`, (n_walker, n_coordinate), with the state of a `RandomState`."""
    # emcee takes the state of a RandomState; such an object it would silently ignore.
    return emcee.State(z, log_prob=log_density, random_state=random_state)
