"""Starts, triangles and trees."""
