"""Deep matrix factorizations."""
