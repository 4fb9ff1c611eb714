"""Draws from a posterior: the integral over offsets, samplers, diagnostics, files.

`latent` integrates offsets and log K out of a model: in closed form for normal rows (`precision`),
and with random `points` around `working_rows` for other rows. `target` defines the posterior that
is sampled, in the coordinates of `charts`. `importance` draws from it with a mixture (`proposal`)
that is fitted from its `modes`. `emcee_sampling` is a second, independent sampler: `chains` has its
settings and results, `checkpoint` saves it to disk.

A `Posterior` (`posterior`) holds draws. `diagnostics` tests their convergence, `arviz_groups`
labels them for arviz, `netcdf` writes and reads files, and `mixture` approximates them by a
Gaussian mixture that other programs can use as a prior. `log_evidence` defines the record of an
evidence, `presets` the accuracies. The derivations are in docs/derivations/sampling.md.

>>> from ridgebayes.inference.importance import Effort, importance_sample
>>> from ridgebayes.inference.posterior import posterior_of
>>> from ridgebayes.inference.target import ModelTarget
>>> from ridgebayes.model.forms import Modified
>>> from ridgebayes.model.model import Model
>>> from ridgebayes.model.observations import Observations
>>> from ridgebayes.table.datafiles import paper_sweep
>>> model = Model(Observations.from_table(paper_sweep()), Modified())
>>> drawn = importance_sample(ModelTarget(model), Effort(), seed=1)
>>> posterior = posterior_of(model, drawn, seed=1)
>>> posterior.draws.shape, round(drawn.evidence.value, 1)
((4096, 2), 78.9)
"""
