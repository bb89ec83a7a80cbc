"""Measured beside published, cell by cell."""
