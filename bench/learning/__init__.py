"""Methods that learn: what they share, and what their weights are."""
