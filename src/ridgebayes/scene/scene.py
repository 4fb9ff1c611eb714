"""`Scene`: textures, loads and required accuracy of a simulation, without solver settings."""

import itertools
import math
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, InstanceOf, field_validator, model_validator

from ridgebayes._types import NEO_HOOKEAN, Json
from ridgebayes.errors import InputError, expect
from ridgebayes.runtime.reading import refusing
from ridgebayes.scene import fields
from ridgebayes.scene.toml import DEFAULT_LOAD, DERIVED, read_scene_file, scene_text, scene_values
from ridgebayes.scene.units import NO_UNITS, Body


class Texture(fields.Record):
    """One ridged texture in units of the body's radius R.

    Attributes
    ----------
    a_over_R, b_over_R : float, scalar, dimensionless
        Ridge and groove width, 1e-50 to 1e50.
    groove_depth_over_R : float or None, scalar, dimensionless
        None for grooves too deep to be touched.
    corner_radius_over_R : float, scalar, dimensionless
        0 for sharp corners.
    offset : float or "uniform", scalar, pitches
        Position of the body's centre from a groove's centre; ``"uniform"`` for a random
        position.
    role : {"calibration", "held-out"}
        Whether its rows are fitted, or held out and compared with predictions.
    max_p_over_E : float or None, scalar, dimensionless
        Highest load on this texture; None for that of the scene.
    """

    a_over_R: fields.Positive
    b_over_R: fields.Positive
    groove_depth_over_R: fields.Positive | None = None
    corner_radius_over_R: fields.NotNegative = 0.0
    offset: fields.Offset = 0.0
    role: fields.Role = "calibration"
    max_p_over_E: fields.Positive | None = None

    @property
    def shape(self) -> Json:
        """Lengths over R by the names of `contact.rigid_profile.Profile`, and the offset."""
        depth = self.groove_depth_over_R
        return {
            "a": self.a_over_R,
            "b": self.b_over_R,
            "depth": math.inf if depth is None else depth,
            "corner": self.corner_radius_over_R,
            "offset": self.offset,
        }

    @model_validator(mode="after")
    def _shape_fits(self) -> "Texture":
        for name, (holds, rule) in fields.shape_rules(self.shape).items():
            if not holds:
                raise ValueError(f"{DERIVED[name]} = {self.shape[name]!r}: must be {rule}")
        return self


