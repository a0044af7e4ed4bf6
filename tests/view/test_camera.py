"""Cameras beside a run: the kernel's protocol, the pictures' times, files that others read."""

from __future__ import annotations

import errno
import io
import os
import signal
import struct
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from rosbags.typesys import Stores, get_typestore

from tautwave.config import load_rig
from tautwave.config.keys.devices import Camera
from tautwave.errors import ConfigError, RecordingError
from tautwave.recordings.cameras import FILE, jpeg_in, pictures
from tautwave.session.running import run as run_rig
from tautwave.summary.model import Camera as Pictures
from tautwave.view.camera import v4l2
from tautwave.view.camera.__main__ import record
from tautwave.view.camera.file import CameraFile, compressed_image
from tautwave.view.camera.synthetic import Synthetic
from tautwave.view.camera.v4l2 import V4l2
from tests.view.served import BENCH, Run

pytestmark = pytest.mark.realtime

SMALL = Camera(driver="v4l2", width=32, height=16, fps=100.0)


class Memory(bytearray):
    closed = False

    def close(self) -> None:
        self.closed = True


class Device:
    """A camera as the kernel documents it: a buffer is filled only while it is queued."""

    def __init__(
        self, fourcc: bytes = b"MJPG", flags: int = 0x2000, capabilities: int = 0x85200001
    ):
        self.fourcc, self.flags, self.capabilities = fourcc, flags, capabilities
        self.width, self.height = 32, 16
        self.maps: list[Memory] = []
        self.queued: list[int] = []
        self.streams, self.opened, self.sequence = False, False, 0
        self.pictures: list[bytes] = []
        self.gone = False
        self.colours = (7, 0)  # those of a JPEG

    def open(self, path: str) -> int:
        self.opened = True
        return 5

    def close(self, descriptor: int) -> None:
        self.opened = False

    def map(self, descriptor: int, length: int, offset: int) -> Memory:
        assert offset == 4096 * len(self.maps)
        self.maps.append(Memory(length))
        return self.maps[-1]

    def wait(self, descriptor: int, seconds: float) -> bool:
        return bool(self.pictures and self.queued) or self.gone

    def ioctl(self, descriptor: int, code: int, block: bytearray) -> None:
        assert len(block) == code >> 16 & 0x3FFF, "the size is part of the code"
        if self.gone:
            raise OSError(errno.ENODEV, "No such device")
        kind = code & 0xFF
        if kind in (9, 15, 17):  # of a buffer it is said which one, of what kind, and where
            kinds = *struct.unpack_from("<4xI", block), *struct.unpack_from("<60xI", block)
            assert kinds == (1, 1), "a picture, in memory that the kernel maps"
            assert not any(block[8:60] + block[64:]), "what is not used yet has to be zero"
        if kind == 0:
            struct.pack_into("<II", block, 84, self.capabilities, 0x04200001)
        elif kind == 5:
            struct.pack_into("<II4sIII", block, 8, self.width, self.height, self.fourcc, 1,
                             2 * self.width + 8, 4096)  # fmt: skip
            struct.pack_into("<I", block, 8 + 24, self.colours[0])
            struct.pack_into("<I", block, 8 + 40, self.colours[1])
        elif kind == 8:
            struct.pack_into("<I", block, 0, 3)  # fewer than were asked for
        elif kind == 9:
            (index,) = struct.unpack_from("<I", block)
            struct.pack_into("<I", block, 64, 4096 * index)
            struct.pack_into("<I", block, 72, 4096)
        elif kind == 15:
            (index,) = struct.unpack_from("<I", block)
            assert index not in self.queued
            self.queued.append(index)
        elif kind == 17:
            if not (self.streams and self.queued and self.pictures):
                raise BlockingIOError(errno.EAGAIN, "Resource temporarily unavailable")
            index, data = self.queued.pop(0), self.pictures.pop(0)
            self.maps[index][: len(data)] = data
            struct.pack_into("<III", block, 0, index, 1, len(data))
            struct.pack_into("<I", block, 12, self.flags)
            struct.pack_into("<qq", block, 24, 7, 250_000)
            struct.pack_into("<I", block, 56, self.sequence)
            self.sequence += 1
        elif kind in (18, 19):
            self.streams = kind == 18


