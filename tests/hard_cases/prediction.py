"""Hard cases of prediction: far from the data, and very many points."""
