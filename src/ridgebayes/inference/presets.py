"""The three presets for the accuracy of posteriors: target errors, and settings that reach them.

Presets for simulated loads are in `simulate.generation`. `ridgebayes cost` measures errors and run
times; docs/performance.md lists them.
"""

from dataclasses import dataclass

from ridgebayes.errors import InputError
from ridgebayes.inference.chains import N_KEPT, SampleSettings
from ridgebayes.inference.importance import Effort


@dataclass(frozen=True)
class Preset:
    """Target errors of posteriors and evidences, with the settings of the samplers.

    Parameters
    ----------
    name : str
        ``quick``, ``standard`` or ``reference``.
    moment_error : float
        Target error of a posterior mean, standard deviation, 5 % or 95 % quantile, in posterior
        standard deviations: three standard errors of a quantile.
    evidence_error : float
        Target error of a log evidence.
    effort : Effort
        Draws of importance sampling for each pair of form and error model.
    n_kept : int
        Total number of draws for a form's predictions, divided among error models in proportion to
        their probabilities.
    walks : bool
        Whether emcee samples the posteriors under the selected error model too, as an independent
        check of their evidences.
    n_tau : float
        Minimum length of a walk, in autocorrelation times.
    extras : bool
        Whether a run also leaves textures out, measures coverage, compares finite-element rows,
        measures errors against run time and draws every figure.
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
        """Return a preset by name.

        Raises
        ------
        InputError
            If no preset has this name.
        """
        if not isinstance(name, str) or name not in PRESETS:
            raise InputError(f"accuracy: expected one of {', '.join(PRESETS)}, got {name!r}")
        return PRESETS[name]

    @property
    def settings(self) -> SampleSettings:
        """Settings of a walk."""
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
