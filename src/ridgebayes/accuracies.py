"""The three accuracies that commands offer: what each promises, and how it is reached.

They are points of the curves that `ridgebayes cost` measures. docs/performance.md holds what the
errors were measured to be.
"""

from dataclasses import dataclass

from ridgebayes.errors import InputError
from ridgebayes.sample import SampleSettings
from ridgebayes.texture_loads import STANDARD_MESHES


@dataclass(frozen=True)
class Accuracy:
    """How far errors of sampling, of evidences and of loads are pressed down.

    Parameters
    ----------
    name : str
        ``quick``, ``standard`` or ``reference``.
    moment_error : float
        Promised error of a posterior mean, sd, 5 or 95 % quantile, in posterior sds: three standard
        errors of a quantile of the draws.
    evidence_error : float
        Promised error of a log evidence.
    load_error : float
        Promised relative error of a load by the half-plane.
    walks : bool
        Whether posteriors are walked by emcee; if not, importance sampling draws from them and
        emcee serves where its weights have too heavy a tail.
    n_draw : int
        Importance draws of each of four proposals.
    n_tau : float
        Autocorrelation times that a walk takes at least.
    n_bridge : int or None
        Draws of the evidence's bridge; None for as many as 0.002 takes.
    meshes : tuple of int
        Edges of finite elements a ridge, finest first: where one cannot pass a corner, the next
        goes on.
    extras : bool
        Whether a run also leaves textures out, counts coverage and compares finite-element rows.
    """

    name: str
    moment_error: float
    evidence_error: float
    load_error: float
    walks: bool = True
    n_draw: int = 1_024
    n_tau: float = 50.0
    n_bridge: int | None = None
    meshes: tuple[int, ...] = STANDARD_MESHES
    extras: bool = True

    @classmethod
    def named(cls, name: str) -> "Accuracy":
        """Return one by its name.

        Raises
        ------
        InputError
            If there is none.
        """
        if name not in ACCURACIES:
            raise InputError(f"accuracy {name!r}: rule: {', '.join(ACCURACIES)}")
        return ACCURACIES[name]

    @property
    def settings(self) -> SampleSettings:
        """How long to walk."""
        return SampleSettings(n_tau=self.n_tau)


QUICK = Accuracy("quick", 0.2, 0.1, 1e-4, walks=False, n_draw=256, meshes=(10,), extras=False)
STANDARD = Accuracy("standard", 0.02, 0.01, 1e-8)
REFERENCE = Accuracy(
    "reference", 0.01, 0.003, 1e-10, n_tau=200.0, n_bridge=400_000, meshes=(48, 24, 10)
)
ACCURACIES = {one.name: one for one in (QUICK, STANDARD, REFERENCE)}
