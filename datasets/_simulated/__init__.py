"""Measurements simulated on the edges of a graph."""
