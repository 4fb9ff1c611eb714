"""Measure effective samples per CPU second: ``python benchmarks/sampling_speed.py``.

The posterior is that of the Hybrid form on the 41 calibration rows of the embedded sweep. Three
ways to sample it, in one process and in turn:

- `ridgebayes`: `calibrate` itself, with everything that it does: statistics of the rows, mode
  search, burn-in, sampling until its stopping rule is met, convergence table;
- emcee with its default stretch move and a log-probability of one walker at a time, written with
  NumPy over the 41 rows as one would write it down from the model;
- the same move with the same log-probability for all walkers at once (``vectorize=True``).

emcee gets 32 walkers, 5,000 steps after 300 of burn-in, and starting points around the posterior's
centre that cost it nothing. Effective samples are those of the worst of c1, c2 and sigma, by one
function for all. Medians of three rounds; the ratios are of one run and hold on any machine.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import time

import emcee
import numpy as np

import ridgebayes as rb
from peers.target import Target
from ridgebayes.inference.diagnostics import effective_sample_size
from ridgebayes.results import Fit

ROUNDS = 3
N_WALKER, N_BURN, N_STEP = 32, 300, 5_000
WANTED = 20.0
COLUMNS = ("a_over_R", "b_over_R", "Q", "p_over_E")


def target() -> Target:
    """Return the same posterior in NumPy alone."""
    rows = rb.paper_sweep().calibration.frame
    return Target("hybrid", {name: rows[name].to_numpy() for name in COLUMNS})


def run_ridgebayes(seed: int) -> tuple[float, float, float]:
    """Return CPU seconds, effective samples of the worst parameter, draws."""
    table = rb.paper_sweep()
    start = time.process_time()
    fit = rb.calibrate(table, rb.Hybrid(), rng=seed, noise="iid")
    seconds = time.process_time() - start
    if not fit.converged:
        raise SystemExit(f"not converged: {fit.convergence_failures}")
    theta = fit.model.to_theta(fit.chains.u)
    return seconds, float(effective_sample_size(theta).min()), theta[..., 0].size


def run_emcee(seed: int, *, vectorised: bool, centre: Fit) -> tuple[float, float, float]:
    """Return the same of emcee's default move."""
    draws = centre.draws
    rng = np.random.default_rng(seed)
    start_points = draws[rng.choice(len(draws), N_WALKER, replace=False)]
    plain = target()
    log_probability = plain.log_probability if vectorised else plain.log_probability_of_one
    initial = emcee.State(start_points)
    initial.random_state = np.random.RandomState(seed).get_state()
    start = time.process_time()
    sampler = emcee.EnsembleSampler(N_WALKER, 3, log_probability, vectorize=vectorised)
    state = sampler.run_mcmc(initial, N_BURN, store=False)
    sampler.run_mcmc(state, N_STEP)
    seconds = time.process_time() - start
    theta = sampler.get_chain()[None]
    return seconds, float(effective_sample_size(theta).min()), theta[..., 0].size


def main() -> None:
    fit = rb.calibrate(rb.paper_sweep(), rb.Hybrid(), rng=0, noise="iid")  # warm: imports done
    check_same_posterior(fit)
    ways = {
        "ridgebayes.calibrate": run_ridgebayes,
        "emcee, stretch move, one walker a call": lambda seed: run_emcee(
            seed, vectorised=False, centre=fit
        ),
        "emcee, stretch move, vectorised": lambda seed: run_emcee(
            seed, vectorised=True, centre=fit
        ),
    }
    found = {way: [] for way in ways}
    for seed in range(ROUNDS):
        for way, work in ways.items():
            found[way].append(work(seed))
    speed = {w: np.median([ess / cpu for cpu, ess, _ in runs]) for w, runs in found.items()}
    ours = speed["ridgebayes.calibrate"]
    print(f"Hybrid, 41 rows, worst of three parameters; medians of {ROUNDS} rounds")
    print(f"{'way':<40} {'CPU s':>7} {'draws':>8} {'ESS':>8} {'ESS/CPU s':>10} {'ratio':>6}")
    for way, runs in found.items():
        cpu, ess, draws = np.median(runs, axis=0)
        ratio = ours / speed[way]
        print(f"{way:<40} {cpu:>7.2f} {draws:>8.0f} {ess:>8.0f} {speed[way]:>10.0f} {ratio:>6.1f}")
    print(f"wanted: ratio of {WANTED:g} or more to one walker a call")


def check_same_posterior(fit: Fit) -> None:
    """Stop if the three densities are not one: they may differ by a constant only."""
    theta = fit.draws[::500]
    in_theta = fit.model.log_prior(theta) + fit.model.log_likelihood(theta)
    plain = target()
    one_by_one = np.array([plain.log_probability_of_one(t) for t in theta])
    for other in (one_by_one, plain.log_probability(theta)):
        apart = other - in_theta
        if np.ptp(apart) > 1e-8:
            raise SystemExit(f"the densities differ by {np.ptp(apart):.2g}")


if __name__ == "__main__":
    main()
