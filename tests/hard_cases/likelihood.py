"""Edge cases of the likelihood and its posterior: too little, too much or contradictory data."""

import functools
import math

import numpy as np
import pandas as pd
import pytest
from scipy.special import logsumexp

import ridgebayes as rb
from ridgebayes.inference.latent import LatentIntegral
from tests import drawn
from tests.hard_cases.case import hard_case, refused

THREE = ((0.012, 0.03), (0.022, 0.02), (0.032, 0.01))
FIFTY = tuple((0.01 + 0.0005 * i, 0.03) for i in range(50))
Q = (4, 6, 8, 10)
LOG_2PI = math.log(2 * math.pi)
# 12,800 effective draws or more: means to 1 % of an sd, where cases hold them to 5 %.
FEW = rb.SampleSettings(n_walker=64, tau_change=0.05)


def made(form, theta, *, textures=THREE, Q=Q, error=0.0, seed=0, **columns):
    """Return rows of a form with normal errors of the log loads."""
    normal = np.random.default_rng(seed).standard_normal((len(textures), len(Q)))
    rows = [
        {"a_over_R": a, "b_over_R": b, "Q": q, "p_over_E": p * math.exp(error * z), **columns}
        for (a, b), errors in zip(textures, normal, strict=True)
        for q, p, z in zip(Q, form.load(np.array(Q), a, b, theta), errors, strict=True)
    ]
    return pd.DataFrame(rows)


def model_of(frame, form=None, **priors):
    """Return the posterior of rows with independent errors."""
    return drawn.model_of(rb.read_table(frame), form or rb.Modified(), "iid", priors or None)


def weighed(model, *, seed=1, n_draw=1_024):
    """Return the package's log evidence by importance sampling."""
    return drawn.importance_draws(model, seed=seed, n_draw=n_draw).evidence


def assert_is(found, truth, rounding=1e-5):
    """Hold a log evidence to four of its standard errors, which have to be small."""
    assert 0 <= found.se < 0.02, found
    assert abs(found.value - truth) < 4 * found.se + rounding, (found, truth)


def log_likelihood(model, theta):
    """Return the log-likelihood of rows at parameters (..., n_parameter)."""
    return log_likelihood_of(LatentIntegral(model), model, theta)


def log_likelihood_of(integral, model, theta):
    """Return the log-likelihood with the sums of the rows already in `integral`."""
    theta = np.asarray(theta, float)
    u = model.to_scores(np.atleast_2d(theta))[:, model.outer]
    found = integral.estimated(u, np.random.default_rng(0), 8).log_density
    value = found - model.log_outer_prior(u)
    return value if theta.ndim > 1 else float(value[0])


def modified_residuals(frame, dtype=float):
    """Return log load + 2 log c of Modified but for c: -2 log(h L) added, row by row."""
    pitch = (frame["a_over_R"] + frame["b_over_R"]).to_numpy(dtype)
    pairs = frame["Q"].to_numpy(dtype) / 2 - 1
    return np.log(frame["p_over_E"].to_numpy(dtype)) - 2 * np.log(pairs * pitch)


def summed_over_grid(frame, log_c, log_sigma, *, log_sd=0.1, sigma_sd=0.05):
    """Return log evidence, and means and sds of c and sigma, of Modified by a plain sum.

    The priors are log-normal(1.382, log_sd) and half-normal(sigma_sd); nothing is taken from the
    package, and the axes are those given.
    """
    r = modified_residuals(frame)
    known = frame["rel_se"].to_numpy(float) if "rel_se" in frame else np.zeros(len(frame))
    sigma = np.exp(log_sigma)
    total = np.zeros((len(log_c), len(sigma)))
    for residual, rel_se in zip(r, known, strict=True):
        variance = sigma**2 + rel_se**2
        off = (residual + 2 * log_c)[:, None]
        total += -0.5 * (off * off / variance + np.log(variance) + LOG_2PI)
    x = (log_c - math.log(1.382)) / log_sd
    total += (-0.5 * x * x - math.log(log_sd) - 0.5 * LOG_2PI)[:, None]
    s = sigma / sigma_sd
    total += -0.5 * s * s - math.log(sigma_sd) + 0.5 * math.log(2 / math.pi) + log_sigma
    log_z = float(logsumexp(total))
    weight = np.exp(total - log_z)
    cell = (log_c[1] - log_c[0]) * (log_sigma[1] - log_sigma[0])
    moments = []
    for values, share in ((np.exp(log_c), weight.sum(axis=1)), (sigma, weight.sum(axis=0))):
        mean = share @ values
        moments += [float(mean), float(np.sqrt(share @ (values - mean) ** 2))]
    return log_z + math.log(cell), moments


