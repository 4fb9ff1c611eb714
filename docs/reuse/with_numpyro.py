"""Sample the mixture of hybrid.json with NumPyro: the prior part of a model of your own."""

import json
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import numpyro
import numpyro.distributions as dist
from jax.scipy.special import ndtr, ndtri
from numpyro.infer import MCMC, NUTS
from scipy import stats

BASES = {  # base of a truncated prior
    "normal": lambda t: stats.norm(t["mean"], t["sd"]),
    "log-normal": lambda t: stats.lognorm(t["log_sd"], scale=t["median"]),
    "half-normal": lambda t: stats.halfnorm(scale=t["sd"]),
    "uniform": lambda t: stats.uniform(t["low"], t["high"] - t["low"]),
}


def value(t, z):
    """Return the parameter that has the normal score z."""
    if t["kind"] == "normal":
        return t["mean"] + t["sd"] * z
    if t["kind"] == "log-normal":
        return t["median"] * jnp.exp(t["log_sd"] * z)
    if t["kind"] == "half-normal":
        return -t["sd"] * ndtri(0.5 * ndtr(-z))
    if t["kind"] == "uniform":
        return t["low"] + (t["high"] - t["low"]) * ndtr(z)
    base = BASES[t["base"]["kind"]](t["base"])
    below, above = base.cdf(t["low"]), base.sf(t["high"])
    sign, tail = (1, below) if below <= above else (-1, above)
    inner = sign * ndtri(tail + (1 - below - above) * ndtr(sign * z))
    return value(t["base"], inner)


given = json.loads(Path("hybrid.json").read_text())
w, m, C = (np.array(given[key]) for key in ("weights", "means", "covariances"))
S = np.linalg.cholesky(C[0])
inverse = np.linalg.inv(S)
factors = np.linalg.cholesky(inverse @ C @ inverse.T)


def model():
    """Draw the parameters from the mixture."""
    parts = dist.MultivariateNormal((m - m[0]) @ inverse.T, scale_tril=factors)
    x = numpyro.sample("x", dist.MixtureSameFamily(dist.Categorical(probs=w), parts))
    z = m[0] + jnp.dot(S, x)
    found = {}  # c1, c2, sigma, with their correlation
    for i, (name, t) in enumerate(zip(given["names"], given["transforms"], strict=True)):
        found[name] = numpyro.deterministic(name, value(t, z[i]))
    ...  # your likelihood, in terms of found["c1"], found["c2"]


numpyro.enable_x64()
walk = MCMC(NUTS(model), num_warmup=1000, num_samples=1000)
walk.run(jax.random.PRNGKey(1))
draws = walk.get_samples()
