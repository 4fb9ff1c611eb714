"""Edge cases of evidences and Bayes factors: where estimates fail without any sign."""

import functools
import math
from dataclasses import replace

import numpy as np
import pandas as pd
from scipy.special import logsumexp

import ridgebayes as rb
from ridgebayes.checks.power_scaling import power_scaling
from ridgebayes.comparison.compare import Execution, compare_with
from ridgebayes.evidence import (
    LogEvidence,
    bridge_evidence,
    power_law_evidence,
    savage_dickey,
)
from ridgebayes.evidence.tables import evidence_table, evidences
from ridgebayes.inference.importance_sampling import importance_posterior
from ridgebayes.inference.laplace import fit_laplace
from tests.hard_cases.case import hard_case, refused
from tests.hard_cases.likelihood import (
    FEW,
    LOG_2PI,
    by_quadrature,
    made,
    model_of,
    modified_residuals,
    summed_over_grid,
)
from tests.model.forms.even import Even
from tests.validation.thermodynamic import thermodynamic_evidence


@hard_case(
    "A log Bayes factor of 1e5",
    why="exp(1e5) overflows. 0 times infinity is NaN in a table of probabilities.",
    expected="The difference of the evidences, one by closed form over sigma (1e-2 of Monte Carlo "
    "error). Probabilities 1 and 0. A table of Bayes factors without NaN.",
)
def enormous_factor(folder):
    textures = tuple((0.01 + 0.001 * i, 0.03) for i in range(15))
    frame = made(rb.Modified(), [1.4], textures=textures, error=1e-7)
    frame = pd.concat([frame.assign(series=str(i)) for i in range(120)])
    table = rb.read_table(frame)
    few = Execution(settings=FEW, scores=False)
    weighed = compare_with(few, table, [rb.Modified(), rb.Classic()], noise="iid", rng=1)
    row = weighed.bayes_factors.iloc[0]
    truth = by_quadrature(weighed.fits["modified"].model, tol=1e-4)
    truth -= by_quadrature(weighed.fits["classic"].model, tol=1e-4)
    assert row["ln_bf"] > 9e4
    assert abs(row["ln_bf"] - truth) < 1e-2
    assert math.isclose(row["log10_bf"], row["ln_bf"] / math.log(10))
    assert weighed.probabilities == {"modified": 1.0, "classic": 0.0}
    weighed.bayes_factors.to_csv(folder / "factors.csv", index=False)
    back = pd.read_csv(folder / "factors.csv")
    assert back[["ln_bf", "ln_bf_se", "log10_bf"]].notna().all(axis=None)
    assert "very strong for modified" in back.loc[0, "reading"]
    return f"ln BF {row['ln_bf']:.1f}, log10 {row['log10_bf']:.1f}; probabilities 1 and 0"


@hard_case(
    "Two modes 1,000 sds apart, of a user's own form",
    why="Every start and every method finds the same mode. Draws agree, bridge and quadrature "
    "agree, and all miss half the evidence.",
    expected="The sum over both modes is ln 2 above each. The fit and every evidence report it, "
    "and no evidence is used.",
)
def two_modes_far_apart():
    frame = made(rb.Modified(), [1.4], error=0.03)
    fit = rb.calibrate(rb.read_table(frame), Even(), rng=1, settings=FEW, noise="iid")
    found = evidences(fit)
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
    assert abs(found[0].value - one) < 0.01
    assert not fit.converged
    assert all("several modes" in evidence.status for evidence in found)
    table = evidence_table({("even", "iid"): found})
    assert not table["used"].any()
    told = fit.convergence_failures[0]
    return f"ln Z of one mode {found[0].value:.2f}, of both {one + math.log(2):.2f}: {told}"