def assert_draws(fit, expected, tolerance=0.05):
    """Hold means and sds of a converged fit to moments, within a share of the true sd."""
    assert fit.converged, fit.convergence_failures
    for row, (mean, sd) in zip(fit.summary.itertuples(), expected, strict=True):
        assert abs(row.mean - mean) < tolerance * sd, (row.parameter, row.mean, mean)
        assert abs(row.sd - sd) < tolerance * sd, (row.parameter, row.sd, sd)


def as_summed(frame, log_c, log_sigma, *, sigma_sd=0.05, rounding=1e-5):
    """Hold Modified's evidence and draws to a plain sum; return ln Z, its true value, moments."""
    truth, m = summed_over_grid(frame, log_c, log_sigma, sigma_sd=sigma_sd)
    priors = {"sigma": rb.HalfNormal(sigma_sd)}
    found, table = weighed(model_of(frame, **priors)), rb.read_table(frame)
    assert_is(found, truth, rounding)
    options = {"priors": {"noise": priors}, "rng": 1, "settings": FEW, "noise": "iid"}
    assert_draws(rb.calibrate(table, rb.Modified(), **options), [m[:2], m[2:]])
    return found.value, truth, m


def log_upper_tail(x, depth=400):
    """Return log P(normal > x) for x >= 5 by Laplace's continued fraction, in long doubles."""
    x = np.longdouble(x)
    fraction = x
    for k in range(depth, 0, -1):
        fraction = x + k / fraction
    return -x * x / 2 - np.log(2 * np.longdouble(math.pi)) / 2 - np.log(fraction)


@hard_case(
    "Misfit of 1e-12 and 1e-9: 50 textures, one K each",
    why="The error scale is eleven orders of magnitude below its prior. On a grid of sigma with a "
    "fixed lower end all draws land on that end and seem converged.",
    expected="The mean of sigma from the closed form of its posterior, sqrt(S/2) "
    "G((m-1)/2)/G(m/2), to five Monte Carlo standard errors plus 1e-2 for rounding of the loads.",
)
def tiny_misfit():
    seen = []
    for error in (1e-12, 1e-9):
        frame = made(rb.Modified(), [1.4], textures=FIFTY, error=error)
        fit = rb.calibrate(rb.read_table(frame), rb.PowerLaw(), rng=1, noise="iid")
        r = modified_residuals(frame, np.longdouble).reshape(50, 4)
        S = float(((r - r.mean(axis=1, keepdims=True)) ** 2).sum())
        m = r.size - 50 - 1
        truth = math.sqrt(S / 2) * math.exp(math.lgamma((m - 1) / 2) - math.lgamma(m / 2))
        row = fit.summary.iloc[-1]
        assert fit.converged
        assert abs(row["mean"] / truth - 1) < 1e-2 + 5 * row["mcse_mean"] / truth
        seen.append(f"sigma {row['mean']:.2g} for {truth:.2g}")
    return ", ".join(seen)


@hard_case(
    "Rows without any misfit, errors unknown",
    why="The likelihood has a pole at sigma = 0. A search or a sampler returns the point where it "
    "happened to stop, and the evidence is that of rounding errors.",
    expected="Refused with a message, for few and many rows, for one and fifty coefficients.",
)
def perfect_rows():
    few, many = (made(rb.Modified(), [1.4], textures=some) for some in (THREE, FIFTY))
    words = "reproduces all rows", "sigma has no lower bound", "rel_se"
    for form, frame in ((rb.Modified(), few), (rb.Hybrid(), few), (rb.PowerLaw(), many)):
        table = rb.read_table(frame)
        fit = functools.partial(rb.calibrate, table, form, noise="iid")
        said = refused(fit, rb.ComputationError, *words)
    return said


