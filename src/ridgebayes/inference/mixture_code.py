"""Text for PyMC, NumPyro and Stan that takes a posterior mixture as a prior.

All sample coordinates x that are nearly standard normal: the mixture's scores are z = centre + L x.
"""

import math
import re
from collections.abc import Mapping, Sequence

import numpy as np

from ridgebayes._types import FloatArray, Json
from ridgebayes.distributions.bounded import Truncated, Uniform
from ridgebayes.distributions.distribution import Distribution, HalfNormal, LogNormal
from ridgebayes.errors import InputError

# Of each program: the standard normal's distribution function, its inverse, and exp.
_FUNCTIONS = {
    "pymc": ("_cdf({})", "_quantile({})", "pt.exp({})"),
    "numpyro": ("ndtr({})", "ndtri({})", "jnp.exp({})"),
    "stan": ("Phi({})", "inv_Phi({})", "exp({})"),
}
_PYMC = '''import numpy as np
import pymc as pm
import pytensor.tensor as pt

{numbers}

def _cdf(x):
    return 0.5 * pt.erfc(-x / np.sqrt(2.0))


def _quantile(p):
    return -np.sqrt(2.0) * pt.erfcinv(2.0 * p)


def ridgebayes_prior():
    """Add the posterior to the model that is open; return its parameters by name."""
    parts = pm.MvNormal.dist(mu=MEANS, chol=FACTORS)
    x = pm.Mixture("ridgebayes_x", w=WEIGHTS, comp_dists=parts)
    z = CENTRE + pt.dot(SCALE, x)
    found = {{}}
{lines}
    return {{name: pm.Deterministic(name, value) for name, value in found.items()}}
'''
_NUMPYRO = '''import jax.numpy as jnp
import numpy as np
import numpyro
import numpyro.distributions as dist
from jax.scipy.special import ndtr, ndtri

{numbers}

def ridgebayes_prior():
    """Add the posterior to the model that is traced; return its parameters by name."""
    parts = dist.MultivariateNormal(jnp.array(MEANS), scale_tril=jnp.array(FACTORS))
    mixture = dist.MixtureSameFamily(dist.Categorical(probs=jnp.array(WEIGHTS)), parts)
    x = numpyro.sample("ridgebayes_x", mixture)
    z = jnp.array(CENTRE) + jnp.array(SCALE) @ x
    found = {{}}
{lines}
    return {{name: numpyro.deterministic(name, value) for name, value in found.items()}}
'''
_STAN = """transformed data {{
{numbers}
}}
parameters {{
  vector[{d}] ridgebayes_x;
}}
transformed parameters {{
  vector[{d}] z = centre + scale * ridgebayes_x;
{lines}
}}
model {{
  vector[{k}] ridgebayes_lp;
  for (j in 1:{k}) {{
    ridgebayes_lp[j] = log(weights[j])
      + multi_normal_cholesky_lpdf(ridgebayes_x | means[j], factors[j]);
  }}
  target += log_sum_exp(ridgebayes_lp);
}}
"""


def mixture_code(given: Json, transforms: Sequence[Distribution], program: str) -> str:
    """Return the text for a program.

    Parameters
    ----------
    given : dict
        A mixture as `PosteriorMixture.to_dict` returns it.
    transforms : sequence of Distribution
        Of its parameters.
    program : str
        ``pymc``, ``numpyro`` or ``stan``.
    """
    if program not in _FUNCTIONS:
        raise InputError(f"code: expected one of {', '.join(_FUNCTIONS)}, got {program!r}")
    weights, means, covariances = (
        np.array(given[key]) for key in ("weights", "means", "covariances")
    )
    centre = weights @ means
    apart = means - centre
    total = np.einsum("k,kij->ij", weights, covariances + apart[:, :, None] * apart[:, None, :])
    scale = np.linalg.cholesky(total)
    inverse = np.linalg.inv(scale)
    factors = np.linalg.cholesky(inverse @ covariances @ inverse.T)
    numbers = {
        "weights": weights,
        "means": apart @ inverse.T,
        "factors": factors,
        "centre": centre,
        "scale": scale,
    }
    names = _identifiers(given["names"])
    is_stan = program == "stan"
    at = "z[{}]" if is_stan else "z[..., {}]"
    values = [_value(one, at.format(i + is_stan), program) for i, one in enumerate(transforms)]
    if is_stan:
        lines = [f"  real {name} = {value};" for name, value in zip(names, values, strict=True)]
        body = _STAN.format(
            numbers=_stan_numbers(numbers), lines="\n".join(lines), d=len(names), k=len(weights)
        )
    else:
        pairs = zip(names, values, strict=True)
        lines = [f"    found[{name!r}] = {value}" for name, value in pairs]
        text = [f"{name.upper()} = np.array({v.tolist()!r})" for name, v in numbers.items()]
        template = _PYMC if program == "pymc" else _NUMPYRO
        body = template.format(numbers="\n".join(text) + "\n", lines="\n".join(lines))
    mark = "//" if is_stan else "#"
    return "".join(f"{mark} {line}\n" for line in _header(given)) + body


