"""The kinds of table, figure and claim that a paper's layout may name: one module or folder each, with its `ITEM`."""