@hard_case(
    "Rows without any misfit, errors known to be 1 %",
    why="The posterior is now proper, but sigma accumulates at 0, the bound of its prior.",
    expected="Log evidence and moments from a plain sum over 1,000 x 1,000 points: four standard "
    "errors. Draws to 5 % of an sd (Monte Carlo).",
)
def perfect_rows_of_known_error():
    frame = made(rb.Modified(), [1.4], rel_se=0.01)
    log_c = math.log(1.4) + np.linspace(-0.06, 0.06, 1000)
    value, truth, m = as_summed(frame, log_c, np.linspace(-20, -1, 1000))
    return f"ln Z {value:.2f} for {truth:.2f}; sigma {m[2]:.5f} with its mass at 0"


@hard_case(
    "One row",
    why="One load cannot separate an error from a coefficient. Near sigma = 0 the posterior is a "
    "narrow ridge that extends beyond any grid; 1e-3 of ln Z lies outside.",
    expected="Log evidence with log c integrated in closed form and sigma by a sum over 20,000 "
    "points: four standard errors. "
    "Draws have the moments of this mixture of normals to 5 % of an sd (Monte Carlo).",
)
def one_row():
    frame = made(rb.Modified(), [1.4], error=0.01)[:1]
    # With log c = log 1.382 + 0.1 u the residual r is normal, and so is log c given r and sigma.
    r = float(modified_residuals(frame)[0]) + 2 * math.log(1.382)
    log_sigma = np.linspace(-25, 0, 20_000)
    sigma = np.exp(log_sigma)
    variance = 0.04 + sigma**2
    log_weight = -0.5 * (r * r / variance + np.log(variance) + LOG_2PI)
    log_weight += log_sigma - 0.5 * (sigma / 0.05) ** 2 + 0.5 * math.log(2 / math.pi / 0.05**2)
    truth = float(logsumexp(log_weight)) + math.log(log_sigma[1] - log_sigma[0])
    weight = np.exp(log_weight - logsumexp(log_weight))
    centre, spread = math.log(1.382) - 0.02 * r / variance, 0.01 * sigma**2 / variance
    c = weight @ np.exp(centre + spread / 2)
    c_sd = math.sqrt(weight @ np.exp(2 * centre + 2 * spread) - c * c)
    s = weight @ sigma
    s_sd = math.sqrt(weight @ (sigma - s) ** 2)
    fit = rb.calibrate(rb.read_table(frame), rb.Modified(), rng=1, settings=FEW, noise="iid")
    assert_draws(fit, [(c, c_sd), (s, s_sd)])
    found = weighed(fit.model)
    assert_is(found, truth)
    seen = f"c = {c:.3f} ± {c_sd:.3f}, sigma = {s:.3f} ± {s_sd:.3f}"
    return f"ln Z {found.value:.2f} for {truth:.2f}; {seen}"


@hard_case(
    "One texture: c1 and c2 cannot be told apart",
    why="The rows determine only c1/L + c2/A. In the other direction the posterior is flat apart "
    "from the prior. A pseudo-inverse with a cut-off loses that direction.",
    expected="Moments from integrating the prior along the flat direction (a sum over 4e6 "
    "points). Draws agree to 5 % of an sd (Monte Carlo).",
)
def flat_direction():
    a, b = THREE[0]
    frame = made(rb.Modified(), [1.4], textures=THREE[:1], error=0.02)
    # Residuals are of the log rate; given sigma only their mean and scatter count.
    z = np.log(frame["p_over_E"].to_numpy()) - 2 * np.log(np.array(Q) / 2 - 1)
    u = np.linspace(-5, 5, 200)
    c1, c2 = 1.382 * np.exp(0.1 * u), 0.05 * u
    log_sigma = np.linspace(-9, -1, 100)
    rate = c1[:, None] / (a + b) + c2 / a
    off = z.mean() + 2 * np.log(np.where(rate > 0, rate, np.nan))
    squares = ((z - z.mean()) ** 2).sum() + len(z) * off * off
    prior = -0.5 * (u[:, None] ** 2 + u**2)
    weight = np.empty((200, 200, 100))
    for k, s in enumerate(np.exp(log_sigma)):
        own = -0.5 * (s / 0.05) ** 2 + (1 - len(z)) * math.log(s)
        weight[..., k] = prior + own - 0.5 * squares / s**2
    weight = np.exp(np.nan_to_num(weight - np.nanmax(weight), nan=-np.inf))
    weight /= weight.sum()
    truth = []
    for axis, values in enumerate((c1, c2, np.exp(log_sigma))):
        share = weight.sum(axis=tuple({0, 1, 2} - {axis}))
        mean = share @ values
        truth.append((mean, math.sqrt(share @ (values - mean) ** 2)))
    fit = rb.calibrate(rb.read_table(frame), rb.Hybrid(), rng=1, settings=FEW, noise="iid")
    assert_draws(fit, truth)
    correlation = np.corrcoef(fit.draws[:, 0] / (a + b), fit.draws[:, 1] / a)[0, 1]
    assert correlation < -0.98
    return "; ".join(
        f"{row.parameter} = {row.mean:.3f} ± {row.sd:.3f} for {mean:.3f} ± {sd:.3f}"
        for row, (mean, sd) in zip(fit.summary.itertuples(), truth, strict=True)
    )


