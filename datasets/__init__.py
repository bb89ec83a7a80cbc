"""Sources of problem instances: one file, one source."""

if __name__ != "bench.datasets":
    raise ImportError("this folder is bench.datasets: import it under that name, with the checkout's root on the path")
