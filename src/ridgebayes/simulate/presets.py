"""The three accuracies that commands offer of loads: what each promises, and its meshes."""

from dataclasses import dataclass

from ridgebayes.errors import InputError


@dataclass(frozen=True)
class LoadPreset:
    """How far errors of loads are pressed down.

    Parameters
    ----------
    name : str
        ``quick``, ``standard`` or ``reference``.
    load_error : float
        Promised relative error of a load by the half-plane.
    meshes : tuple of int
        Edges of finite elements a ridge, finest first: where one cannot pass a corner, the next
        goes on.
    """

    name: str
    load_error: float
    meshes: tuple[int, ...] = (24, 10)

    @classmethod
    def named(cls, name: str) -> "LoadPreset":
        """Return one by its name.

        Raises
        ------
        InputError
            If there is none.
        """
        if name not in LOAD_PRESETS:
            raise InputError(f"accuracy: expected one of {', '.join(LOAD_PRESETS)}, got {name!r}")
        return LOAD_PRESETS[name]


LOAD_PRESETS = {
    "quick": LoadPreset("quick", 1e-4, (10,)),
    "standard": LoadPreset("standard", 1e-8),
    "reference": LoadPreset("reference", 1e-10, (48, 24, 10)),
}
