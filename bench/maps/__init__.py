"""Phase maps: where, over two parameters of a simulated dataset, each method breaks down."""
