"""Log evidences: the log of the integral of likelihood times prior.

`pairs` weighs every form under every error model by importance sampling; `bridge` finds the
evidence of a walk's draws, a second way for the selected error model; `prior_sensitivity` says how
far evidences depend on the priors' scales. The densities are of the log loads, so evidences of one
table compare across all forms. How each method works: docs/derivations/evidence.md.

>>> from ridgebayes.evidence.pairs import weigh_pairs
>>> from ridgebayes.model.forms import Modified
>>> from ridgebayes.model.noise import Noise
>>> from ridgebayes.model.observations import Observations
>>> from ridgebayes.table.datafiles import paper_sweep
>>> weighed = weigh_pairs(Observations.from_table(paper_sweep()), [Modified()], [Noise()])
>>> found = weighed.evidence.iloc[0]  # 78.863 by quadrature
>>> bool(abs(found["log_evidence"] - 78.863) < 4 * found["log_evidence_se"])
True
"""
