"""Edge cases of sampling: chains that look converged but are not."""

import functools
import math
import re
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

import ridgebayes as rb
from ridgebayes.inference.emcee_sampling import walk
from ridgebayes.inference.importance import Effort, importance_sample
from ridgebayes.inference.proposal import Mixture
from ridgebayes.inference.target import PlainTarget
from tests.hard_cases.case import hard_case, refused
from tests.hard_cases.likelihood import FEW, THREE, made, weighed

SETTLED = rb.SampleSettings(n_walker=64)  # tau to 1 %, as by default
ROWS = functools.partial(made, rb.Modified(), [1.4], error=0.03)


@dataclass(frozen=True)
class Own(rb.Modified):
    """A form of the user's own: Modified, until something is wrong with it."""

    name: ClassVar[str] = "own"
    broken: str = ""
    above: float = 1.41

    def rate(self, theta, a_over_R, b_over_R):
        rate = super().rate(theta, a_over_R, b_over_R)
        beyond = rate > self.above
        if self.broken == "raises" and beyond.any():
            raise ValueError(f"own table ends at {self.above}")
        value = {"nan": math.nan, "inf": math.inf}.get(self.broken)
        return rate if value is None else np.where(beyond, value, rate)

    def log_rate_gradient(self, theta, a_over_R, b_over_R):
        gradient = super().log_rate_gradient(theta, a_over_R, b_over_R)
        return {"no slope": 0.0, "wrong slope": 0.5}.get(self.broken, 1.0) * gradient


@dataclass(frozen=True)
class Renamed(Own):
    """The same with a coefficient that has no default prior."""

    name: ClassVar[str] = "renamed"

    @property
    def parameter_names(self):
        return ("alpha",)


@dataclass(frozen=True)
class Scaled(rb.Hybrid):
    """Hybrid with both coefficients in units of their own."""

    name: ClassVar[str] = "scaled"
    units: ClassVar[tuple[float, float]] = (1e12, 1e-12)

    @property
    def parameter_names(self):
        return ("large", "small")

    def rate(self, theta, a_over_R, b_over_R):
        return super().rate(theta / np.array(self.units), a_over_R, b_over_R)

    def log_rate_gradient(self, theta, a_over_R, b_over_R):
        units = np.array(self.units)
        return rb.Hybrid().log_rate_gradient(theta / units, a_over_R, b_over_R) / units


def shortened(said):
    """Return a message with five digits of each number: the others differ between machines."""
    return re.sub(r"(\d\.\d{4})\d+", r"\1", said)


def calibrated(form, **options):
    """Return the fit of three textures."""
    options = {"settings": FEW, "noise": "iid", **options}
    return rb.calibrate(rb.read_table(ROWS()), form, rng=1, **options)


def walked(log_density, *, proposal=None, settings=SETTLED):
    """Return the chains of a density of two coordinates."""
    target = PlainTarget("density", ("x", "y"), log_density)
    if proposal is None:
        proposal = importance_sample(target, Effort(), 1).proposal
    return walk(target, proposal, seed=1, settings=settings).chains


@hard_case(
    "A rate that is NaN or infinite above some coefficient",
    why="If it counts as zero likelihood, it cuts off the posterior there. MCMC converges to the "
    "rest, and the user gets no message.",
    expected="Refused at the mode and five sds out. The message names form, value, coefficient "
    "and texture.",
)
def undefined_rates():
    said = [
        refused(
            functools.partial(calibrated, Own(broken, above)),
            rb.ComputationError,
            "own: rate of texture a/R = 0.012, b/R = 0.03 at c = 1.",
            f", got {broken}",
            "a/R = 0.012",
            "expected a finite number",
        )
        for broken, above in (("nan", 1.41), ("inf", 1.41), ("nan", 1.45), ("inf", 1.45))
    ]
    return shortened(said[0])


@hard_case(
    "An exception raised by a user's own form",
    why="A search that catches every ValueError would blame the data.",
    expected="The user's exception, unchanged.",
)
def exception_in_a_form():
    return refused(lambda: calibrated(Own("raises", 1.39)), ValueError, "own table ends at 1.39")


@hard_case(
    "A form whose gradient is zero, or half of the true gradient",
    why="The search ends where the wrong gradient vanishes. A convergence test with the same "
    "gradient agrees with it.",
    expected="Refused, with the change of log rate that the gradient predicts and the true change.",
)
def wrong_gradients():
    said = [
        refused(functools.partial(calibrated, Own(broken)), rb.InputError, "log_rate_gradient")
        for broken in ("no slope", "wrong slope")
    ]
    return shortened(said[1])