@hard_case(
    "A posterior of sigma at its bound",
    why="With known errors the best sigma is 0. A mode at a bound has no curvature. A normal "
    "approximation cuts off half of it, or adds as much beyond.",
    expected="ln Z from a plain sum over 1,000 x 1,000 points: quadrature to 1e-5, bridge to 5 "
    "standard errors. Laplace is recognised as wrong: off by more than 0.01.",
)
def sigma_on_its_bound():
    frame = made(rb.Modified(), [1.4], error=0.001, rel_se=0.02)
    log_c = math.log(1.4) + np.linspace(-0.1, 0.1, 1000)
    truth, _ = summed_over_grid(frame, log_c, np.linspace(-22, -1, 1000))
    bridge, quadrature, laplace = evidences(
        rb.calibrate(rb.read_table(frame), rb.Modified(), rng=1, settings=FEW, noise="iid")
    )
    assert abs(quadrature.value - truth) < 1e-5
    assert abs(bridge.value - truth) < 5 * bridge.se < 0.01
    off = laplace.value - truth
    assert abs(off) > 0.01
    return f"ln Z {truth:.4f}; quadrature {quadrature.value:.4f}, Laplace off by {off:+.2f}"


@hard_case(
    "A bridge from draws that do not move",
    why="The covariance of equal draws is singular. An iteration on them crashes or settles on an "
    "arbitrary number.",
    expected="The status is not ok and there is no value. The next method with status ok is used.",
)
def bridge_of_frozen_draws():
    table = rb.read_table(made(rb.Modified(), [1.4], error=0.03))
    fit = rb.calibrate(table, rb.Modified(), rng=1, settings=FEW, noise="iid")
    u = fit.chains.u.copy()
    u[:] = u[:, :1, :1]
    density = np.broadcast_to(fit.chains.log_density[:, :1, :1], fit.chains.log_density.shape)
    frozen = replace(fit, chains=replace(fit.chains, u=u, log_density=density))
    found = evidences(frozen)
    assert not found[0].ok
    assert math.isnan(found[0].value)
    used = evidence_table({("modified", "iid"): found})
    assert used.loc[used["used"], "method"].tolist() == ["quadrature"]
    return f"bridge: {found[0].status}; quadrature is used"


@hard_case(
    "A bridge limited to one step",
    why="An iteration that was stopped early returns a number that looks like any other.",
    expected="No value, and a status that says that the iteration did not settle.",
)
def bridge_stopped():
    table = rb.read_table(made(rb.Modified(), [1.4], error=0.03))
    fit = rb.calibrate(table, rb.Modified(), rng=1, settings=FEW, noise="iid")
    found = bridge_evidence(
        fit.model.log_density,
        fit.chains,
        fit_laplace(fit.model),
        rng=np.random.default_rng(1),
        iterations_max=1,
    )
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
    "Z is the normal density of the rows, to 1e-6.",
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
        value = by_quadrature(model, tol=1e-8)
        assert abs(value - truth) < 1e-6 * max(1, abs(truth)), (log_sd, rel_se, value, truth)
        seen.append(f"{value:.6g}")
    return "ln Z " + ", ".join(seen)


@hard_case(
    "Savage-Dickey where c2 = 0 lies 10 to 600 posterior sds out",
    why="A grid of fixed size that is stretched to such a point steps over the posterior. At c2 = "
    "0 the errors would have to be wider than in any draw. The result was 315,829 where 68.8 is "
    "right.",
    expected="The difference of the evidences by quadrature (four standard errors and 0.02), or a "
    "status that is not ok. No wrong number has the status ok, and none is in the table of Bayes "
    "factors.",
)
def savage_dickey_far_out():
    seen = []
    for c2, error in ((0.02, 0.03), (0.1, 0.02), (0.1, 1e-3)):
        frame = made(rb.Hybrid(), [1.35, c2], error=error)
        fit, _ = importance_posterior(model_of(frame, rb.Hybrid()), seed=1, n_draw=2_048)
        truth = by_quadrature(fit.model, tol=1e-4) - by_quadrature(model_of(frame))
        row, found = fit.summary.iloc[1], savage_dickey(fit)
        if found.ok:
            assert abs(found.value - truth) < 4 * found.se + 0.02
        said = f"{found.value:.2f}" if found.ok else found.status
        seen.append(f"{row['mean'] / row['sd']:.0f} sds: {said} for {truth:.2f}")
        assert found.ok == (c2 == 0.02)
    return "; ".join(seen)


