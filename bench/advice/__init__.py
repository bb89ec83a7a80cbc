"""Which method to use on a graph: what it looks like, how methods do on simulated twins of it, and earlier evidence."""