@hard_case(
    "A user's own coefficient without a prior",
    why="A look-up of defaults ends in KeyError, and the user's form cannot be used.",
    expected="Refused; the message names the coefficient and the argument to pass. With the "
    "prior: the draws of Modified, to 5 % of an sd (Monte Carlo).",
)
def own_coefficient():
    said = refused(lambda: calibrated(Renamed()), rb.InputError, "renamed", "'alpha'", "priors=")
    own = calibrated(Renamed(), priors={"renamed": {"alpha": rb.LogNormal(1.382, 0.1)}}).summary
    known = calibrated(rb.Modified()).summary
    off = np.abs(own["mean"] - known["mean"]) / known["sd"]
    assert off.max() < 0.05
    return said


@hard_case(
    "Chains that are too short",
    why="One step has no autocorrelation. With no steps a mean is 0/0. Without burn-in emcee "
    "returns no state. A threshold of NaN is never met, and 20,000 steps run.",
    expected="No steps, no burn-in, or thresholds that are not positive numbers: refused. 1 to 5 "
    "steps: not converged, and the failed criteria are named.",
)
def too_short():
    wrong = ("n_step_max", 0), ("n_step_max", -5), ("n_burn", 0), ("n_burn", -1)
    wrong += ("n_tau", math.nan), ("n_tau", -1.0), ("tau_change", math.inf), ("tau_change", 0.0)
    wrong += ("n_ensemble", 3), ("n_walker", 2), ("n_walker", 33)
    for name, value in wrong:
        make = functools.partial(rb.SampleSettings, **{name: value})
        refused(make, rb.InputError, f"{name}: expected ", f"got {value}")
    for n in (1, 2, 5):
        fit = calibrated(rb.Modified(), settings=rb.SampleSettings(n_walker=8, n_step_max=n))
        assert not fit.converged
        assert any("steps are not 50 tau" in line for line in fit.convergence_failures)
        assert np.isfinite(fit.draws).all()
    n_missing = len(fit.convergence_failures)
    return f"{len(wrong)} settings refused; 5 steps: {n_missing} criteria failed"


@hard_case(
    "Walkers stuck in two modes 30,000 sds apart",
    why="No walker ever crosses, and each ensemble has its own shares of the two modes. Within one "
    "ensemble all means look settled.",
    expected="Not reported as converged; R-hat of the coordinate is named.",
)
def stuck_apart():
    def needles(u):
        x, y = u[..., 0], u[..., 1]
        sds = np.stack([(x - 1.5) / 1e-4, (x + 1.5) / 1e-4])
        return np.logaddexp(*(-0.5 * np.minimum(sds**2, 1e12))) - 0.5 * y * y

    from ridgebayes.inference.diagnostics import failed_diagnostics, summarise

    settings = rb.SampleSettings(n_walker=8, n_burn=400, n_step_max=600)
    chains = walked(needles, proposal=Mixture.prior(2), settings=settings)
    assert set(np.sign(chains.u[..., 0]).ravel()) == {-1, 1}  # both modes have walkers
    failures = failed_diagnostics(summarise(chains.u, ("x", "y")))
    assert any(line.startswith("x: R-hat") for line in failures)
    return f"{len(chains.convergence_failures + failures)} criteria failed, among them R-hat of x"


@hard_case(
    "Correlation of 0.999999",
    why="In the original coordinates nearly every proposal misses a ridge that is a thousand "
    "times longer than wide.",
    expected="sds of 1, correlation 0.999999, and the sd across the ridge 1e-3 to 3 % (Monte "
    "Carlo).",
)
def strongly_correlated():
    rho = 0.999999
    inverse = np.linalg.inv([[1, rho], [rho, 1]])
    chains = walked(lambda u: -0.5 * np.einsum("...i,ij,...j->...", u, inverse, u))
    assert not chains.convergence_failures
    x, y = chains.u.reshape(-1, 2).T
    across = (x - y).std() / math.sqrt(2)
    truth = math.sqrt(1 - rho)
    assert abs(x.std() - 1) < 0.03
    assert abs(y.std() - 1) < 0.03
    assert abs(across / truth - 1) < 0.03
    return f"sd across the ridge {across:.1e} for {truth:.1e}"


