"""Records of the effects of a scene, and the highest loads that solvers reach."""

from dataclasses import asdict, dataclass, fields
from typing import TYPE_CHECKING

import pandas as pd

from ridgebayes import drawing
from ridgebayes._types import Tabular
from ridgebayes.contact import two_scale
from ridgebayes.contact.contact_solution import DEFAULT_REL_TOL
from ridgebayes.contact.rigid_profile import Profile
from ridgebayes.errors import InputError
from ridgebayes.scene.scene import Scene, Texture
from ridgebayes.table.rules import texture_label

if TYPE_CHECKING:  # heavy
    from matplotlib.axes import Axes

# Scenes without a required accuracy neglect only effects below the tolerance of the solver.
DEFAULT_RELATIVE = DEFAULT_REL_TOL
BEYOND_HALF_PLANE = ("finite body and large deformation", "friction")
# Relative error of finite elements, which therefore cannot resolve a smaller effect.
FINITE_ELEMENT_ERROR = 0.002
N_OFFSETS = 8  # curves that represent a uniform offset
HIGHEST_LOAD = 0.1  # p/E, of finite elements: docs/validation/cylinder.md


@dataclass(frozen=True)
class Effect:
    """One effect on the transition loads of one texture.

    Parameters
    ----------
    name : str
        Name, such as ``corner radius``.
    number : float
        Dimensionless number that the effect depends on; NaN if the scene does not give it.
    estimate : float
        Largest relative change of a transition load if the effect is neglected; NaN if unknown.
    simulated : bool
        Whether loads include the effect.
    reason : str
        Reason for the decision, with the definition of `number`.
    cost_s : float
        CPU seconds of simulating the effect; NaN if no solver can.
    """

    name: str
    number: float
    estimate: float
    simulated: bool
    reason: str
    cost_s: float


@dataclass(frozen=True, repr=False)
class Plan(Tabular):
    """Effects that are simulated or neglected for one texture.

    Parameters
    ----------
    texture : Texture
        Texture with its widths over R.
    effects : tuple of Effect
        All effects considered.
    profile : Profile or None
        Rigid profile with the simulated effects; None if even the ridges are neglected.
    relative : float
        Required relative accuracy.
    solver : {"half-plane", "two-scale", "cylinder-fe"}
        Cheapest solver that reaches the required accuracy.

    Examples
    --------
    >>> from ridgebayes.scene.estimates import plan
    >>> import ridgebayes as rb
    >>> (first,) = plan(rb.Scene.of([(0.022, 0.02)]))
    >>> first.simulated, [effect.name for effect in first.left_out], first.solver
    (('ridges', "Poisson's ratio"), ['finite body and large deformation'], 'half-plane')
    >>> len(first.to_dataframe()), first.plot().get_xlabel()
    (13, 'relative change of a transition load (filled: simulated)')
    """

    texture: Texture
    effects: tuple[Effect, ...]
    profile: Profile | None
    relative: float = DEFAULT_RELATIVE
    solver: str = "half-plane"

    def __repr__(self) -> str:
        return f"Plan({plan_label(self.texture)}: {', '.join(self.simulated) or 'nothing'})"

    def to_dataframe(self) -> pd.DataFrame:
        """Return the effects as a table.

        Returns
        -------
        pandas.DataFrame
            One row per effect, with columns effect, number, estimated_rel_change, simulated,
            reason, cost_s, texture.
        """
        return plan_table([self])

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw the estimate of each effect as a bar, with the required accuracy.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Axes to draw on; those of a new figure if not given.

        Returns
        -------
        matplotlib.axes.Axes
            The axes drawn on.
        """
        relative = None if self.relative == DEFAULT_RELATIVE else self.relative
        return drawing.records.draw_plan(self.to_dataframe(), relative, ax)

    @property
    def simulated(self) -> tuple[str, ...]:
        """Names of the simulated effects."""
        return tuple(effect.name for effect in self.effects if effect.simulated)

    @property
    def left_out(self) -> tuple[Effect, ...]:
        """Effects that are not simulated although they exceed the required accuracy."""
        missing = [e for e in self.effects if e.name in BEYOND_HALF_PLANE and not e.simulated]
        return tuple(effect for effect in missing if effect.estimate > self.relative)


def plan_table(plans: list[Plan]) -> pd.DataFrame:
    """Return plans as a table with one row per effect of each texture."""
    rows = [asdict(e) | {"texture": plan_label(p.texture)} for p in plans for e in p.effects]
    names = {"name": "effect", "estimate": "estimated_rel_change"}
    columns = [*(field.name for field in fields(Effect)), "texture"]
    return pd.DataFrame(rows, columns=columns).rename(columns=names)


def plan_label(texture: Texture) -> str:
    """Return the label of a plan's texture, with its offset if that is not 0."""
    label = texture_label(texture.a_over_R, texture.b_over_R)
    return f"{label}_offset{texture.offset}" if texture.offset else label


def full_profile(texture: Texture) -> Profile:
    """Return the rigid profile with all features of a texture; a uniform offset becomes 0.5."""
    offset = 0.5 if texture.offset == "uniform" else float(texture.offset)
    return Profile(**texture.shape | {"offset": offset})


def beyond_reach(scene: Scene, solver: str = "auto") -> str:
    """Return a warning if the highest load of a scene exceeds the reach of its solver.

    Parameters
    ----------
    scene : Scene
        Scene.
    solver : str, optional
        As for `ridgebayes.generate`.

    Returns
    -------
    str
        Warning about a load beyond finite elements and small strain; empty if a solver covers it.

    Raises
    ------
    InputError
        If `solver` is "auto" or "two-scale" and no solver reaches the load, or if "two-scale" is
        named for a Poisson's ratio that it does not cover.
    """
    highest = max(scene.highest_load(texture) for texture in scene.textures)
    written = scene.body.load
    load = f"{written} is p/E = {highest:.2g}" if written else f"p/E = {highest:.2g}"
    if solver == "two-scale" and scene.nu < two_scale.LEAST_NU:
        rule = f"expected {two_scale.LEAST_NU:g} to 0.5 for two-scale"
        raise InputError(f"poissons_ratio = {scene.nu:g}: {rule}")
    has_two_scale = scene.nu >= two_scale.LEAST_NU
    reach = two_scale.REACH if has_two_scale else HIGHEST_LOAD
    if solver in ("auto", "two-scale") and highest > reach:
        number, _, unit = written.partition(" ")
        limit = f"p/E = {reach:g}"
        if number and written == f"{number} {unit}":
            limit += f", {float(number) * reach / highest:.3g} {unit}"
        why = "no solver goes further"
        why += "" if has_two_scale else f" where poissons_ratio is under {two_scale.LEAST_NU:g}"
        raise InputError(f"load: {load}; expected at most {limit}: {why}")
    two_scale_applies = not scene.friction and has_two_scale
    if highest <= HIGHEST_LOAD or (solver in ("auto", "two-scale") and two_scale_applies):
        return ""
    return (
        f"{load}; expected at most p/E = {HIGHEST_LOAD:g}. Above it finite elements often end "
        "without a result, and half-plane loads, which are for small strain, are far off"
    )
