"""The pictures that cameras left beside a recording."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from tautwave.errors import RecordingError
from tautwave.reading import open_file
from tautwave.recordings import RUN

METADATA = "tautwave camera"
SCHEMA = "sensor_msgs/msg/CompressedImage"
TOPIC = "/camera/{name}/compressed"
FILE = "camera-{name}.mcap"


class Picture(NamedTuple):
    """A JPEG, and its time [s] in the run: that of the column `time_s`."""

    time_s: float
    jpeg: bytes


def camera_names(directory: Path) -> tuple[str, ...]:
    """Return the cameras of a run, by their files."""
    files = directory.glob(FILE.format(name="*"))
    return tuple(sorted(path.stem.removeprefix("camera-") for path in files))


def refuse_others(directory: Path, first_s: float) -> None:
    """Refuse pictures that another run left in the same directory.

    Parameters
    ----------
    directory : Path
        Of the run.
    first_s : float
        `time_s` of its first row.

    Raises
    ------
    RecordingError
        A camera's time zero is not that of the recording.
    """
    from mcap.records import Message

    names = camera_names(directory)
    if not names:
        return
    rows = (one.log_time for one in _records(directory / RUN) if isinstance(one, Message))
    epoch_ns = next(rows, 0) - round(1e9 * first_s)
    for name in names:
        path = directory / FILE.format(name=name)
        if int(_said(path)["epoch_ns"]) != epoch_ns:
            raise RecordingError(
                f"{path}: its pictures are from a different run than {RUN} next to it; move it "
                "away, or export with --no-video"
            )


def camera_fps(directory: Path, name: str) -> float:
    """Return the rate that was asked for [Hz]; RecordingError where the file does not say."""
    return float(_said(directory / FILE.format(name=name))["fps"])


def _said(path: Path) -> dict[str, str]:
    """Return what the file says of its camera."""
    from mcap.records import Metadata

    for record in _records(path):
        if isinstance(record, Metadata) and record.name == METADATA:
            return record.metadata
    raise RecordingError(f"{path}: it holds no camera")


def pictures(directory: Path, name: str) -> Iterator[Picture]:
    """Give a camera's pictures in their order; those that are whole, of a file that was cut off.

    Raises
    ------
    RecordingError
        There is no such file.
    """
    from mcap.records import Message, Metadata

    epoch_ns = 0
    for record in _records(directory / FILE.format(name=name)):
        if isinstance(record, Metadata) and record.name == METADATA:
            epoch_ns = int(record.metadata["epoch_ns"])
        if isinstance(record, Message):
            yield Picture((record.log_time - epoch_ns) * 1e-9, jpeg_in(record.data))


def _records(path: Path) -> Iterator[Any]:
    from mcap.exceptions import McapError
    from mcap.stream_reader import StreamReader

    try:
        with open_file(path) as file:
            yield from StreamReader(file).records
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read ({error.strerror})") from error
    except (McapError, EOFError, struct.error):  # its process was killed
        return


def jpeg_in(message: bytes) -> bytes:
    """Return the picture in a `sensor_msgs/CompressedImage`."""
    at = 12
    for _ in range(2):
        at += -at % 4
        at += 4 + int(struct.unpack_from("<I", message, at)[0])
    at += -at % 4
    (length,) = struct.unpack_from("<I", message, at)
    return message[at + 4 : at + 4 + length]
