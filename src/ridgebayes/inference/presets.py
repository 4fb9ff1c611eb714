"""The three accuracies of posteriors that commands offer: target errors, and how they are reached.

Those of loads are in `simulate.generation`. `ridgebayes cost` measures the curves that they are
points of; docs/performance.md holds the measured errors.
"""

from dataclasses import dataclass

from ridgebayes.errors import InputError
from ridgebayes.inference.chains import N_KEPT, SampleSettings

_N_POINT = 16  # of offsets that are drawn: the estimates' variance is 0.05 to 0.1 at eight


@dataclass(frozen=True)
class Preset:
    """How far errors of sampling and of evidences are pressed down.

    Parameters
    ----------
    name : str
        ``quick``, ``standard`` or ``reference``.
    moment_error : float
        Promised error of a posterior mean, sd, 5 or 95 % quantile, in posterior sds: three standard
        errors of a quantile of the draws.
    evidence_error : float
        Promised error of a log evidence.
    walks : bool
        Whether posteriors are walked by emcee; if not, importance sampling draws from them and
        emcee serves where its weights have too heavy a tail.
    n_draw : int
        Importance draws of each of four proposals.
    n_round, n_per_round : int
        Rounds of fitting each proposal, and draws of each round.
    n_tau : float
        Autocorrelation times that a walk takes at least.
    n_bridge : int or None
        Draws of the evidence's bridge; None for as many as 0.002 takes.
    extras : bool
        Whether a run also leaves textures out, counts coverage, compares finite-element rows,
        measures what accuracy costs and draws every figure.
    n_kept : int
        Draws of each posterior that a run keeps, for predictions and files.
    """

    name: str
    moment_error: float
    evidence_error: float
    walks: bool = True
    n_draw: int = 1_024
    n_round: int = 3
    n_per_round: int = 512
    n_tau: float = 50.0
    n_bridge: int | None = None
    extras: bool = True
    n_kept: int = N_KEPT

    @classmethod
    def named(cls, name: str) -> "Preset":
        """Return one by its name.

        Raises
        ------
        InputError
            If there is none.
        """
        if name not in PRESETS:
            raise InputError(f"accuracy: expected one of {', '.join(PRESETS)}, got {name!r}")
        return PRESETS[name]

    @property
    def effort(self) -> dict[str, int]:
        """What importance sampling is told."""
        return {
            "n_draw": self.n_draw,
            "n_round": self.n_round,
            "n_per_round": self.n_per_round,
            "n_point": _N_POINT,
        }

    @property
    def settings(self) -> SampleSettings:
        """How long to walk."""
        return SampleSettings(n_tau=self.n_tau)


# Of what decides nothing unless it is far off: forms that the rows rule out.
ROUGH = Preset(
    "rough", 0.5, 0.5, walks=False, n_draw=512, n_round=1, n_per_round=256, extras=False, n_kept=512
)
QUICK = Preset(
    "quick", 0.2, 0.1, walks=False, n_draw=512, n_round=3, n_per_round=256, extras=False, n_kept=512
)
STANDARD = Preset("standard", 0.02, 0.01)
REFERENCE = Preset("reference", 0.01, 0.003, n_tau=200.0, n_bridge=400_000)
PRESETS = {one.name: one for one in (QUICK, STANDARD, REFERENCE)}
