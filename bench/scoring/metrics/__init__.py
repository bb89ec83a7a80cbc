"""How good one estimate is: the gauge removed, errors of cameras and of edges."""
