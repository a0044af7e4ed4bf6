"""A camera of Video4Linux: buffers that the kernel shares, one ioctl a step.

Source: the kernel's uAPI, `linux/videodev2.h`, on 64-bit machines.
"""

from __future__ import annotations

import fcntl
import io
import mmap
import os
import select
import struct
import time
from contextlib import suppress
from typing import Any, NamedTuple, Protocol

import numpy as np

from tautwave.config.keys.devices import Camera
from tautwave.errors import ConfigError, RecordingError

QUERYCAP, S_FMT, REQBUFS, QUERYBUF, QBUF, DQBUF = (
    0x80685600, 0xC0D05605, 0xC0145608, 0xC0585609, 0xC058560F, 0xC0585611,
)  # fmt: skip
STREAMON, STREAMOFF, S_PARM = 0x40045612, 0x40045613, 0xC0CC5616
CAPTURE, MMAP, ANY_FIELD = 1, 1, 0
CAN_CAPTURE, CAN_STREAM, HAS_DEVICE_CAPS = 0x1, 0x04000000, 0x80000000
BROKEN, CLOCK_MASK, MONOTONIC = 0x40, 0xE000, 0x2000
MJPEG, YUYV = b"MJPG", b"YUYV"
BUFFERS = 4
FORMAT = struct.Struct("<I4xII4sIIII4x4x4xI156x")
JPEG_COLOURS, FULL_RANGE = 7, 1
BUFFER = struct.Struct("<IIIII4xqq16xIIIIIII4x")
QUALITY = 90
LUMA, CHROMA = (
    np.clip(np.rint((np.arange(256) - zero) * 255.0 / span + to), 0, 255).astype(np.uint8)
    for zero, span, to in ((16, 219, 0), (128, 224, 128))
)
"""From BT.601's limited range to the full one of a JPEG."""


class Frame(NamedTuple):
    """A picture: time by CLOCK_MONOTONIC [ns], JPEG, number, and whether the kernel timed it."""

    time_ns: int
    jpeg: bytes
    number: int
    by_kernel: bool


class Kernel(Protocol):
    """What is asked of the machine."""

    def open(self, path: str) -> int:
        """Open a device."""

    def ioctl(self, descriptor: int, code: int, block: bytearray) -> None:
        """Ask for something; the answer is in the block. Raises OSError."""

    def map(self, descriptor: int, length: int, offset: int) -> Any:
        """Return the memory of a buffer."""

    def wait(self, descriptor: int, seconds: float) -> bool:
        """Return whether a buffer has been filled in that time."""

    def close(self, descriptor: int) -> None:
        """Close a device."""


class Machine:
    """The kernel that runs this."""

    def open(self, path: str) -> int:
        """Open a device."""
        return os.open(path, os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)

    def ioctl(self, descriptor: int, code: int, block: bytearray) -> None:
        """Ask for something; the answer is in the block."""
        fcntl.ioctl(descriptor, code, block, True)

    def map(self, descriptor: int, length: int, offset: int) -> mmap.mmap:
        """Return the memory of a buffer."""
        return mmap.mmap(descriptor, length, mmap.MAP_SHARED, offset=offset)

    def wait(self, descriptor: int, seconds: float) -> bool:
        """Return whether a buffer has been filled in that time."""
        return bool(select.select([descriptor], [], [], seconds)[0])

    def close(self, descriptor: int) -> None:
        """Close a device."""
        os.close(descriptor)


