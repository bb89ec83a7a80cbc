"""Sources of problem instances: one file, one source."""
