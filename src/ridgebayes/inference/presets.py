"""The three accuracies of posteriors that commands offer: target errors, and how they are reached.

The accuracies of loads are in `simulate.generation`. `ridgebayes cost` measures errors against run
time; docs/performance.md holds the measured errors.
"""

from dataclasses import dataclass

from ridgebayes.errors import InputError
from ridgebayes.inference.chains import N_KEPT, SampleSettings
from ridgebayes.inference.importance import Effort


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
    effort : Effort
        Draws of importance sampling for each pair of form and error model.
    n_kept : int
        Draws of a form's posteriors together, shared out by the error models' probabilities.
    walks : bool
        Whether emcee walks the posteriors of the selected error model, as a second way to their
        evidences.
    n_tau : float
        Autocorrelation times that a walk takes at least.
    extras : bool
        Whether a run also leaves textures out, counts coverage, compares finite-element rows,
        measures what accuracy costs and draws every figure.
    """

    name: str
    moment_error: float
    evidence_error: float
    effort: Effort
    n_kept: int
    walks: bool = True
    n_tau: float = 50.0
    extras: bool = True

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
    def settings(self) -> SampleSettings:
        """How long to walk."""
        return SampleSettings(n_tau=self.n_tau)


QUICK = Preset(
    "quick",
    0.25,
    0.1,
    Effort(n_round=3, n_per_round=384, n_draw=160, n_point=8),
    n_kept=1_024,
    walks=False,
    extras=False,
)
STANDARD = Preset("standard", 0.1, 0.05, Effort(), N_KEPT)
REFERENCE = Preset(
    "reference",
    0.08,
    0.01,
    Effort(n_per_round=2_048, n_draw=4_096, n_point=64),
    N_KEPT,
    n_tau=200.0,
)
PRESETS = {preset.name: preset for preset in (QUICK, STANDARD, REFERENCE)}
