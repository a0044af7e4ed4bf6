"""Memory of a sweep's client over many pieces: `python -m tests.sweep.flat_memory 100000`.

A scheduler and a worker of their own processes do pieces that take no time; the resident memory of
client and scheduler is printed ten times on the way.
"""

from __future__ import annotations

import sys
import tempfile
from itertools import count
from pathlib import Path

from tautwave.sweep import cluster
from tests.sweep.serving import Serving
from tests.sweep.test_cluster import times_ten


def resident_mb(pid: int | str) -> float:
    """Return the resident memory of a process [MB]."""
    status = Path(f"/proc/{pid}/status").read_text()
    return int(status.partition("VmRSS:")[2].split()[0]) / 1024


def main(pieces: int) -> None:
    """Print the memory after each tenth of the pieces."""
    cluster.MAX_QUEUED_PER_WORKER = 32  # pieces of no length: many on the way, so that few wait
    with tempfile.TemporaryDirectory() as folder:
        serving = Serving(Path(folder), workers=1)
        try:
            client = cluster.Cluster(str(serving.file))
            results = client(times_ten, ((k, k + 1) for k in range(pieces)))
            for done, _ in zip(count(1), results, strict=False):
                if done % (pieces // 10) == 0:
                    mine, its = resident_mb("self"), resident_mb(serving.scheduler.pid)
                    print(f"{done:8}  client {mine:6.1f} MB  scheduler {its:6.1f} MB", flush=True)
            client.close()
        finally:
            serving.end()


if __name__ == "__main__":
    main(int(sys.argv[1]))