@hard_case(
    "A duplicated row",
    why="Counting it twice makes posteriors too narrow. Dropping it without a message hides a "
    "repeated experiment.",
    expected="Within one curve: refused, with both rows named. As another series: twice the "
    "log-likelihood (rounding, 1e-12).",
)
def duplicated_rows():
    frame = made(rb.Modified(), [1.4], error=0.03)
    with pytest.raises(rb.InputError, match=r"row 13.*row 1 is the same") as refusal:
        rb.read_table(pd.concat([frame, frame[:1]]))
    said = str(refusal.value).splitlines()[1].strip()
    twice = pd.concat([frame.assign(series="first"), frame.assign(series="second")])
    theta = np.array([[1.4, 0.03], [1.1, 1e-3], [2.0, 0.5]])
    once, both = (log_likelihood(model_of(rows), theta) for rows in (frame, twice))
    np.testing.assert_allclose(both, 2 * once, rtol=1e-12)
    return f"{said}; another series counts"


@hard_case(
    "Repeats of one load that differ by factors of 10",
    why="sigma lies 40 prior sds out. There the tail of a prior underflows and quantiles saturate.",
    expected="Log evidence from a plain sum over 1,000 x 1,000 points: four standard errors. Draws "
    "to 5 % of an sd.",
)
def repeats_that_disagree():
    one = made(rb.Modified(), [1.4], textures=THREE[:1], Q=(4,))
    parts = [
        one.assign(p_over_E=one["p_over_E"] * 10.0**k, series=str(k)) for k in (-2, -1, 0, 1, 2)
    ]
    frame = pd.concat(parts)
    log_c = math.log(1.4) + np.linspace(-0.8, 0.8, 1000)
    value, truth, m = as_summed(frame, log_c, np.linspace(-3, 1, 1000))
    return f"ln Z {value:.2f} for {truth:.2f}; sigma = {m[2]:.3f} ± {m[3]:.3f}, prior sd 0.05"


@hard_case(
    "Brackets of zero width, brackets without a lower end, disjoint brackets of one transition",
    why="A width of 0 gives log 0. A lower end of 0 gives -inf - -inf. Two disjoint brackets have "
    "probability 0 if they are intersected instead of treated as two errors.",
    expected="Zero width: the density of an exact row. No lower end: the log of the normal "
    "distribution function. Disjoint: the product of both, by erfc (rounding, 1e-12).",
)
def strange_brackets():
    exact = made(rb.Modified(), [1.4], textures=THREE[:1], Q=(4,))
    load = exact["p_over_E"]
    theta = np.array([1.3, 0.05])
    density = log_likelihood(model_of(exact), theta)
    closed = log_likelihood(model_of(exact.assign(p_over_E_lower=load)), theta)
    assert abs(closed - density) < 1e-12
    z = float(modified_residuals(exact)[0] + 2 * math.log(1.3)) / 0.05
    half = log_likelihood(model_of(exact.assign(p_over_E_lower=0.0)), theta)
    truth = math.log(0.5 * math.erfc(-z / math.sqrt(2)))
    assert abs(half - truth) < 1e-12 * max(1, abs(truth))
    two = [(0.8, 0.9), (1.2, 1.3)]
    ends = pd.concat(
        exact.assign(p_over_E_lower=load * low, p_over_E=load * high, series=str(low))
        for low, high in two
    )
    value = log_likelihood(model_of(ends), theta)
    both = 0.0
    for low, high in two:
        x, y = ((z + math.log(end) / 0.05) / math.sqrt(2) for end in (low, high))
        x, y = (x, y) if x > 0 else (-y, -x)  # of the upper tail nothing cancels
        both += math.log(0.5 * (math.erfc(x) - math.erfc(y)))
    assert abs(value - both) < 1e-12 * abs(both)
    return f"density {density:.6f} twice; no lower end {half:.6f}; disjoint {value:.6f}"


