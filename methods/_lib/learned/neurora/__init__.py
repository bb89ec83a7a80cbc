"""CleanNet, the tree that it leads to, and FineNet."""