@hard_case(
    "Heavy tails and a hard edge",
    why="A normal proposal hardly ever visits the tail of a Student t. A bound at the mode cuts "
    "off half of the proposals, and an average of both sides falls beyond it.",
    expected="Student t with 3 degrees of freedom: quartiles ± 0.7649 to 0.02. Half-normal: mean "
    "0.7979 and sd 0.6028 to 0.02, and no draw below 0 (Monte Carlo).",
)
def tails_and_edges():
    def density(u):
        t, half = u[..., 0], u[..., 1]
        return -2 * np.log1p(t * t / 3) + np.where(half >= 0, -0.5 * half * half, -np.inf)

    chains = walked(density)
    assert not chains.convergence_failures
    t, half = chains.u.reshape(-1, 2).T
    quartiles = np.quantile(t, [0.25, 0.75])
    np.testing.assert_allclose(quartiles, [-0.7649, 0.7649], atol=0.02)
    assert half.min() >= 0
    assert abs(half.mean() - 0.7979) < 0.02
    assert abs(half.std() - 0.6028) < 0.02
    return "quartiles, mean and sd within 0.02; no draw beyond the edge"


@hard_case(
    "Coefficients of 1e12 and 1e-12 in one posterior",
    why="A covariance with entries of 1e24 and 1e-24 is numerically singular. A step that suits "
    "one coefficient is far too small or too large for the other.",
    expected="In rescaled units, the draws and ln Z of Hybrid: 5 % of an sd (Monte Carlo), and "
    "four standard errors of ln Z (the logarithms of the units cancel).",
)
def scales_far_apart():
    large, small = Scaled.units
    priors = {"large": rb.LogNormal(1.382 * large, 0.1), "small": rb.Normal(0.0, 0.05 * small)}
    scaled, plain = calibrated(Scaled(), priors={Scaled.name: priors}), calibrated(rb.Hybrid())
    assert scaled.converged
    for i, unit in enumerate((large, small, 1.0)):
        one, other = scaled.summary.iloc[i], plain.summary.iloc[i]
        assert abs(one["mean"] / unit - other["mean"]) < 0.05 * other["sd"]
        assert abs(one["sd"] / unit - other["sd"]) < 0.05 * other["sd"]
    one, other = (weighed(fit.model) for fit in (scaled, plain))
    assert abs(one.value - other.value) < 4 * math.hypot(one.se, other.se) < 0.1
    return f"ln Z {one.value:.2f} and {other.value:.2f}"


@hard_case(
    "A chain file resumed after a change in the problem",
    why="emcee appends to any chain file. Half the draws would then belong to another posterior.",
    expected="Another seed, row, prior, error model, sampler setting or number within the form: "
    "refused, and the change is named. Nothing changed: the same draws to the last bit.",
)
def resumed_with_something_else(folder):
    settings = rb.SampleSettings(n_walker=32, n_burn=20, n_step_max=40)
    same = {"rng": 1, "settings": settings, "checkpoint": folder / "chains.npz", "noise": "iid"}
    table, own = rb.read_table(ROWS()), Own("", 2.0)
    first = rb.calibrate(table, own, **same)
    again = rb.calibrate(table, own, **same)
    np.testing.assert_array_equal(first.chains.u, again.chains.u)
    frame = ROWS()
    frame.loc[3, "p_over_E"] *= 1 + 1e-15
    prior = {"priors": {own.name: {"c": rb.LogNormal(1.382, 0.11)}}}
    others = {
        "seed": (table, own, {"rng": 2}),
        "table": (rb.read_table(frame), own, {}),
        "form": (table, replace(own, above=3.0), {}),
        "priors": (table, own, prior),
        "settings": (table, own, {"settings": replace(settings, n_walker=64)}),
        "error model": (table, own, {"noise": "iid:student"}),
    }
    for name, (rows, form, changed) in others.items():
        resume = functools.partial(rb.calibrate, rows, form, **{**same, **changed})
        refused(resume, rb.InputError, "cannot resume", f"{name} was")
    return f"refused: another {', '.join(others)}"


@hard_case(
    "Fifty repeats of one texture",
    why="Repeats of one texture in many series look like many rows but determine only one number.",
    expected="A power law with a single K. Its relative sd is sigma / (2 sqrt n) over all n rows, "
    "to 10 %.",
)
def replicates_of_one_texture():
    frames = [ROWS(textures=THREE[:1], seed=i, series=str(i)) for i in range(50)]
    from pandas import concat

    frame = concat(frames)
    fit = rb.calibrate(rb.read_table(frame), rb.PowerLaw(), rng=1, settings=FEW, noise="iid")
    row = fit.summary.iloc[0]
    expected = 0.03 / (2 * math.sqrt(len(frame)))
    assert fit.converged
    assert len(fit.summary) == 2
    assert abs(row["sd"] / row["mean"] / expected - 1) < 0.1
    return f"relative sd {row['sd'] / row['mean']:.5f} for {expected:.5f}"
