"""Edge cases of evidences and Bayes factors: where estimates fail without any sign."""

import functools
import math
from dataclasses import replace

import numpy as np
import pandas as pd
from scipy.special import logsumexp

import ridgebayes as rb
from ridgebayes.checks.power_scaling import power_scaling
from ridgebayes.comparison.compare import compared
from ridgebayes.evidence.bridge import bridge_evidence
from ridgebayes.evidence.tables import evidence_table
from ridgebayes.inference.emcee_sampling import walk
from ridgebayes.inference.importance import Effort, importance_sample
from ridgebayes.inference.log_evidence import LogEvidence
from ridgebayes.inference.target import ModelTarget
from ridgebayes.request import Request
from tests.hard_cases.case import hard_case, refused
from tests.hard_cases.likelihood import (
    FEW,
    LOG_2PI,
    assert_is,
    made,
    model_of,
    modified_residuals,
    summed_over_grid,
    weighed,
)
from tests.model.forms.even import Even


def walk_of(frame):
    """Return Modified's posterior density of rows, and a walk of it."""
    target = ModelTarget(model_of(frame), 1)
    proposal = importance_sample(target, Effort(), 1).proposal
    return target, walk(target, proposal, seed=1, settings=FEW)


def stopped(values):
    """Return what a walk would hold had it never moved."""
    return np.broadcast_to(values[:, :1, :1], values.shape)


@hard_case(
    "A log Bayes factor of 1e5",
    why="exp(1e5) overflows. 0 times infinity is NaN in a table of probabilities.",
    expected="The difference of the evidences by many more draws (four standard errors). "
    "Probabilities 1 and 0. A table of Bayes factors without NaN.",
)
def enormous_factor(folder):
    textures = tuple((0.01 + 0.001 * i, 0.03) for i in range(15))
    frame = made(rb.Modified(), [1.4], textures=textures, error=1e-7)
    frame = pd.concat([frame.assign(series=str(i)) for i in range(120)])
    table = rb.read_table(frame)
    few = Request.of(table, [rb.Modified(), rb.Classic()], noise="iid", rng=1, settings=FEW)
    found = compared(replace(few, scores=False))
    row = found.bayes_factors.iloc[0]
    one, other = (weighed(found.fits[form].model, seed=9) for form in ("modified", "classic"))
    assert row["ln_bf"] > 9e4
    se = math.hypot(row["ln_bf_se"], one.se, other.se)
    assert abs(row["ln_bf"] - (one.value - other.value)) < 4 * se < 0.1
    assert math.isclose(row["log10_bf"], row["ln_bf"] / math.log(10))
    assert found.probabilities == {"modified": 1.0, "classic": 0.0}
    found.bayes_factors.to_csv(folder / "factors.csv", index=False)
    back = pd.read_csv(folder / "factors.csv")
    assert back[["ln_bf", "ln_bf_se", "log10_bf"]].notna().all(axis=None)
    assert "very strong for modified" in back.loc[0, "reading"]
    return f"ln BF {row['ln_bf']:.1f}, log10 {row['log10_bf']:.1f}; probabilities 1 and 0"


@hard_case(
    "Two modes 1,000 sds apart, of a user's own form",
    why="Every start and every method finds the same mode. Draws agree, evidences agree, and all "
    "miss half the evidence.",
    expected="ln Z is ln 2 above ln Z of one mode, to four standard errors. Half of the draws are "
    "in each mode (five standard errors).",
)
def two_modes_far_apart():
    frame = made(rb.Modified(), [1.4], error=0.03)
    fit = rb.calibrate(rb.read_table(frame), Even(), rng=1, noise="iid")
    found = fit.evidence
    # One mode by a plain sum over c2 > 0 and sigma; the other is its mirror image.
    log_sigma = np.linspace(-6, -1, 600)
    c2 = 0.05 * math.sqrt(1.4) * np.exp(np.linspace(-0.02, 0.02, 600))
    r, sigma = modified_residuals(frame), np.exp(log_sigma)
    squares = sum((value + 4 * np.log(c2 / 0.05)) ** 2 for value in r)[:, None]
    total = -0.5 * squares / sigma**2 - len(r) * (log_sigma + 0.5 * LOG_2PI)
    total += -0.5 * (c2[:, None] / 0.05) ** 2 - math.log(0.05) - 0.5 * LOG_2PI + log_sigma
    total += -0.5 * (sigma / 0.05) ** 2 + 0.5 * math.log(2 / math.pi / 0.05**2)
    cell = np.gradient(c2)[:, None] * (log_sigma[1] - log_sigma[0])
    one = float(logsumexp(total + np.log(cell)))
    assert_is(found, one + math.log(2), 0.01)
    share = float((fit.draws[:, 0] > 0).mean())
    assert abs(share - 0.5) < 5 * 0.5 / math.sqrt(len(fit.draws))
    return f"ln Z of one mode {one:.2f}, of both {found.value:.2f}; {share:.1%} of the draws in one"


