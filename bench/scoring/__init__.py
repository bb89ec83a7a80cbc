"""Scores as pure functions of what is stored: another metric or alignment never needs a re-run."""
