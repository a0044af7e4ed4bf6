"""A loop to be killed: records `time_s`, the cycle and its square, and says how far it got.

python recording_loop.py FILE PERIOD_S [ROWS]
"""

from __future__ import annotations

import itertools
import sys
import time

from tautwave.runtime.recorder import Recorder


def main() -> None:
    path, period = sys.argv[1], float(sys.argv[2])
    rows = int(sys.argv[3]) if len(sys.argv) > 3 else 8192
    recorder = Recorder(
        path,
        ("time_s", "cycle", "square"),
        metadata={},
        attachments={},
        rows=rows,
        lossless=True,
        rate_hz=1000.0,
    )
    recorder.start()
    print(recorder.writer_pid, flush=True)
    for cycle in itertools.count():
        recorder.row[0] = cycle * 1e-3
        recorder.row[1] = cycle
        recorder.row[2] = cycle * cycle
        recorder.commit()
        if cycle % 50 == 0:
            print(cycle + 1, flush=True)
            time.sleep(50 * period)


if __name__ == "__main__":
    main()
