"""How far each solver goes, said before anything is computed."""

from ridgebayes.contact import two_scale
from ridgebayes.errors import InputError
from ridgebayes.scene.scene import Scene

HIGHEST_LOAD = 0.1  # p/E to which finite elements go: docs/validation/cylinder.md


def beyond_reach(scene: Scene, written: str = "", solver: str = "auto") -> str:
    """Say that the highest load of a scene is beyond its solver's reach; nothing if it is not.

    Parameters
    ----------
    scene : Scene
        With its loads.
    written : str, optional
        The load with its unit, as a scene file has it.
    solver : str, optional
        As for `ridgebayes.generate`.

    Returns
    -------
    str
        Of what cannot be computed by finite elements or at small strain: a warning.

    Raises
    ------
    InputError
        If no solver goes as far, or the one that is named does not, and "half-plane" is not named.
    """
    highest = max(scene.highest_load(texture) for texture in scene.textures)
    load = f"{written} is p/E = {highest:.2g}" if written else f"p/E = {highest:.2g}"
    if solver == "two-scale" and scene.nu < two_scale.LEAST_NU:
        raise InputError(
            f"poissons_ratio = {scene.nu:g}: expected {two_scale.LEAST_NU:g} to 0.5 for two-scale"
        )
    if solver in ("auto", "two-scale") and highest > two_scale.REACH:
        number, _, unit = written.partition(" ")
        most = f"p/E = {two_scale.REACH:g}"
        if number and written == f"{number} {unit}":
            most += f", {float(number) * two_scale.REACH / highest:.3g} {unit}"
        raise InputError(f"load: {load}; expected at most {most}: no solver goes further")
    goes_on = not scene.friction and scene.nu >= two_scale.LEAST_NU
    if highest <= HIGHEST_LOAD or (solver in ("auto", "two-scale") and goes_on):
        return ""
    return (
        f"{load}; expected at most p/E = {HIGHEST_LOAD:g}. Above it finite elements often end "
        "without a result, and half-plane loads, which are for small strain, are far off"
    )
