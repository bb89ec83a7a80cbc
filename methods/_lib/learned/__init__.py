"""What networks on view graphs share: the graph with both directions of every edge, layers, training in torch."""
