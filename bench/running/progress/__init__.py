"""The live table of a run and its estimate of the time left."""
