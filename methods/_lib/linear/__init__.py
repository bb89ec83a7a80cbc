"""Linear algebra: eigenspaces, Laplacian systems, certificates and rounding."""
