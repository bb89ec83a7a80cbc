"""Compiled loops over edges, cameras and triangles."""
