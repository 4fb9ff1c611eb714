"""Hard cases of evidences and Bayes factors: where an estimate goes wrong without a sign."""
