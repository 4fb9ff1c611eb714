"""A posterior as a log density: contact forms, priors, error models, observed rows.

`forms` has the contact forms; `noise`, `tails` and `shared_offsets` the error models; `priors`,
`default_priors` and `prior_files` the priors; `observations` the rows, `rows` their likelihood one
by one. A `Model` (`model`) puts them together, with the likelihood that suits: of
`likelihood_independent`, `likelihood_marginal` (offsets integrated out, see `conditional_offsets`)
or `likelihood_latent` (offsets drawn, the integral estimated). `replicated` says what rows could
have been. Nothing here samples a posterior. The room knows `contact` and `table`.

>>> import numpy as np
>>> from ridgebayes.model.forms import Modified
>>> from ridgebayes.model.model import Model
>>> from ridgebayes.model.observations import Observations
>>> from ridgebayes.table.datafiles import paper_sweep
>>> model = Model(Observations.from_table(paper_sweep()), Modified())
>>> model.priors
{'c': LogNormal(median=1.382, log_sd=0.1), 'sigma': HalfNormal(sd=0.05)}
>>> round(float(model.log_likelihood(np.array([1.38, 0.03]))), 3)
83.074
"""
