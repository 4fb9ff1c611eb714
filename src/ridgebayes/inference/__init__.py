"""Draws from a posterior: its normal approximation, samplers, diagnostics, files.

`laplace` finds a mode (`mode_search`), in the `coordinates` that suit; `moves` fits proposals.
Three ways lead to a `Posterior` (`posterior`): a walk (`emcee_sampling`; `chains` has what it is
asked for and what it returns, `checkpoint` keeps it on disk), `importance_sampling` (always where
offsets have no closed-form integral), and for the power law exact draws (`power_law_exact`);
`sampling` picks the one that suits a model. `diagnostics` judges draws, `qmc_nodes` compresses
them, `arviz_groups` names them as arviz does, `netcdf` writes them, `mixture` makes few numbers of
them, a prior for other programs; `log_evidence` has the record of an evidence, `presets` the
accuracies to choose from. The room knows `model` and `runtime`. What they compute, and why it
suffices: docs/derivations/sampling.md.

>>> from ridgebayes.inference.importance_sampling import importance_posterior
>>> from ridgebayes.model.forms import Modified
>>> from ridgebayes.model.model import Model
>>> from ridgebayes.model.observations import Observations
>>> from ridgebayes.table.datafiles import paper_sweep
>>> model = Model(Observations.from_table(paper_sweep()), Modified())
>>> posterior, evidence = importance_posterior(model, seed=1)
>>> posterior
Posterior(modified, iid: c = 1.374 ± 0.0034, sigma = 0.03185 ± 0.0037; converged)
>>> posterior.draws.shape, round(float(evidence.value), 1)
((10240, 2), 78.9)
"""
