"""The soft cylinder on rigid ridges by finite elements, at small and at finite strain."""