@hard_case(
    "A posterior of sigma at its bound",
    why="With known errors the best sigma is 0. A mode at a bound has no curvature. A normal "
    "approximation cuts off half of it, or adds as much beyond.",
    expected="ln Z from a plain sum over 1,000 x 1,000 points: by importance sampling and by the "
    "bridge of a walk, each to four standard errors.",
)
def sigma_on_its_bound():
    frame = made(rb.Modified(), [1.4], error=0.001, rel_se=0.02)
    log_c = math.log(1.4) + np.linspace(-0.1, 0.1, 1000)
    truth, _ = summed_over_grid(frame, log_c, np.linspace(-22, -1, 1000))
    target, walked = walk_of(frame)
    found = weighed(target.model), bridge_evidence(target, walked, rng=np.random.default_rng(1))
    for each in found:
        assert_is(each, truth)
    return f"ln Z {truth:.2f}; importance {found[0].value:.2f}, bridge {found[1].value:.2f}"


@hard_case(
    "A bridge from draws that do not move",
    why="The covariance of equal draws is singular. An iteration on them crashes or settles on an "
    "arbitrary number.",
    expected="The status is not ok and there is no value. The evidence of importance sampling is "
    "used.",
)
def bridge_of_frozen_draws():
    target, walked = walk_of(made(rb.Modified(), [1.4], error=0.03))
    chains = walked.chains
    frozen = replace(
        walked,
        chains=replace(chains, log_density=stopped(chains.log_density)),
        coordinates=stopped(walked.coordinates),
        log_jacobian=stopped(walked.log_jacobian),
    )
    found = bridge_evidence(target, frozen, rng=np.random.default_rng(1))
    assert not found.ok
    assert math.isnan(found.value)
    both = [weighed(target.model), found]
    used = evidence_table({("modified", "iid"): both})
    assert used.loc[used["used"], "method"].tolist() == ["importance"]
    return f"bridge: {found.status}; importance is used"


@hard_case(
    "A bridge limited to one step",
    why="An iteration that is stopped early returns a number without a warning.",
    expected="No value, and a status that says that the iteration did not settle.",
)
def bridge_stopped():
    target, walked = walk_of(made(rb.Modified(), [1.4], error=0.03))
    found = bridge_evidence(target, walked, rng=np.random.default_rng(1), iterations_max=1)
    assert not found.ok
    assert math.isnan(found.value)
    return found.status


@hard_case(
    "Improper and degenerate priors",
    why="An evidence under a prior of infinite width is zero times an arbitrary constant. A width "
    "that is 0, NaN or negative leads to NaN much later.",
    expected="Each is refused when it is made; the message has the number and what was expected.",
)
def improper_priors():
    inf, nan = math.inf, math.nan
    makers = [
        functools.partial(kind, *fields)
        for kind, several in (
            (rb.Normal, [(0.0, inf), (0.0, 0.0), (0.0, -1.0), (0.0, nan), (inf, 1.0)]),
            (rb.LogNormal, [(1.0, inf), (0.0, 1.0), (inf, 1.0), (1.0, 0.0), (nan, 1.0)]),
            (rb.HalfNormal, [(inf,), (0.0,), (nan,), (-0.05,)]),
        )
        for fields in several
    ]
    said = [refused(make, rb.InputError, "distribution: expected finite") for make in makers]
    return f"{len(said)} refused; {said[0].removeprefix('refused: ')}"


@hard_case(
    "Closed form where the widths of prior and rows differ by 1e12",
    why="Normalisations multiply to 1e-300 and below. Only sums of logarithms keep them.",
    expected="With sigma nearly known, c's log-normal prior and log-normal rows are conjugate. ln "
    "Z is the normal density of the rows, to four standard errors.",
)
def conjugate_at_extreme_scales():
    seen = []
    for log_sd, rel_se in ((1e-9, 1e-3), (1e3, 1e-6), (1e6, 1e-6), (1e-3, 1e6)):
        frame = made(rb.Modified(), [1.4], error=min(rel_se, 1.0), rel_se=rel_se)
        model = model_of(frame, c=rb.LogNormal(1.4, log_sd), sigma=rb.HalfNormal(1e-7 * rel_se))
        r = modified_residuals(frame, np.longdouble) + 2 * np.log(np.longdouble(1.4))
        n, known, spread = len(r), np.longdouble(rel_se) ** 2, 4 * np.longdouble(log_sd) ** 2
        # Covariance known I + spread 1 1': determinant and inverse by Sherman and Morrison.
        misfit = (r**2).sum() / known - spread * r.sum() ** 2 / known / (known + n * spread)
        log_det = (n - 1) * np.log(known) + np.log(known + n * spread)
        truth = float(-0.5 * (misfit + log_det + n * np.longdouble(LOG_2PI)))
        found = weighed(model)
        assert_is(found, truth, 1e-6 * max(1, abs(truth)))
        seen.append(f"{found.value:.4g}")
    return "ln Z " + ", ".join(seen)


