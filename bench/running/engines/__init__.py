"""Engines place supervised jobs: `local` on this machine, `timing` one at a time, `dask` on a cluster."""
