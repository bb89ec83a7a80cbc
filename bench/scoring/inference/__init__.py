"""What the errors of many estimates allow to say: ties, intervals, differences and ranks."""