def test_pictures_come_with_the_kernel_s_time_and_buffers_go_round() -> None:
    device = Device()
    camera = V4l2(SMALL, device)
    assert camera.read(0.0) is None
    device.pictures = [b"one", b"two", b"three", b"four"]
    frames = [camera.read(0.0) for _ in range(4)]
    assert [frame and frame.jpeg for frame in frames] == [b"one", b"two", b"three", b"four"]
    assert [frame and frame.number for frame in frames] == [0, 1, 2, 3]
    assert {frame and frame.time_ns for frame in frames} == {7_250_000_000}
    assert sorted(device.queued) == [0, 1, 2]
    camera.close()
    assert not device.streams
    assert not device.opened
    assert all(one.closed for one in device.maps)


def test_without_the_kernel_s_time_the_process_takes_it_and_broken_pictures_are_none() -> None:
    device = Device(flags=0)
    camera = V4l2(SMALL, device)
    device.pictures = [b"one"]
    before = time.monotonic_ns()
    frame = camera.read(0.0)
    assert frame is not None
    assert before <= frame.time_ns <= time.monotonic_ns()
    assert not frame.by_kernel
    device.flags, device.pictures = v4l2.BROKEN, [b"half"]
    assert camera.read(0.0) is None
    assert sorted(device.queued) == [0, 1, 2]
    device.gone = True
    with pytest.raises(RecordingError, match="/dev/video0: was disconnected"):
        camera.read(0.0)
    camera.close()


@pytest.mark.parametrize(
    ("colours", "yuv", "rgb"),
    [
        ((7, 0), (76, 85, 255), (254, 0, 0)),  # full range, by its colours
        ((8, 1), (76, 85, 255), (254, 0, 0)),  # by what it says
        ((8, 0), (82, 90, 240), (255, 0, 0)),  # BT.601 as televisions have it, by default
        ((8, 2), (235, 128, 128), (255, 255, 255)),
        ((7, 2), (16, 128, 128), (0, 0, 0)),
    ],
)
def test_yuyv_becomes_jpeg_in_its_colours(
    colours: tuple[int, int], yuv: tuple[int, int, int], rgb: tuple[int, int, int]
) -> None:
    device = Device(b"YUYV")
    device.colours = colours
    camera = V4l2(SMALL, device)
    luma, blue, red = yuv
    line = bytes([luma, blue, luma, red]) * 16
    device.pictures = [(line + bytes(8)) * 16, line]  # a line is longer than its pixels
    frame = camera.read(0.0)
    assert frame is not None
    seen = np.asarray(Image.open(io.BytesIO(frame.jpeg)).convert("RGB"), float)
    assert seen.shape == (16, 32, 3)
    assert np.abs(seen - rgb).max() < 6
    assert camera.read(0.0) is None  # half a picture


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"capabilities": 0x80000000 | 1}, None),
        ({"capabilities": 0x1}, "is not a streaming camera"),
        ({"fourcc": b"H264"}, "neither MJPEG nor YUYV"),
        ({"width": 64}, "delivers 64 x 16 pixels instead of 32 x 16"),
    ],
)
def test_what_is_no_usable_camera_is_one_sentence(
    changes: dict[str, Any], text: str | None
) -> None:
    device = Device()
    for name, value in changes.items():
        setattr(device, name, value)
    if text is None:
        V4l2(SMALL, device).close()  # the device's own capabilities count
        return
    with pytest.raises(ConfigError, match=text):
        V4l2(SMALL, device)
    assert not device.opened


def test_a_camera_that_is_not_there_is_one_sentence() -> None:
    with pytest.raises(ConfigError, match="/dev/video-none: cannot be opened"):
        V4l2(Camera(device="/dev/video-none"))


