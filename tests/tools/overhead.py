"""What the harness costs: 300 trivial jobs, the time from one finished job to the next, and jobs a second.

    python tests/tools/overhead.py [WORKERS]

No test, because it measures time. Planning, the instances and the start of the fork server are left out.
"""

import itertools
import os
import sys
import tempfile
import time
from pathlib import Path
from statistics import median

from bench.running.run import Options, Run

JOBS, FIRST = 300, 10  # the first few start the fork server


def main(workers: int) -> None:
    with tempfile.TemporaryDirectory(prefix="rotsync-") as folder:
        options = Options(out=Path(folder), jobs=workers, seeds=JOBS)
        run = Run(None, ["spanning-tree"], ["erdos-renyi[n=10,missing=0]"], options)
        run.prepare()
        finished = run.execute()
        for _ in itertools.islice(finished, FIRST):
            pass
        own, moments = time.process_time(), [time.perf_counter()]
        for _, record in finished:
            assert record.outcome.ok
            moments.append(time.perf_counter())
        own = time.process_time() - own
    jobs = len(moments) - 1
    took_ms = sorted(1000 * (after - before) for before, after in itertools.pairwise(moments))
    print(
        f"{workers} at a time: median {median(took_ms):.1f} ms, 10 % below {took_ms[jobs // 10]:.1f} ms, "
        f"{jobs / (moments[-1] - moments[0]):.0f} jobs/s; the harness itself {1000 * own / jobs:.1f} ms of processor "
        f"time a job; load {os.getloadavg()[0]:.1f}"
    )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1)
