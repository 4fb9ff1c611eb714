"""Which effects a scene calls for, as records, and how far solvers go; `estimates` decides."""

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

# Without a wanted accuracy only what has no effect at all is left out.
DEFAULT_RELATIVE = DEFAULT_REL_TOL
BEYOND_HALF_PLANE = ("finite body and large deformation", "friction")
# Finite elements themselves are right to about this: a smaller effect is not worth them.
FINITE_ELEMENT_ERROR = 0.002
HIGHEST_LOAD = 0.1  # p/E to which finite elements go: docs/validation/cylinder.md


@dataclass(frozen=True)
class Effect:
    """One effect on the transition loads of one texture.

    Parameters
    ----------
    name : str
        Such as ``corner radius``.
    number : float
        Dimensionless number that the effect depends on; NaN where a scene does not give it.
    estimate : float
        Largest relative change of a transition load when it is neglected; NaN where unknown.
    simulated : bool
        Whether loads take it into account.
    reason : str
        Reason, with the number's definition.
    cost_s : float
        CPU seconds that simulating it takes or would take; NaN where nothing here can.
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
        The rigid side with the effects that are simulated; None where even the ridges are
        neglected.
    relative : float
        Accuracy wanted.
    solver : {"half-plane", "two-scale", "cylinder-fe"}
        Solver that computes loads to that accuracy at the least cost.

    Examples
    --------
    >>> from ridgebayes.scene.estimates import plan
    >>> import ridgebayes as rb
    >>> (found,) = plan(rb.Scene.of([(0.022, 0.02)]))
    >>> found.simulated, [effect.name for effect in found.left_out], found.solver
    (('ridges', "Poisson's ratio"), ['finite body and large deformation'], 'half-plane')
    >>> len(found.to_dataframe()), found.plot().get_xlabel()
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
            A row an effect: columns effect, number, estimated_rel_change, simulated, reason,
            cost_s, texture.
        """
        return plan_table([self])

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw the size of each effect as a bar, against the wanted accuracy.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure's if not given.

        Returns
        -------
        matplotlib.axes.Axes
            The axes drawn on.
        """
        relative = None if self.relative == DEFAULT_RELATIVE else self.relative
        return drawing.records.draw_plan(self.to_dataframe(), relative, ax)

    @property
    def simulated(self) -> tuple[str, ...]:
        """Names of the effects that loads take into account."""
        return tuple(effect.name for effect in self.effects if effect.simulated)

    @property
    def left_out(self) -> tuple[Effect, ...]:
        """Effects that are not simulated although they exceed the wanted accuracy."""
        missing = [e for e in self.effects if e.name in BEYOND_HALF_PLANE and not e.simulated]
        return tuple(effect for effect in missing if effect.estimate > self.relative)


def plan_table(plans: list[Plan]) -> pd.DataFrame:
    """Return plans as a table: a row an effect of a texture."""
    rows = [asdict(e) | {"texture": plan_label(p.texture)} for p in plans for e in p.effects]
    names = {"name": "effect", "estimate": "estimated_rel_change"}
    columns = [*(field.name for field in fields(Effect)), "texture"]
    return pd.DataFrame(rows, columns=columns).rename(columns=names)


def plan_label(texture: Texture) -> str:
    """Return the label of a plan's texture: with its offset, if it has one."""
    label = texture_label(texture.a_over_R, texture.b_over_R)
    return f"{label}_offset{texture.offset}" if texture.offset else label


def full_profile(texture: Texture) -> Profile:
    """Return the rigid side with all that a texture gives; a uniform offset is the largest."""
    offset = 0.5 if texture.offset == "uniform" else float(texture.offset)
    return Profile(**texture.shape | {"offset": offset})


def beyond_reach(scene: Scene, solver: str = "auto") -> str:
    """Say that the highest load of a scene is beyond its solver's reach; nothing if it is not.

    Parameters
    ----------
    scene : Scene
        Scene with its loads.
    solver : str, optional
        As for `ridgebayes.generate`.

    Returns
    -------
    str
        Warning about loads beyond finite elements and small strain; empty if there is none.

    Raises
    ------
    InputError
        If no solver goes as far, or the one that is named does not, and "half-plane" is not named.
    """
    highest = max(scene.highest_load(texture) for texture in scene.textures)
    written = scene.body.load
    load = f"{written} is p/E = {highest:.2g}" if written else f"p/E = {highest:.2g}"
    if solver == "two-scale" and scene.nu < two_scale.LEAST_NU:
        rule = f"expected {two_scale.LEAST_NU:g} to 0.5 for two-scale"
        raise InputError(f"poissons_ratio = {scene.nu:g}: {rule}")
    two_scales = scene.nu >= two_scale.LEAST_NU
    reach = two_scale.REACH if two_scales else HIGHEST_LOAD
    if solver in ("auto", "two-scale") and highest > reach:
        number, _, unit = written.partition(" ")
        most = f"p/E = {reach:g}"
        if number and written == f"{number} {unit}":
            most += f", {float(number) * reach / highest:.3g} {unit}"
        why = "no solver goes further"
        why += "" if two_scales else f" where poissons_ratio is under {two_scale.LEAST_NU:g}"
        raise InputError(f"load: {load}; expected at most {most}: {why}")
    goes_on = not scene.friction and two_scales
    if highest <= HIGHEST_LOAD or (solver in ("auto", "two-scale") and goes_on):
        return ""
    return (
        f"{load}; expected at most p/E = {HIGHEST_LOAD:g}. Above it finite elements often end "
        "without a result, and half-plane loads, which are for small strain, are far off"
    )