@hard_case(
    "Thermodynamic integration of a likelihood as sharp as 1e-9",
    why="Nearly all of ln Z lies between two temperatures. The integration rule steps over it, "
    "and the Monte Carlo error does not include that. The result was 119.2 ± 0.4 where 196.4 is "
    "right.",
    expected="With errors of 3 %: the value by quadrature within four of its errors. At 1e-6 and "
    "1e-9: a status that is not ok.",
)
def sharp_thermodynamic_integration():
    seen = []
    for error in (0.03, 1e-6, 1e-9):
        model = model_of(made(rb.Modified(), [1.4], error=error))
        truth, found = by_quadrature(model), thermodynamic_evidence(model)
        assert found.ok == (error == 0.03), (error, found)
        if found.ok:
            assert abs(found.value - truth) < 4 * found.se < 1
        said = f"{found.value:.2f} ± {found.se:.2f}" if found.ok else found.status
        seen.append(f"{error:g}: {said} for {truth:.2f}")
    return "; ".join(seen)


@hard_case(
    "Sensitivity where the rows carry no information",
    why="Equal weights have no tail. Their Pareto shape is 0/0.",
    expected="With rows of known error 1e6: no sensitivity to the likelihood (under 0.005), some "
    "to the prior (over 0.05), and neither is NaN. Stretching a prior leaves ln Z unchanged "
    "(1e-4).",
)
def rows_without_power():
    frame = made(rb.Modified(), [1.4], error=0.03, rel_se=1e6)
    fit = rb.calibrate(rb.read_table(frame), rb.Modified(), rng=1, settings=FEW, noise="iid")
    found = power_scaling(fit)
    assert (found["likelihood"] < 0.005).all()
    assert (found["prior"] > 0.05).all()
    assert set(found["diagnosis"]) == {"strong prior or weak likelihood"}
    wide = model_of(frame, c=rb.LogNormal(1.382, 10.0))
    change = by_quadrature(wide) - by_quadrature(fit.model)
    assert abs(change) < 1e-4
    top = found["likelihood"].max()
    return f"likelihood at most {top:.4f}, prior at least {found['prior'].min():.2f}"


@hard_case(
    "A posterior 1e-12 as wide as its prior",
    why="A rule whose points cover the prior never meets the posterior.",
    expected="ln Z by the normal density of the rows (conjugate, known errors), 1e-6. Mean and sd "
    "of c to five standard errors of the draws.",
)
def posterior_far_narrower_than_prior():
    known = 1e-6
    frame = made(rb.Modified(), [1.4], error=known, rel_se=known)
    priors = {"c": rb.LogNormal(1.0, 1e6), "sigma": rb.HalfNormal(1e-14)}
    model = model_of(frame, **priors)
    r = modified_residuals(frame, np.longdouble)
    n = len(r)
    spread = np.longdouble(4e12)
    mean = r.mean()
    squares = ((r - mean) ** 2).sum() / known**2 + n * mean**2 / (known**2 + n * spread)
    log_det = (n - 1) * 2 * np.log(np.longdouble(known)) + np.log(known**2 + n * spread)
    truth = float(-0.5 * (squares + log_det + n * np.longdouble(LOG_2PI)))
    value = by_quadrature(model)
    assert abs(value - truth) < 1e-6
    fit = rb.calibrate(
        rb.read_table(frame), rb.Modified(), priors=priors, rng=1, settings=FEW, noise="iid"
    )
    row = fit.summary.iloc[0]
    centre, sd = float(np.exp(-mean / 2)), 1.4 * known / 2 / math.sqrt(n)
    assert fit.converged
    assert abs(row["mean"] - centre) < 5 * row["mcse_mean"] + 1e-15
    assert abs(row["sd"] / sd - 1) < 0.05
    return f"sd {row['sd'] / 1.4 / 1e6:.1e} of the prior's; ln Z {value:.6f} for {truth:.6f}"


@hard_case(
    "A form whose evidence failed with every method",
    why="One NaN in a softmax makes every probability NaN.",
    expected="The probabilities of the others sum to 1. The failed form has none.",
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
    exact = power_law_evidence(model_of(made(rb.Modified(), [1.4], error=0.01), rb.PowerLaw()))
    assert exact.ok
    return "probabilities NaN (none), 0 and 1 at ln Z of ± 1e300"
