"""Named suites."""
