"""Distributions of single numbers, and their text.

Priors are such distributions, and so may values of a scene be. Each has a density, draws, and a
transform from a standard normal, in whose coordinates everything is sampled and integrated.

>>> from ridgebayes.distributions.grammar import parse_distribution
>>> young = parse_distribution("lognormal(60, 20 %)", "youngs_modulus")
>>> young
LogNormal(median=60.0, log_sd=0.2)
>>> float(young.value_at(0.0)), float(young.score(60.0))
(60.0, 0.0)
"""
