"""Run one job in a supervised child process; engines that run many.

`child` is what happens inside the process that runs a method, `server` forks such processes from one that has
imported what the method requires, `supervise` watches one of them, `local` keeps several going, `dask` does so
on the workers of a cluster.
"""
