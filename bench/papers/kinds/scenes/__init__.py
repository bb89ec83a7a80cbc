"""A published table of errors, a row for each scene and a column for each method, beside our own."""

from bench.papers.kinds.scenes.table import SceneTable

ITEM = SceneTable
