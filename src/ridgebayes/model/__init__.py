"""A posterior as a log density: contact forms, priors, error models, observed rows.

`forms` has the contact forms; `noise`, `tails` and `offsets` the error models; `default_priors`,
`prior_files` and `joint_prior` the priors; `observations` the rows of a table, `rows` their
densities. A `Model` (`model`) puts them together: a latent Gaussian model, whose offsets are
integrated out in the room `inference`. `replicated` draws rows that could have been. Nothing here
samples a posterior. The room knows `contact` and `table`.

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