class Scene(fields.Record):
    """A soft cylinder on ridged textures, in dimensionless numbers.

    Parameters
    ----------
    textures : tuple of Texture, shape (n_texture,)
        At least one; no two textures have the same widths and offset.
    nu : float, scalar, dimensionless
        Poisson's ratio of the body, 0 to 0.5.
    ogden : tuple of (float, float)
        Shares of the shear modulus, and exponents, as in `contact.cylinder.material.Material`;
        neo-Hookean if not given.
    p_over_E : float, scalar, dimensionless
        Highest load per projected area over Young's modulus.
    friction : float, scalar, dimensionless
        Coulomb's friction coefficient.
    relative : float or None, scalar, dimensionless
        Required relative accuracy of each transition load; the solver's if None.
    uncertain : scene.uncertain.Uncertain or None, optional
        Distributions whose medians are the values above; see `from_toml` and `from_dict`.
    body : scene.units.Body, optional
        Radius, modulus and length in SI units, to convert loads and lengths with units; empty if
        the scene has no units. Scenes that differ only in their body are equal.

    Examples
    --------
    >>> scene = Scene.of([(0.032, 0.01)], p_over_E=0.01)
    >>> scene.textures[0].a_over_R, scene.nu
    (0.032, 0.5)

    A scene file that `to_toml` writes has no units:

    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     scene.to_toml(f"{folder}/scene.toml")
    ...     Scene.from_toml(f"{folder}/scene.toml") == scene
    True

    The values of an uncertain scene are medians:

    >>> width = {"ridge_width": "normal(0.032, 5 %)", "groove_width": 0.01}
    >>> unsure = Scene.from_dict({"texture": width})
    >>> unsure.uncertain_names, unsure.at_medians().uncertain_names
    (('texture.ridge_width',), ())
    >>> [part.textures[0].a_over_R for part in Scene.of([(0.03, 0.01), (0.02, 0.01)]).apart]
    [0.03, 0.02]
    """

    textures: Annotated[tuple[Texture, ...], Field(min_length=1)]
    nu: fields.PoissonsRatio = 0.5
    ogden: fields.OgdenTerms = NEO_HOOKEAN
    p_over_E: fields.Positive = DEFAULT_LOAD
    friction: fields.NotNegative = 0.0
    relative: fields.Relative | None = None
    uncertain: Annotated[Any, Field(exclude=True, repr=False)] = None
    body: Annotated[InstanceOf[Body], Field(exclude=True, repr=False)] = NO_UNITS

    def __eq__(self, other: object) -> bool:
        same_body = {"body": self.body}
        return isinstance(other, Scene) and super().__eq__(other.model_copy(update=same_body))

    def __hash__(self) -> int:
        return hash((self.textures, self.nu, self.p_over_E))

    def highest_load(self, texture: Texture) -> float:
        """Return the highest load on a texture: `max_p_over_E` if given, or that of the scene.

        Parameters
        ----------
        texture : Texture
            Texture of the scene.

        Returns
        -------
        float, scalar, dimensionless
            p/E.

        Examples
        --------
        >>> scene = Scene.paper()
        >>> scene.highest_load(scene.textures[0]), scene.highest_load(scene.textures[-1])
        (0.02, 0.045)
        """
        return self.p_over_E if texture.max_p_over_E is None else texture.max_p_over_E

    @field_validator("textures")
    @classmethod
    def _refuse_repeats(cls, textures: tuple[Texture, ...]) -> tuple[Texture, ...]:
        seen: dict[tuple[float, float, float | str], int] = {}
        for number, texture in enumerate(textures, start=1):
            key = (texture.a_over_R, texture.b_over_R, texture.offset)
            if key in seen:
                raise ValueError(f"textures {seen[key]} and {number} have the same widths: {key}")
            seen[key] = number
        return textures

    @classmethod
    def of(
        cls,
        textures: Iterable[tuple[float, float]],
        *,
        p_over_E: float = 0.02,
        nu: float = 0.5,
        relative: float | None = None,
    ) -> "Scene":
        """Make a scene of textures with sharp ridges, deep grooves and no offset.

        Parameters
        ----------
        textures : iterable of (float, float), shape (n_texture, 2), dimensionless
            Ridge and groove width over R of each texture.
        p_over_E, nu, relative : float, scalar, dimensionless
            As in `Scene`.

        Returns
        -------
        Scene

        Raises
        ------
        InputError
            If a value breaks a rule of `Scene` or `Texture`.

        Examples
        --------
        >>> Scene.of([(0.012, -0.01)])
        Traceback (most recent call last):
            ...
        ridgebayes.errors.InputError: Texture: b_over_R = -0.01: input should be greater than 0
        """
        with refusing("textures", TypeError, ValueError, rule="; expected pairs of widths over R"):
            records = tuple(Texture(a_over_R=float(a), b_over_R=float(b)) for a, b in textures)
        return cls(textures=records, p_over_E=p_over_E, nu=nu, relative=relative)

    @classmethod
    def paper(cls) -> "Scene":
        """Return the scene of the study: nine textures to p/E 0.02, and a held-out texture.

        Returns
        -------
        Scene
            a/R in {0.012, 0.022, 0.032} x b/R in {0.01, 0.02, 0.03}, and the held-out texture
            (0.012, 0.09) to p/E 0.045.

        References
        ----------
        doi:10.1016/j.ijssolstr.2019.06.026, section 2.

        Examples
        --------
        >>> [t.role for t in Scene.paper().textures].count("calibration")
        9
        """
        pairs = itertools.product((0.012, 0.022, 0.032), (0.01, 0.02, 0.03))
        nine = [Texture(a_over_R=a, b_over_R=b) for a, b in pairs]
        extreme = Texture(a_over_R=0.012, b_over_R=0.09, role="held-out", max_p_over_E=0.045)
        return cls(textures=(*nine, extreme))

    @classmethod
    def from_toml(cls, path: str | os.PathLike[str]) -> "Scene":
        """Read a scene file.

        Parameters
        ----------
        path : str or path
            TOML file with the keys of `ridgebayes.scene.toml`; all quantities have units, or none.

        Returns
        -------
        Scene

        Raises
        ------
        InputError
            If the file cannot be read or a key breaks a rule. The message names the file and all
            invalid keys with their values and rules.
        """
        expect(str, os.PathLike, path=path)
        return cls._of_values(read_scene_file(Path(path)), str(path))

    @classmethod
    def from_dict(cls, data: Json) -> "Scene":
        """Make a scene from a dict with the tables of a scene file.

        Parameters
        ----------
        data : dict
            Tables and keys of a scene file. A value may also be a frozen distribution of
            scipy.stats, an array of draws, or a callable of a numpy generator that returns one
            draw, all in SI units if the scene has units. ``joint`` is a list of tables. In each,
            ``of`` lists places such as ``texture.ridge_width``, and either ``correlation`` relates
            their values, or ``draws`` (rows, or a frozen multivariate distribution) replaces them.

        Returns
        -------
        Scene
            Scene of the medians; `uncertain` keeps the distributions.

        Raises
        ------
        InputError
            As `from_toml`.

        Examples
        --------
        >>> from scipy import stats
        >>> body = {"radius": "8 mm", "youngs_modulus": stats.lognorm(0.2, scale=60e3)}
        >>> texture = {"ridge_width": "0.2 mm", "groove_width": "lognormal(0.16 mm, 5 %)"}
        >>> scene = Scene.from_dict({"body": body, "texture": texture, "load": {"max": "1.2 kPa"}})
        >>> scene.textures[0].b_over_R, scene.p_over_E, sorted(scene.uncertain.sources)
        (0.02, 0.02, ['body.youngs_modulus', 'texture.groove_width'])
        """
        expect(dict, data=data)
        return cls._of_values(scene_values(data), "scene")

    @classmethod
    def _of_values(cls, values: Json, where: str) -> "Scene":
        textures = list[Texture]()
        try:
            for texture in values.pop("textures"):
                textures.append(Texture(**texture))
            return cls(textures=tuple(textures), **values)
        except InputError as error:
            here = f"{where}: texture[{len(textures) + 1}]: "
            text = str(error).replace("Texture: ", here).replace("Scene: ", f"{where}: ")
            raise InputError(text) from None

    @property
    def uncertain_names(self) -> tuple[str, ...]:
        """Keys of the scene file whose values are distributions."""
        return () if self.uncertain is None else tuple(self.uncertain.texts)

    def at_medians(self) -> "Scene":
        """Return the scene of the medians, without distributions.

        Returns
        -------
        Scene
            Scene without uncertain values.
        """
        return self.model_copy(update={"uncertain": None})

    @property
    def apart(self) -> tuple["Scene", ...]:
        """One scene per texture, with the same body and load."""
        scenes = []
        for number, texture in enumerate(self.textures, start=1):
            uncertain = self.uncertain and self.uncertain.of_texture(number)
            scenes.append(self.model_copy(update={"textures": (texture,), "uncertain": uncertain}))
        return tuple(scenes)

    def to_toml(self, path: str | os.PathLike[str]) -> None:
        """Write the scene without units; `Scene.from_toml` reads an equal scene.

        Parameters
        ----------
        path : str or path
            File to write. An existing file is overwritten.

        Raises
        ------
        OSError
            If the file cannot be written.
        InputError
            If the scene is uncertain: distributions cannot be written.
        """
        expect(str, os.PathLike, path=path)
        if self.uncertain is not None:
            raise InputError(
                f"scene: {', '.join(self.uncertain_names)}: distributions cannot be written; "
                "`at_medians()` gives the scene of the medians"
            )
        textures = [texture.model_dump(exclude_defaults=True) for texture in self.textures]
        ogden = None if self.ogden == NEO_HOOKEAN else self.ogden
        text = scene_text(self.model_dump() | {"textures": textures, "ogden": ogden})
        Path(path).write_text(text, encoding="utf-8")


def as_scene(scene: Scene | str | os.PathLike[str]) -> Scene:
    """Return a scene, read from its TOML file if a path is given.

    Raises
    ------
    InputError
        If `scene` is neither a scene nor a path, or the file cannot be read or breaks a rule.
    """
    if isinstance(scene, Scene):
        return scene
    if isinstance(scene, str | os.PathLike):
        return Scene.from_toml(scene)
    raise InputError(f"scene: expected a Scene or a path, got {type(scene).__name__}")
