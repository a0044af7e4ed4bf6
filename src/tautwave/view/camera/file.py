"""Pictures as an MCAP file of `sensor_msgs/CompressedImage`, as Foxglove and `ros2 bag` read it."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import IO, Any

from mcap.writer import CompressionType, Writer

from tautwave.files import writing
from tautwave.recordings.cameras import METADATA, SCHEMA, TOPIC

CHUNK_BYTES = 256 * 1024
"""So much may be lost when the process is killed."""
DEFINITION = f"""std_msgs/Header header
string format
uint8[] data
{"=" * 80}
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
{"=" * 80}
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""


class CameraFile:
    """A file being written; the pictures' times are those of the recording beside it.

    Parameters
    ----------
    path : Path
        The new file.
    name : str
        Of the camera.
    fps : float
        Pictures a second that were asked for.
    epoch_ns, begun_ns : int
        The run's first slot: Unix time and CLOCK_MONOTONIC [ns].
    """

    def __init__(self, path: Path, name: str, fps: float, epoch_ns: int, begun_ns: int) -> None:
        self._name = name
        self._shift_ns = epoch_ns - begun_ns
        with writing(path):
            self._file: IO[Any] = open(path, "wb")  # noqa: SIM115 - closed by `close`
        self._writer = Writer(self._file, CHUNK_BYTES, CompressionType.NONE)
        self._writer.start(profile="ros2", library="tautwave")
        self._writer.add_metadata(METADATA, {"epoch_ns": str(epoch_ns), "fps": repr(fps)})
        schema = self._writer.register_schema(SCHEMA, "ros2msg", DEFINITION.encode())
        topic = TOPIC.format(name=name)
        self._channel = self._writer.register_channel(topic, "cdr", schema)

    def add(self, time_ns: int, jpeg: bytes, number: int) -> None:
        """Write a picture; `time_ns` by CLOCK_MONOTONIC."""
        at = time_ns + self._shift_ns
        message = compressed_image(at, self._name, jpeg)
        self._writer.add_message(self._channel, at, message, at, number)

    def close(self) -> None:
        """Complete the file."""
        self._writer.finish()  # type: ignore[no-untyped-call]
        self._file.close()


def compressed_image(at_ns: int, frame: str, jpeg: bytes) -> bytes:
    """Return a `sensor_msgs/CompressedImage` as CDR."""
    body = struct.pack("<iI", *divmod(at_ns, 1_000_000_000))
    for text in (frame, "jpeg"):
        encoded = text.encode() + b"\0"
        body += bytes(-len(body) % 4) + struct.pack("<I", len(encoded)) + encoded
    return b"\0\1\0\0" + body + bytes(-len(body) % 4) + struct.pack("<I", len(jpeg)) + jpeg
