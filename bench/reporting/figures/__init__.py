"""Figures of scored rows, as files."""
