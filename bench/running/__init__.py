"""A run: which jobs are left, an engine that places them, and what is shown meanwhile."""