@hard_case(
    "Brackets 40 and 4,000 sds from the form",
    why="Both distribution functions round to 0 or 1 there, and their difference to 0.",
    expected="The log of the difference by Laplace's continued fraction in long doubles, to a "
    "relative 1e-14.",
)
def far_brackets():
    exact = made(rb.Modified(), [1.0], textures=THREE[:1], Q=(4,))
    worst, seen = 0.0, []
    for sds, sigma in ((40.0, 0.02), (4000.0, 2e-4)):
        low, high = math.exp(sds * sigma), math.exp((sds + 1) * sigma)
        load = exact["p_over_E"]
        frame = exact.assign(p_over_E=load * high, p_over_E_lower=load * low)
        value = log_likelihood(model_of(frame), np.array([1.0, sigma]))
        shape = 2 * np.log(np.longdouble(THREE[0][0] + THREE[0][1]))
        near, far = (
            log_upper_tail((np.log(np.longdouble(frame[end].iloc[0])) - shape) / sigma)
            for end in ("p_over_E_lower", "p_over_E")
        )
        truth = near + np.log(-np.expm1(far - near))
        # The ends themselves are rounded: 1e-16 of a log load of 6, in units of sigma.
        allowed = 1e-14 * abs(float(truth)) + sds * 4e-15 / sigma
        worst = max(worst, abs(value - float(truth)) / allowed)
        seen.append(f"{value:.6f}")
    assert worst < 1
    return " and ".join(seen)


@hard_case(
    "A prior 20 sds from the rows",
    why="A unit-cube prior ends at 8.2 sds. A search bounded to a few sds stops on the way.",
    expected="Log evidence from a plain sum over 1,500 x 1,000 points: four standard errors. Draws "
    "to 5 % of an sd.",
)
def prior_twenty_sds_away():
    frame = made(rb.Modified(), [1.382 * math.exp(2)], error=0.03)
    log_c = np.linspace(1.5, 2.5, 1500)
    log_sigma = np.linspace(-6, 0, 1000)
    value, truth, m = as_summed(frame, log_c, log_sigma, sigma_sd=0.03, rounding=1e-4)
    return f"ln Z {value:.2f} for {truth:.2f}; c = {m[0]:.3f} ± {m[1]:.3f}, prior 1.382 ± 0.138"


@hard_case(
    "A prior 20 sds from the rows, and sigma free",
    why="There are two modes: c near the rows with small errors, or c nearer to the prior with "
    "large errors (here 99.9 % of the mass). Ensembles that all start at the first agree with "
    "each other.",
    expected="Draws of both modes: log evidence (four standard errors) and moments (5 % of an sd) "
    "from a plain sum over 1,500 x 1,000 points.",
)
def prior_and_rows_of_two_modes():
    frame = made(rb.Modified(), [1.382 * math.exp(2)], error=0.03)
    log_sigma = np.linspace(-6, 1, 1000)
    total, m = summed_over_grid(frame, np.linspace(0, 2.5, 1500), log_sigma, sigma_sd=0.06)
    near = summed_over_grid(
        frame, np.linspace(2.2, 2.5, 1500), log_sigma[log_sigma < -2.3], sigma_sd=0.06
    )[0]
    odds = total - near + math.log1p(-math.exp(near - total))
    assert m[0] < 6
    sigma = rb.HalfNormal(0.06)
    priors = {"noise": {"sigma": sigma}}
    fit = rb.calibrate(rb.read_table(frame), rb.Modified(), priors=priors, rng=1, noise="iid")
    assert_draws(fit, [m[:2], m[2:]])
    found = weighed(model_of(frame, sigma=sigma))
    assert_is(found, total)
    return f"ln Z {found.value:.2f} for {total:.2f}; the far mode's log odds {odds:+.1f}"


