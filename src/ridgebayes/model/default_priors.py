"""Default priors of the parameters of forms and error models."""

from collections.abc import Mapping
from pathlib import Path

from ridgebayes.contact.scaling import Texture
from ridgebayes.distributions.auto import at_place
from ridgebayes.distributions.distribution import Distribution, LogNormal, Normal
from ridgebayes.distributions.grammar import parse_distribution
from ridgebayes.errors import InputError
from ridgebayes.model.forms import Classic, Form, PowerLaw
from ridgebayes.model.noise import Noise
from ridgebayes.runtime.reading import read_toml

SLOPES = "K"  # key of the common prior of all power-law slopes, including those of new textures
(HERTZ,) = Classic.published  # smooth Hertz coefficient at nu = 0.5
_DEFAULTS = read_toml(Path(__file__).with_name("default_priors.toml"))
REASONS = {name: entry["reason"] for part in _DEFAULTS.values() for name, entry in part.items()}
NOISE_PRIORS = {name: parse_distribution(x["prior"]) for name, x in _DEFAULTS["noise"].items()}


def default_priors(
    form: Form, noise: Noise | None = None, given: Mapping[str, Distribution] | None = None
) -> dict[str, Distribution]:
    """Return the default prior of each parameter of a form and an error model.

    Parameters
    ----------
    form : Form
        Form; PowerLaw must be bound to its textures.
    noise : Noise, optional
        Error model; independent normal errors if not given.
    given : mapping of str to Distribution, optional
        Priors of coefficients without a default, as forms outside this package may have.

    Returns
    -------
    dict of str to Distribution
        Coefficients, then the error model's parameters, sigma first.

    Raises
    ------
    InputError
        If a coefficient has neither a default nor a given prior.

    Examples
    --------
    >>> from ridgebayes.model.forms import Hybrid
    >>> list(default_priors(Hybrid()))
    ['c1', 'c2', 'sigma']
    """
    coefficients = {
        name: prior for name, prior in (given or {}).items() if name not in NOISE_PRIORS
    }
    priors = {
        name: coefficients.get(name) if prior is None else prior
        for name, prior in coefficient_priors(form).items()
    }
    missing = [name for name, prior in priors.items() if prior is None]
    if missing:
        raise InputError(
            f"{form.name}: expected a prior of {', '.join(map(repr, missing))}, got none; only c, "
            "c1, c2 have defaults, pass priors={name: prior}"
        )
    complete = {name: prior for name, prior in priors.items() if prior is not None}
    return complete | {name: NOISE_PRIORS[name] for name in (noise or Noise()).parameter_names}


def coefficient_priors(form: Form) -> dict[str, Distribution | None]:
    """Return the default prior of each coefficient of a form; None if it has no default.

    Parameters
    ----------
    form : Form
        Form; PowerLaw must be bound to its textures.

    Raises
    ------
    InputError
        If two parameters have the same name, one of the error models' included.
    """
    if isinstance(form, PowerLaw):
        slopes = zip(form.parameter_names, form.textures, strict=True)
        return {name: slope_prior(texture, {}) for name, texture in slopes}
    names = form.parameter_names
    if len({*names, *NOISE_PRIORS}) < len(names) + len(NOISE_PRIORS):
        raise InputError(
            f"{form.name}: parameter_names: expected names that differ from each other and from "
            f"{', '.join(NOISE_PRIORS)}, got {', '.join(names)}"
        )
    priors: dict[str, Distribution] = {
        "c": LogNormal(1.0 if form.name == "half-plane" else HERTZ, 0.1),
        "c1": LogNormal(HERTZ, 0.1),
        "c2": Normal(0.0, 0.05),
    }
    return {name: priors.get(name) for name in names}


def replaced_priors(
    form: Form, noise: Noise, given: Mapping[str, Distribution] | None
) -> tuple[dict[str, Distribution], dict[str, Distribution]]:
    """Return the prior of each parameter, with replacements, and the given prior of all slopes.

    Parameters
    ----------
    form : Form
        Form; PowerLaw must be bound to its textures.
    noise : Noise
        Error model.
    given : mapping of str to Distribution, optional
        Replacements by parameter. For PowerLaw the key `SLOPES` replaces the priors of all slopes
        that are not given by name.

    Returns
    -------
    tuple of dict of str to Distribution
        Priors by parameter, and a dictionary with the prior of `SLOPES`, empty if not given.

    Raises
    ------
    InputError
        If a prior belongs to no parameter, or its support begins below that of the default.
    """
    replaced = dict(given or {})
    slopes = {}
    if isinstance(form, PowerLaw) and SLOPES in replaced:
        slopes = {SLOPES: replaced.pop(SLOPES)}
        names = zip(form.parameter_names, form.textures, strict=True)
        replaced = {name: slope_prior(texture, slopes) for name, texture in names} | replaced
    defaults = default_priors(form, noise, replaced)
    for name, prior in replaced.items():
        default = defaults.get(name)
        if default is None or prior.support[0] < default.support[0]:
            raise InputError(
                f"prior of {name!r}: expected one of {', '.join(defaults)}, with the support of "
                f"its default, got {prior}"
            )
    return defaults | replaced, slopes


def slope_prior(texture: Texture, slopes: Mapping[str, Distribution]) -> Distribution:
    """Return the prior of the power law's K at a texture.

    Parameters
    ----------
    texture : tuple of (float, float)
        a/R and b/R.
    slopes : mapping of str to Distribution
        Common prior of all slopes under the key `SLOPES`; the default if it is empty.
    """
    a, b = texture
    # The median is that of smooth Hertz contact at the texture's pitch, K = 2 c / L.
    default = LogNormal(2 * HERTZ / (a + b), 0.3)
    return at_place(slopes[SLOPES], default.median) if SLOPES in slopes else default
