"""Univariate distributions, and their text form.

Distributions describe priors and uncertain values of a scene. Each has a density, draws, and a
transform from a standard normal variable, in which sampling and integration run.

>>> from ridgebayes.distributions.grammar import parse_distribution
>>> young = parse_distribution("lognormal(60, 20 %)", "youngs_modulus")
>>> young
LogNormal(median=60.0, log_sd=0.2)
>>> float(young.value_at(0.0)), float(young.score(60.0))
(60.0, 0.0)
"""
