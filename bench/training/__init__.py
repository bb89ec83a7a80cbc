"""Training of methods that learn: graphs to learn from, the course of it, and what came of it."""
