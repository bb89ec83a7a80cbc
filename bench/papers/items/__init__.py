"""The kinds of table, figure and claim that a paper's layout may name."""