@hard_case(
    "A prior of c2 whose centre has a negative rate",
    why="A search that starts at the prior's centre starts at density zero: no slope, NaN "
    "curvature. A texture without a positive rate must not give the logarithm of a negative "
    "number.",
    expected="Log evidence from a plain sum over 160 x 400 x 160 points: four standard errors and "
    "2e-3.",
)
def negative_rate_at_the_centre():
    frame = made(rb.Hybrid(), [1.4, 0.0], error=0.03)
    model = model_of(frame, rb.Hybrid(), c2=rb.Normal(-0.5, 0.1))
    centre = np.zeros(3)
    density = LatentIntegral(model).estimated(centre[None], np.random.default_rng(0), 8)
    assert np.isneginf(density.log_density[0])
    found = weighed(model)
    u1 = np.linspace(-4, 4, 160)
    c1, c2 = 1.382 * np.exp(0.1 * u1), np.linspace(-0.3, 0.06, 400)
    log_sigma = np.linspace(-5.5, -1, 160)
    prior = -0.5 * u1[:, None] ** 2 - 0.5 * ((c2 + 0.5) / 0.1) ** 2 - LOG_2PI - math.log(0.1)
    squares, n = np.zeros((160, 400)), len(frame)
    for (a, b), rows in frame.groupby(["a_over_R", "b_over_R"]):
        rate = c1[:, None] / (a + b) + c2 / a
        log_rate = np.log(np.where(rate > 0, rate, np.nan))
        for q, p in zip(rows["Q"], rows["p_over_E"], strict=True):
            squares += (math.log(p) - 2 * math.log(q / 2 - 1) + 2 * log_rate) ** 2
    slices = []
    for s in np.exp(log_sigma):
        own = -0.5 * (s / 0.05) ** 2 - math.log(0.05) + 0.5 * math.log(2 / math.pi) + math.log(s)
        value_at = prior + own - 0.5 * squares / s**2 - n * (math.log(s) + 0.5 * LOG_2PI)
        slices.append(logsumexp(np.nan_to_num(value_at, nan=-np.inf)))
    cell = (u1[1] - u1[0]) * (c2[1] - c2[0]) * (log_sigma[1] - log_sigma[0])
    truth = float(logsumexp(slices)) + math.log(cell)
    assert_is(found, truth, 2e-3)
    return f"density zero at the centre; ln Z {found.value:.2f} for {truth:.2f}"


@functools.cache
def a_million():
    n = 1_000_000
    rng = np.random.default_rng(5)
    texture = rng.integers(0, 3, n)
    widths = np.array(THREE)[texture]
    Qs = rng.choice(Q, n)
    load = ((Qs / 2 - 1) * widths.sum(axis=1) / 1.4) ** 2 * np.exp(0.03 * rng.standard_normal(n))
    columns = {"a_over_R": widths[:, 0], "b_over_R": widths[:, 1], "Q": Qs, "p_over_E": load}
    return pd.DataFrame({**columns, "series": np.arange(n).astype(str)})


@hard_case(
    "A million rows",
    why="Sums of squares as a difference of large numbers lose half the digits. A likelihood "
    "computed row by row makes MCMC take minutes.",
    expected="Log-likelihood by math.fsum over the rows, to a relative 1e-12. A call uses less "
    "than 1 MB.",
    long=True,
)
def a_million_rows():
    import tracemalloc

    frame = a_million()
    model = model_of(frame)
    theta = np.array([[1.4, 0.03], [1.3, 0.1]])
    integral = LatentIntegral(model)
    tracemalloc.start()
    values = log_likelihood_of(integral, model, theta)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 1e6
    r = modified_residuals(frame)
    for (c, sigma), value in zip(theta, values, strict=True):
        squares = math.fsum(((r + 2 * math.log(c)) / sigma) ** 2)
        truth = -0.5 * squares - len(r) * (math.log(sigma) + 0.5 * LOG_2PI)
        assert abs(value / truth - 1) < 1e-12
    return f"{values[0]:.3f} and {values[1]:.3f}"


