"""Layouts of published tables with their numbers."""