class V4l2:
    """A camera that streams.

    Parameters
    ----------
    camera : Camera
        Its keys.
    kernel : Kernel, optional
        This machine's by default.

    Raises
    ------
    ConfigError
        It cannot be opened, is no camera, or gives no picture that is understood.
    """

    def __init__(self, camera: Camera, kernel: Kernel | None = None) -> None:
        self._kernel = kernel or Machine()
        self._where = camera.device
        try:
            self._descriptor = self._kernel.open(camera.device)
        except OSError as error:
            raise ConfigError(f"{camera.device}: cannot be opened ({error.strerror})") from error
        try:
            self._begin(camera)
        except OSError as error:
            self._kernel.close(self._descriptor)
            raise ConfigError(
                f"{camera.device}: does not stream as a camera ({error.strerror})"
            ) from error
        except ConfigError:
            self._kernel.close(self._descriptor)
            raise

    def _ask(self, code: int, block: bytes) -> bytearray:
        answer = bytearray(block)
        self._kernel.ioctl(self._descriptor, code, answer)
        return answer

    def _begin(self, camera: Camera) -> None:
        capability = self._ask(QUERYCAP, bytes(104))
        can, own = struct.unpack_from("<II", capability, 84)
        can = own if can & HAS_DEVICE_CAPS else can
        if not (can & CAN_CAPTURE and can & CAN_STREAM):
            raise ConfigError(
                f"{camera.device}: is not a streaming camera; see v4l2-ctl --list-devices"
            )
        for wanted in (MJPEG, YUYV):
            block = FORMAT.pack(CAPTURE, camera.width, camera.height, wanted, ANY_FIELD, 0, 0, 0, 0)
            answer = FORMAT.unpack(self._ask(S_FMT, block))
            _, self.width, self.height, self.format, _, self._stride, _, colours, quantum = answer
            if self.format == wanted:
                break
        if self.format not in (MJPEG, YUYV):
            raise ConfigError(f"{camera.device}: supports neither MJPEG nor YUYV")
        # Others leave room below black and above white (`V4L2_QUANTIZATION_LIM_RANGE`).
        self._full = quantum == FULL_RANGE or (quantum == 0 and colours == JPEG_COLOURS)
        if (self.width, self.height) != (camera.width, camera.height):
            raise ConfigError(
                f"{camera.device}: delivers {self.width} x {self.height} pixels instead of "
                f"{camera.width} x {camera.height}; use these"
            )
        parm = struct.pack("<IIIII184x", CAPTURE, 0, 0, 1000, round(1000 * camera.fps))
        with suppress(OSError):  # some devices have one rate
            self._ask(S_PARM, parm)
        count, *_ = struct.unpack_from(
            "<I", self._ask(REQBUFS, struct.pack("<III8x", BUFFERS, CAPTURE, MMAP))
        )
        self._maps = []
        for index in range(count):
            given = self._ask(QUERYBUF, self._buffer(index))
            fields = BUFFER.unpack(given)
            offset, length = fields[9], fields[11]
            self._maps.append(self._kernel.map(self._descriptor, length, offset))
            self._ask(QBUF, self._buffer(index))
        self._ask(STREAMON, struct.pack("<i", CAPTURE))

    def _buffer(self, index: int) -> bytes:
        return BUFFER.pack(index, CAPTURE, 0, 0, 0, 0, 0, 0, MMAP, 0, 0, 0, 0, 0)

    def read(self, seconds: float) -> Frame | None:
        """Return the next picture, None if none came in that time or it is broken.

        Raises
        ------
        RecordingError
            The camera has gone.
        """
        try:
            if not self._kernel.wait(self._descriptor, seconds):
                return None
            given = self._ask(DQBUF, self._buffer(0))
            now = time.monotonic_ns()
            index, _, used, flags, _, sec, usec, number, *_ = BUFFER.unpack(given)
            data = bytes(self._maps[index][:used])
            self._ask(QBUF, self._buffer(index))
        except BlockingIOError:
            return None
        except OSError as error:
            raise RecordingError(f"{self._where}: was disconnected ({error.strerror})") from error
        least = 1 if self.format == MJPEG else self.height * self._stride
        if flags & BROKEN or len(data) < least:
            return None
        kernel = flags & CLOCK_MASK == MONOTONIC
        at = sec * 1_000_000_000 + usec * 1000 if kernel else now
        return Frame(at, data if self.format == MJPEG else self._jpeg(data), number, kernel)

    def _jpeg(self, data: bytes) -> bytes:
        lines = np.frombuffer(data, np.uint8, self.height * self._stride)
        pairs = lines.reshape(self.height, self._stride)[:, : 2 * self.width]
        if not self._full:
            pairs = np.where(np.arange(2 * self.width) % 2, CHROMA[pairs], LUMA[pairs])
        pairs = pairs.reshape(self.height, self.width // 2, 4)
        picture = np.empty((self.height, self.width, 3), np.uint8)
        picture[..., 0] = pairs[..., ::2].reshape(self.height, self.width)
        picture[..., 1] = pairs[..., 1].repeat(2, axis=1)
        picture[..., 2] = pairs[..., 3].repeat(2, axis=1)
        return jpeg_of(picture, "YCbCr")

    def close(self) -> None:
        """Stop the stream."""
        with suppress(OSError):  # it was unplugged
            self._ask(STREAMOFF, struct.pack("<i", CAPTURE))
        for one in self._maps:
            one.close()
        self._kernel.close(self._descriptor)


def jpeg_of(picture: Any, mode: str) -> bytes:
    """Return an array (height, width, 3) of bytes as JPEG."""
    from PIL import Image

    packed = io.BytesIO()
    height, width, _ = picture.shape
    Image.frombytes(mode, (width, height), picture.tobytes()).save(packed, "JPEG", quality=QUALITY)
    return packed.getvalue()
