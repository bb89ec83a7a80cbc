"""Sentences of a paper as comparisons that can be tested, for several forms of its method."""

from bench.papers.kinds.claims.statements import Claims

ITEM = Claims
