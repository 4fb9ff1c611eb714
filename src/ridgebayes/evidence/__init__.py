"""Log evidences: the log of the integral of likelihood times prior.

`pairs` computes the evidence of every form under every error model by importance sampling. As an
independent check under the selected error model, `walk_pair` samples a posterior with emcee, and
`bridge` computes the evidence from these draws. `prior_sensitivity` measures the effect of the
priors' scales, `components` compares error models with and without a component, and `tables` has
the tables of evidences and probabilities. Densities are those of log loads for all forms, so that
evidences of one table are comparable. The methods are explained in docs/derivations/evidence.md.

>>> from ridgebayes.evidence.pairs import weigh_pairs
>>> from ridgebayes.model.forms import Modified
>>> from ridgebayes.model.noise import Noise
>>> from ridgebayes.model.observations import Observations
>>> from ridgebayes.table.datafiles import paper_sweep
>>> weighed = weigh_pairs(Observations.from_table(paper_sweep()), [Modified()], [Noise()])
>>> row = weighed.evidence.iloc[0]  # 78.863 by quadrature
>>> bool(abs(row["log_evidence"] - 78.863) < 4 * row["log_evidence_se"])
True
"""