@pytest.mark.parametrize("name", ["a", "wrist", "left_hand"])
@pytest.mark.parametrize("length", [0, 1, 6, 7])
def test_messages_are_those_of_rosbags(name: str, length: int) -> None:
    store = get_typestore(Stores.ROS2_JAZZY)
    jpeg, kind = bytes(range(length)), "sensor_msgs/msg/CompressedImage"
    ours = compressed_image(1_700_000_000_250_000_000, name, jpeg)
    found: Any = store.deserialize_cdr(ours, kind)
    assert (found.header.stamp.sec, found.header.stamp.nanosec) == (1_700_000_000, 250_000_000)
    assert (found.header.frame_id, found.format, found.data.tobytes()) == (name, "jpeg", jpeg)
    theirs = bytes(store.serialize_cdr(found, kind))
    assert theirs.ljust(-(-len(theirs) // 4) * 4, b"\0") == ours.ljust(
        -(-len(ours) // 4) * 4, b"\0"
    )
    assert jpeg_in(ours) == jpeg


def test_a_file_that_was_cut_off_gives_its_whole_pictures(tmp_path: Path) -> None:
    file = CameraFile(tmp_path / FILE.format(name="c"), "c", 30.0, 5_000_000_000, 2_000_000_000)
    for k in range(20):
        file.add(2_000_000_000 + 10_000_000 * k, bytes([k]) * 100_000, k)
    file.close()
    whole = list(pictures(tmp_path, "c"))
    assert [round(one.time_s, 9) for one in whole] == [0.01 * k for k in range(20)]
    path = tmp_path / FILE.format(name="c")
    path.write_bytes(path.read_bytes()[:1_000_000])
    kept = list(pictures(tmp_path, "c"))
    assert 3 <= len(kept) < 10
    assert kept == whole[: len(kept)]


@pytest.mark.nightly
@pytest.mark.slow
def test_a_killed_camera_costs_the_run_its_pictures_only(tmp_path: Path) -> None:
    rig = load_rig(BENCH, ["cameras={c: {driver: synthetic, width: 32, height: 16, fps: 100}}"])
    threading.Thread(target=_kill_when_it_writes, args=(tmp_path / FILE.format(name="c"),)).start()
    done = run_rig(rig, out=tmp_path, duration_s=1.5, simulate=True)
    assert done.exit_code == 0
    assert done.summary.recording.rows_dropped == 0
    assert done.summary.recording.rows_written == done.summary.cycles
    assert done.summary.cameras == {"c": Pictures(error="its process ended before the run")}


def _kill_when_it_writes(path: Path) -> None:
    while not path.exists():
        time.sleep(0.01)
    time.sleep(0.3)
    for one in Path("/proc").glob("[0-9]*/cmdline"):
        with suppress(OSError):
            words = one.read_bytes().split(b"\0")
            if b"tautwave.view.camera" in words and str(path.parent).encode() in words:
                os.kill(int(one.parent.name), signal.SIGKILL)


@pytest.mark.slow
def test_without_its_camera_nothing_moves(tmp_path: Path) -> None:
    rig = load_rig(BENCH, ["cameras={c: {device: /dev/video-none}}"])
    with pytest.raises(ConfigError, match=r"cameras.c: /dev/video-none: cannot be opened"):
        run_rig(rig, out=tmp_path / "run", duration_s=0.1, simulate=True)
    assert not (tmp_path / "run").exists()


class Counting(Synthetic):
    """A synthetic camera that counts its pictures."""

    count = 0

    def read(self, seconds: float) -> Any:
        frame = super().read(seconds)
        self.count += frame is not None
        return frame

    def wait_for(self, count: int) -> None:
        until = time.monotonic() + 30.0
        while self.count < count:
            assert time.monotonic() < until, "no picture came"
            time.sleep(0.01)


def test_pictures_beside_a_run_are_at_its_time(tmp_path: Path) -> None:
    run = Run(tmp_path)
    camera = Counting(Camera(driver="synthetic", width=160, height=16, fps=50.0))
    said: list[int] = []
    thread = threading.Thread(target=lambda: said.append(record(tmp_path, "wrist", camera, 50.0)))
    thread.start()
    camera.wait_for(1)  # a busy machine brings its first picture late
    begun_ns = time.monotonic_ns()
    run.recorder.begin(begun_ns)
    run.commit(3)
    camera.wait_for(camera.count + 8)
    run.close()
    thread.join(20)
    assert said == [0]
    found = list(pictures(tmp_path, "wrist"))
    assert len(found) >= 5
    assert found[0].time_s <= 0.0 < found[-1].time_s  # the first slot has a picture, too
    for picture in found:
        seen = np.asarray(Image.open(io.BytesIO(picture.jpeg)).convert("L"))[8]
        left = round(begun_ns + 1e9 * picture.time_s) % 10**9 * 160 // 10**9
        assert seen[left] > 128
        assert left == 0 or seen[left - 1] < 128 or left + 10 > 160
