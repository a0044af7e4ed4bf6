"""`python -m tautwave.view.camera DIRECTORY NAME KEYS`: one camera beside one run.

Says `{"ready": ...}` or `{"error": ...}` on standard output, later what it has written. It looks at
the run's shared memory only; killed or stuck, it costs the run nothing but its own pictures.
"""

from __future__ import annotations

import json
import os
import signal
import sys
from contextlib import suppress
from pathlib import Path

from tautwave.clock import MonotonicClock
from tautwave.config.keys.devices import Camera
from tautwave.errors import RecordingError, TautwaveError
from tautwave.recordings.cameras import FILE
from tautwave.view.camera.file import CameraFile
from tautwave.view.camera.synthetic import Synthetic
from tautwave.view.camera.v4l2 import Frame, V4l2
from tautwave.view.watched import begun

PATIENCE_S, LOOK_S = 60.0, 0.1
NICE = 5


def main() -> int:
    """Write pictures until the run has ended."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)  # Ctrl-C is for the loop; it ends when that does
    with suppress(OSError):
        os.nice(NICE)
    directory, name, keys = Path(sys.argv[1]), sys.argv[2], sys.argv[3]
    camera = Camera.model_validate_json(keys)
    try:
        source = Synthetic(camera) if camera.driver == "synthetic" else V4l2(camera)
    except TautwaveError as error:
        _say(error=str(error))
        return 1
    _say(ready=name)
    try:
        return record(directory, name, source, camera.fps)
    except (TautwaveError, OSError) as error:
        _say(error=str(error))
        return 1
    finally:
        source.close()


def record(directory: Path, name: str, source: V4l2 | Synthetic, fps: float) -> int:
    """Wait for the run's first slot, then write every picture; tell how many."""
    run = begun(directory, MonotonicClock(), PATIENCE_S)
    seen: list[Frame] = []
    while not run.tap.begun_ns:
        frame = source.read(LOOK_S)
        if frame is not None:  # the first slot may come while it is waited for
            seen = [*seen[-1:], frame]
        if run.ended or os.getppid() == 1:
            return 0
    if seen and seen[-1].time_ns <= run.tap.begun_ns:
        del seen[:-1]  # the newest of before is what the first slot saw
    file = CameraFile(
        directory / FILE.format(name=name), name, fps, run.tap.epoch_ns, run.tap.begun_ns
    )
    count = lost = by_kernel = 0
    last = -1
    error = ""
    while not run.ended:
        for frame in seen:
            lost += max(0, frame.number - last - 1) if last >= 0 else 0
            last = frame.number
            file.add(frame.time_ns, frame.jpeg, count)
            count += 1
            by_kernel += frame.by_kernel
        try:
            frame = source.read(LOOK_S)
            seen = [] if frame is None else [frame]
        except RecordingError as gone:
            error = str(gone)
            break
    file.close()
    timed = "kernel" if count and by_kernel == count else "process"
    _say(frames=count, lost=lost, timed_by=timed, **({"error": error} if error else {}))
    return 0


def _say(**fields: object) -> None:
    with suppress(OSError):
        os.write(1, json.dumps(fields).encode() + b"\n")


if __name__ == "__main__":
    sys.exit(main())