@hard_case(
    "Sensitivity where the rows carry no information",
    why="Equal weights have no tail. Their Pareto shape is 0/0.",
    expected="With rows of known error 1e6: no sensitivity to the likelihood (under 0.005), some "
    "to the prior (over 0.05), and neither is NaN. Stretching a prior leaves ln Z unchanged "
    "(four standard errors).",
)
def rows_without_power():
    frame = made(rb.Modified(), [1.4], error=0.03, rel_se=1e6)
    fit = rb.calibrate(rb.read_table(frame), rb.Modified(), rng=1, settings=FEW, noise="iid")
    found = power_scaling(fit)
    assert (found["likelihood"] < 0.005).all()
    assert (found["prior"] > 0.05).all()
    assert set(found["diagnosis"]) == {"strong prior or weak likelihood"}
    wide = model_of(frame, c=rb.LogNormal(1.382, 10.0))
    one, other = weighed(wide), weighed(fit.model)
    assert abs(one.value - other.value) < 4 * math.hypot(one.se, other.se) + 1e-4
    top = found["likelihood"].max()
    return f"likelihood at most {top:.4f}, prior at least {found['prior'].min():.2f}"


@hard_case(
    "A posterior 1e-12 as wide as its prior",
    why="A quadrature rule over the prior has no point within the posterior.",
    expected="ln Z by the normal density of the rows (conjugate, known errors), to four standard "
    "errors. Mean and sd of c to five standard errors of the draws.",
)
def posterior_far_narrower_than_prior():
    known = 1e-6
    frame = made(rb.Modified(), [1.4], error=known, rel_se=known)
    priors = {"c": rb.LogNormal(1.0, 1e6), "sigma": rb.HalfNormal(1e-14)}
    by_owner = {"modified": {"c": priors["c"]}, "noise": {"sigma": priors["sigma"]}}
    model = model_of(frame, **priors)
    r = modified_residuals(frame, np.longdouble)
    n = len(r)
    spread = np.longdouble(4e12)
    mean = r.mean()
    squares = ((r - mean) ** 2).sum() / known**2 + n * mean**2 / (known**2 + n * spread)
    log_det = (n - 1) * 2 * np.log(np.longdouble(known)) + np.log(known**2 + n * spread)
    truth = float(-0.5 * (squares + log_det + n * np.longdouble(LOG_2PI)))
    found = weighed(model)
    assert_is(found, truth)
    fit = rb.calibrate(
        rb.read_table(frame),
        rb.Modified(),
        priors=by_owner,
        rng=1,
        settings=FEW,
        noise="iid",
    )
    row = fit.summary.iloc[0]
    centre, sd = float(np.exp(-mean / 2)), 1.4 * known / 2 / math.sqrt(n)
    assert fit.converged
    assert abs(row["mean"] - centre) < 5 * row["mcse_mean"] + 1e-15
    assert abs(row["sd"] / sd - 1) < 0.05
    return f"sd {row['sd'] / 1.4 / 1e6:.1e} of the prior's; ln Z {found.value:.2f} for {truth:.2f}"


@hard_case(
    "A form whose evidence failed with every method",
    why="One NaN in a softmax makes every probability NaN.",
    expected="The probabilities of the other forms sum to 1. The failed form has no probability.",
)
def failed_evidence_among_others():
    failed = LogEvidence("bridge", math.nan, math.nan, "halves disagree")
    found = {
        "classic": [failed],
        "modified": [LogEvidence("bridge", -1e300, 1.0)],
        "hybrid": [LogEvidence("bridge", 1e300, 1.0)],
    }
    table = evidence_table({(name, "iid"): several for name, several in found.items()})
    shares = table["model_probability"].tolist()
    assert math.isnan(shares[0])
    assert shares[1:] == [0.0, 1.0]
    return "probabilities NaN (none), 0 and 1 at ln Z of ± 1e300"
