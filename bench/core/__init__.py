"""The vocabulary: rotations, problems, estimates, outcomes and errors; it imports nothing else of bench."""
