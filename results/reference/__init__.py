"""Our own runs that take long; README.md says what made each."""
