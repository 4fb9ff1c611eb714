"""Replacements for default priors, from a TOML file or from arguments.

A file has a table for each form, and a table for the error models. `distributions.grammar` lists
the distributions:

    [hybrid]
    c1 = "lognormal(1.382, 10 %)"  # median, sd of the logarithm
    c2 = "normal(0, 0.05)"         # mean, sd
    [power-law]
    K = "lognormal(auto, 30 %)"    # of every texture; auto: smooth Hertz at the texture's pitch
    [noise]
    sigma = "halfnormal(0.05)"     # scale
    df = "gamma(2, 0.1)"           # shape, rate
"""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

from ridgebayes.distributions.auto import at_place
from ridgebayes.distributions.distribution import Distribution, LogNormal
from ridgebayes.distributions.grammar import parse_distribution
from ridgebayes.distributions.scipy_frozen import from_scipy
from ridgebayes.errors import InputError
from ridgebayes.model.default_priors import NOISE_PRIORS, SLOPES, coefficient_priors
from ridgebayes.model.forms import Form, PowerLaw
from ridgebayes.model.noise import Noise
from ridgebayes.model.observations import Observations
from ridgebayes.runtime.reading import read_toml
from ridgebayes.runtime.text import clipped

OF_ERRORS = "noise"  # key of the priors of error models
# By form name or "noise", then by parameter: distributions, SciPy's frozen distributions, texts.
Priors: TypeAlias = Mapping[str, Mapping[str, Any]]
ResolvedPriors: TypeAlias = Mapping[str, Mapping[str, Distribution]]


def resolve_priors(
    given: Mapping[str, object] | str | os.PathLike[str] | None,
    forms: Sequence[Form],
    noises: Sequence[Noise],
    data: Observations,
) -> dict[str, dict[str, Distribution]]:
    """Return the distributions that replace default priors.

    Parameters
    ----------
    given : mapping or path, optional
        Priors by form name (or ``noise``) and parameter name, or the path of a TOML file. K of the
        power law applies to every texture that is not given by name. Resolved priors may be
        resolved again.
    forms : sequence of Form
        Forms that are fitted.
    noises : sequence of Noise
        Error models.
    data : Observations
        Rows, whose textures define the power law's K.

    Raises
    ------
    InputError
        If a form or a parameter is unknown, if a value is not a known distribution, or if it allows
        values below 0 for a positive parameter. The message names key and value.
    """
    where, folder = "priors", Path()  # beginning of messages, and folder of sample files
    if isinstance(given, str | os.PathLike):
        where, folder = str(given), Path(given).parent
        given = read_toml(Path(given))
    elif not isinstance(given, Mapping | None):
        raise InputError(f"{where}: expected a mapping by form or a path, got {given!r}")
    defaults: dict[str, dict[str, Distribution | None]] = {
        form.name: dict(coefficient_priors(form.bind(data.textures, data.labels))) for form in forms
    }
    defaults[OF_ERRORS] = {
        name: NOISE_PRIORS[name] for noise in noises for name in noise.parameter_names
    }
    resolved: dict[str, dict[str, Distribution]] = {}
    for owner, texts in (given or {}).items():
        if owner not in defaults:
            expected = ", ".join(sorted(defaults))
            raise InputError(f"{where}: expected one of {expected}, got {clipped(str(owner))}")
        if not isinstance(texts, Mapping):
            raise InputError(f"{where}: {owner}: expected priors by parameter, got {texts!r}")
        resolved[owner] = {}
        for name in sorted(texts, key=lambda name: name != SLOPES):  # K of one texture overrides K
            value, parameters = texts[name], [name]
            if owner == PowerLaw.name and name == SLOPES:
                parameters = list(defaults[owner])
                value = resolved[owner][name] = _common_slope_prior(
                    value, f"{where}: [{owner}]", folder
                )
            elif name not in defaults[owner]:
                expected = ", ".join(
                    dict.fromkeys(parameter.partition("[")[0] for parameter in defaults[owner])
                )
                shown = clipped(str(name))
                raise InputError(f"{where}: [{owner}]: expected one of {expected}, got {shown}")
            for parameter in parameters:
                at, default = f"{where}: [{owner}] {name}", defaults[owner][parameter]
                resolved[owner][parameter] = _resolved(value, default, at, folder)
    return resolved


def priors_of(priors: ResolvedPriors | None, form: Form, noise: Noise) -> dict[str, Distribution]:
    """Return the replaced priors of a form's and an error model's parameters."""
    priors_of_owner = priors or {}
    shared = priors_of_owner.get(OF_ERRORS, {})
    of_noise = {name: prior for name, prior in shared.items() if name in noise.parameter_names}
    return {**priors_of_owner.get(form.name, {}), **of_noise}


def _resolved(
    value: object, default: Distribution | None, where: str, folder: Path
) -> Distribution:
    """Return the distribution of a parameter, with ``auto`` replaced by the default's median."""
    auto = float(default.median) if isinstance(default, LogNormal) else None
    value = from_scipy(value, where)
    if not isinstance(value, Distribution):
        value = parse_distribution(value, where, folder=folder, auto=auto is not None)
    if auto is not None:
        value = at_place(value, auto)
    if default is not None and value.support[0] < default.support[0]:
        raise InputError(f"{where}: expected a distribution above 0, got {value.words}")
    return value


def _common_slope_prior(value: object, where: str, folder: Path) -> Distribution:
    """Return the common prior of all slopes, in which ``auto`` is not yet replaced."""
    value = from_scipy(value, where)
    if isinstance(value, Distribution):
        return value
    return parse_distribution(value, f"{where} {SLOPES}", folder=folder, auto=True)
