"""Rotation synchronization methods: one file, one method."""

if __name__ != "bench.methods":
    raise ImportError("this folder is bench.methods: import it under that name, with the checkout's root on the path")

DEFAULT = "consensus"  # what solves a graph where no method is named
