"""RAGO: rectified edges and moved cameras in turn, each by a recurrent unit that reads a graph of costs."""
