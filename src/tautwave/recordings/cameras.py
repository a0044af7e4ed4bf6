"""The pictures that cameras left beside a recording."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from tautwave.errors import RecordingError

METADATA = "tautwave camera"
SCHEMA = "sensor_msgs/msg/CompressedImage"
TOPIC = "/camera/{name}/compressed"
FILE = "camera-{name}.mcap"


class Picture(NamedTuple):
    """A JPEG, and its time [s] in the run: that of the column `time_s`."""

    time_s: float
    jpeg: bytes


def pictures(directory: Path, name: str) -> Iterator[Picture]:
    """Give a camera's pictures in their order; those that are whole, of a file that was cut off.

    Raises
    ------
    RecordingError
        There is no such file.
    """
    from mcap.exceptions import McapError
    from mcap.records import Message, Metadata
    from mcap.stream_reader import StreamReader

    path = directory / FILE.format(name=name)
    epoch_ns = 0
    try:
        with open(path, "rb") as file:
            for record in StreamReader(file).records:
                if isinstance(record, Metadata) and record.name == METADATA:
                    epoch_ns = int(record.metadata["epoch_ns"])
                if isinstance(record, Message):
                    yield Picture((record.log_time - epoch_ns) * 1e-9, jpeg_in(record.data))
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
