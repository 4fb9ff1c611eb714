"""Contact forms, error models, priors and observed rows, combined in a log posterior density.

`forms` contains the contact forms; `noise`, `tails` and `offsets` the error models;
`default_priors`, `prior_files` and `joint_prior` the priors; `observations` the rows of a table,
and `rows` their densities. A `Model` (`model`) combines them in a latent Gaussian model, whose
offsets are integrated out in `ridgebayes.inference`. `replicated` simulates new rows. Sampling of
posteriors is in `ridgebayes.inference`.

>>> from ridgebayes.model.forms import Modified
>>> from ridgebayes.model.model import Model
>>> from ridgebayes.model.observations import Observations
>>> from ridgebayes.table.datafiles import paper_sweep
>>> model = Model(Observations.from_table(paper_sweep()), Modified())
>>> model.priors
{'c': LogNormal(median=1.382, log_sd=0.1), 'sigma': HalfNormal(sd=0.05)}
>>> model.outer_names, model.offsets.n_level
(('c', 'sigma'), 0)
"""
