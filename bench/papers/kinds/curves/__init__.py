"""A figure of errors on simulated problems against one of their parameters, with panels for another."""

from bench.papers.kinds.curves.plot import CurvePlot

ITEM = CurvePlot