@hard_case(
    "Log-likelihoods of -1e12",
    why="A float keeps 1e-4 of such a number. The difference of two of them still decides which "
    "coefficient is right.",
    expected="Values in long doubles to a relative 1e-14, and their difference to 1e-3.",
)
def very_low_likelihoods():
    frame = made(rb.Modified(), [1.4], error=0.03)
    theta = np.array([[1.9, 1.2e-6], [1.9 * (1 + 1e-9), 1.2e-6]])
    values = log_likelihood(model_of(frame), theta)
    r = modified_residuals(frame, np.longdouble)
    c, sigma = theta.astype(np.longdouble).T
    off = (r + 2 * np.log(c)[:, None]) / sigma[:, None]
    truth = (-0.5 * off * off - np.log(sigma)[:, None] - 0.5 * np.longdouble(LOG_2PI)).sum(axis=1)
    assert -2e12 < values[0] < -1e12
    np.testing.assert_allclose(values, truth.astype(float), rtol=1e-14)
    change = float(truth[1] - truth[0])
    assert abs((values[1] - values[0]) - change) < 1e-3 * abs(change)
    return f"{values[0]:.4e}; a step of 1e-9 in c changes it by {change:.1f}"


@hard_case(
    "Loads of 1e-302, 1e-12 and 10 in one table",
    why="Squares and products of loads underflow. Only their logarithms are of similar size.",
    expected="With the priors of K moved alike, ln Z is that of ordinary loads (1e-6, by draws "
    "with the same seed).",
)
def loads_of_all_sizes():
    values, smallest = [], []
    ordinary = made(rb.Modified(), [1.4], error=0.03)
    for exponents in ((-299, -9, 3), (0, 0, 0)):
        size = np.repeat(10.0 ** np.array(exponents), len(Q))
        frame = ordinary.assign(p_over_E=ordinary["p_over_E"] * size)
        medians = [
            2 * 1.382 / (a + b) * 10.0 ** (-k / 2)
            for (a, b), k in zip(THREE, exponents, strict=True)
        ]
        names = model_of(frame, rb.PowerLaw()).parameter_names
        pairs = zip(names[:3], medians, strict=True)
        model = model_of(frame, rb.PowerLaw(), **{n: rb.LogNormal(K, 0.3) for n, K in pairs})
        values.append(weighed(model).value)
        smallest.append(frame["p_over_E"].min())
    assert abs(values[0] - values[1]) < 1e-6
    assert smallest[0] < 1e-300
    return f"loads from {smallest[0]:.1e} on; ln Z {values[0]:.2f} both"


@hard_case(
    "Known errors of 100,000 % and of 1e-13 %",
    why="Rows without information must leave the prior unchanged. Rows known to rounding must not "
    "lead to a division by zero where sigma is 0.",
    expected="At 1e3: ln Z by the normal density with variance 1e6 (four standard errors), and "
    "draws equal to the prior's to 5 %. At 1e-15 with sigma = 1e-300: the long double sum "
    "(relative 1e-9).",
)
def known_errors_of_any_size():
    frame = made(rb.Modified(), [1.4], error=0.03)
    vague = frame.assign(rel_se=1e3)
    found = weighed(model_of(vague))
    truth = -len(frame) * (math.log(1e3) + 0.5 * LOG_2PI)
    assert_is(found, truth, 1e-4)
    fit = rb.calibrate(rb.read_table(vague), rb.Modified(), rng=1, settings=FEW, noise="iid")
    mean = 1.382 * math.exp(0.005)
    half = 0.05 * math.sqrt(2 / math.pi)
    expected = [
        (mean, mean * math.sqrt(math.expm1(0.01))),
        (half, 0.05 * math.sqrt(1 - 2 / math.pi)),
    ]
    assert_draws(fit, expected)
    sharp = log_likelihood(model_of(frame.assign(rel_se=1e-15)), np.array([1.4, 1e-300]))
    off = (modified_residuals(frame, np.longdouble) + 2 * np.log(np.longdouble(1.4))) / 1e-15
    exact = float((-0.5 * off * off).sum()) - len(frame) * (math.log(1e-15) + 0.5 * LOG_2PI)
    assert abs(sharp / exact - 1) < 1e-9
    return f"ln Z {found.value:.2f} for {truth:.2f}; at 1e-15 a log-likelihood of {sharp:.4e}"