def _header(given: Json) -> list[str]:
    """Return what the numbers stand for, a line each."""
    distance, validity = given["distance"], given["validity"]
    ratios = [abs(ratio - 1) for ratio in distance["sd_ratio"].values()]
    shifts = [abs(shift) for shift in distance["mean_shift_in_sd"].values()]
    lines = [
        f"Posterior of the {given['form']} form under {given['noise']} errors, as a mixture.",
        f"Made by ridgebayes {given['ridgebayes_version']} from {given['fitted_rows']} rows, "
        f"sha256 {given['fitted_rows_digest'][:16]}.",
        f"Calibrated on: {', '.join(f'{name} {value}' for name, value in validity.items())}.",
        f"From the draws: means within {max(shifts):.2g} sd, sds within {max(ratios):.1%}, "
        f"correlations within {distance['largest_correlation_difference']:.2g}.",
    ]
    if not given["converged"]:
        lines.append("The fit had NOT converged.")
    return lines


def _identifiers(names: Sequence[str]) -> list[str]:
    """Return names of letters, digits and underscores, no two alike."""
    made = [re.sub(r"\W+", "_", name, flags=re.ASCII).strip("_") for name in names]
    return [f"{name}_{i}" if made.count(name) > 1 else name for i, name in enumerate(made)]


def _value(transform: Distribution, z: str, program: str) -> str:
    """Return the expression of the value with a normal score."""
    cdf, quantile, exp = _FUNCTIONS[program]
    if isinstance(transform, Truncated):
        least, most = transform.base.support
        low, high = transform.support
        below = _normal_cdf(transform.base.score(low)) if low > least else 0.0
        above = _normal_cdf(-transform.base.score(high)) if high < most else 0.0
        # From the tail that is not cut off, or less so.
        if below <= above:
            p = f"{below!r} + {1 - below - above!r} * {cdf.format(z)}"
            inner = quantile.format(p)
        else:
            p = f"{above!r} + {1 - below - above!r} * {cdf.format(f'-{z}')}"
            inner = f"(-{quantile.format(p)})"
        return _value(transform.base, inner, program)
    if isinstance(transform, LogNormal):
        return exp.format(f"{math.log(transform.median)!r} + {transform.log_sd!r} * {z}")
    if isinstance(transform, HalfNormal):
        tail = f"0.5 * {cdf.format(f'-{z}')}"
        return f"-{transform.sd!r} * {quantile.format(tail)}"
    if isinstance(transform, Uniform):
        return f"{transform.low!r} + {transform.high - transform.low!r} * {cdf.format(z)}"
    mean, sd = vars(transform).values()  # Normal
    return f"{mean!r} + {sd!r} * {z}"


def _normal_cdf(score: FloatArray) -> float:
    return 0.5 * math.erfc(-float(score) / math.sqrt(2))


def _stan(values: FloatArray) -> str:
    """Return a list of numbers, or of such lists, as Stan writes a row vector or a matrix."""
    if values.ndim == 0:
        return repr(float(values))
    return f"[{', '.join(_stan(one) for one in values)}]"


def _stan_numbers(numbers: Mapping[str, FloatArray]) -> str:
    """Return declarations of the mixture's numbers."""
    k, d = numbers["means"].shape
    means = ", ".join(_stan(one) + "'" for one in numbers["means"])
    factors = ", ".join(_stan(one) for one in numbers["factors"])
    lines = [
        f"vector[{k}] weights = {_stan(numbers['weights'])}';",
        f"array[{k}] vector[{d}] means = {{{means}}};",
        f"array[{k}] matrix[{d}, {d}] factors = {{{factors}}};",
        f"vector[{d}] centre = {_stan(numbers['centre'])}';",
        f"matrix[{d}, {d}] scale = {_stan(numbers['scale'])};",
    ]
    return "\n".join(f"  {line}" for line in lines)
