"""LITS: one layer, repeated from the identity, that reads the residuals of each camera's edges and turns the camera."""
