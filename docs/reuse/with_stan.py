"""Sample the mixture of hybrid.json with PyStan: the prior part of a model of your own."""

import json
from pathlib import Path

import numpy as np
import stan
from scipy import stats

BASES = {  # base of a truncated prior
    "normal": lambda t: stats.norm(t["mean"], t["sd"]),
    "log-normal": lambda t: stats.lognorm(t["log_sd"], scale=t["median"]),
    "half-normal": lambda t: stats.halfnorm(scale=t["sd"]),
    "uniform": lambda t: stats.uniform(t["low"], t["high"] - t["low"]),
}


def value(t, z):
    """Return Stan's expression of the parameter that has the normal score z."""
    if t["kind"] == "normal":
        return f"({t['mean']} + {t['sd']} * {z})"
    if t["kind"] == "log-normal":
        return f"({t['median']} * exp({t['log_sd']} * {z}))"
    if t["kind"] == "half-normal":
        return f"(-{t['sd']} * inv_Phi(0.5 * Phi(-{z})))"
    if t["kind"] == "uniform":
        return f"({t['low']} + {t['high'] - t['low']} * Phi({z}))"
    base = BASES[t["base"]["kind"]](t["base"])
    below, above = base.cdf(t["low"]), base.sf(t["high"])
    sign, tail = (1, below) if below <= above else (-1, above)
    inner = f"({sign} * inv_Phi({tail} + {1 - below - above} * Phi({sign} * {z})))"
    return value(t["base"], inner)


given = json.loads(Path("hybrid.json").read_text())
w, m, C = (np.array(given[key]) for key in ("weights", "means", "covariances"))
S = np.linalg.cholesky(C[0])
inverse = np.linalg.inv(S)
factors = np.linalg.cholesky(inverse @ C @ inverse.T)
n_component, n_parameter = m.shape
data = {"k": n_component, "d": n_parameter, "w": w, "origin": m[0], "S": S}
data |= {"means": (m - m[0]) @ inverse.T, "factors": factors}
values = [value(t, f"z[{i}]") for i, t in enumerate(given["transforms"], 1)]
program = f"""
data {{
  int k, d;
  vector[k] w;
  vector[d] origin;
  matrix[d, d] S;
  array[k] vector[d] means;
  array[k] matrix[d, d] factors;
}}
parameters {{
  vector[d] x;
}}
transformed parameters {{
  vector[d] z = origin + S * x;
  vector[d] found = [{", ".join(values)}]';  // c1, c2, sigma, with their correlation
}}
model {{
  vector[k] each;
  for (j in 1:k) {{
    each[j] = log(w[j]) + multi_normal_cholesky_lpdf(x | means[j], factors[j]);
  }}
  target += log_sum_exp(each);
  // your likelihood, in terms of found[1], found[2]
}}
"""
posterior = stan.build(program, data=data, random_seed=1)
draws = posterior.sample(num_chains=4, num_samples=1000)["found"]  # (n_parameter, n_draw)
