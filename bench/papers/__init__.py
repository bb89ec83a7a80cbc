"""Layouts of published tables and figures, and their comparison with what is measured here."""
