"""Draws from a posterior: the integral over offsets, samplers, diagnostics, files.

`latent` integrates offsets and log K out of a model: exactly for normal rows (`precision`), by
`points` around `working_rows` for others. `target` is the posterior that samplers see, in `charts`.
`importance` draws from it, by `modes` and the mixture of `proposal`; `emcee_sampling` walks it, the
second way (`chains` has settings and results of a walk, `checkpoint` keeps it on disk). A
`Posterior` (`posterior`) holds draws, `diagnostics` judges them, `arviz_groups` names them as arviz
does, `netcdf` writes them, `mixture` makes few numbers of them, a prior for other programs.
`log_evidence` has the record of an evidence, `presets` the accuracies to choose from. The room
knows `model` and `runtime`. How it works: docs/derivations/sampling.md.

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
