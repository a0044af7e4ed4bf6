"""Pictures of cameras in a LeRobot dataset: one video a camera, frame by frame with the rows.

A frame has the newest picture not after it. One that is older than three of its camera's periods is
missing, as a sample is: a picture that stands would be invented.
"""

from __future__ import annotations

import importlib
import io
from collections.abc import Iterator, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.errors import ConfigError, RecordingError
from tautwave.files import make_directory, writing
from tautwave.recordings.cameras import Picture, camera_fps, pictures

PERIODS = 3.0
BEGIN, END = b"\xff\xd8", b"\xff\xd9"
CODEC, PIXELS = "h264", "yuv420p"
SAMPLED, THINNED = 100, 8
"""Pictures of an episode for its statistics, and every which of their lines and columns."""
CHUNK = 1000
"""Files in a folder."""
VIDEO = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"


class Camera(NamedTuple):
    """What a camera left beside a run: times [s], rising, and how old a picture may be [s]."""

    directory: Path
    name: str
    times: npt.NDArray[np.float64]
    oldest_s: float

    @classmethod
    def of_run(cls, directory: Path, name: str) -> Camera:
        """Read the times of its pictures."""
        times = np.array([one.time_s for one in _whole(directory, name)])
        return cls(directory, name, times, PERIODS / camera_fps(directory, name))

    def numbers(self, at_s: npt.NDArray[np.float64]) -> npt.NDArray[np.intp]:
        """Return the picture of each frame, -1 where there is none."""
        newest: npt.NDArray[np.intp] = np.searchsorted(self.times, at_s + 1e-9, side="right") - 1
        if not len(self.times):
            return newest
        fresh = (newest >= 0) & (at_s - self.times[newest] <= self.oldest_s)
        return np.where(fresh, newest, -1)

    def jpegs(self, numbers: Sequence[int]) -> Iterator[bytes]:
        """Give the pictures of these numbers, which rise."""
        numbered = enumerate(_whole(self.directory, self.name))
        at, jpeg = -1, b""
        for number in numbers:
            while at < number:
                at, picture = next(numbered)
                jpeg = picture.jpeg
            yield jpeg


class Video:
    """A video being written; `info` is its feature, `frames` how many it has.

    Parameters
    ----------
    root : Path
        Of the dataset.
    key : str
        Of the feature, such as `observation.images.wrist`.
    fps : int
        Frames a second.
    file : int
        Its number: a dataset that goes on has others before it.
    """

    def __init__(self, root: Path, key: str, fps: int, file: int = 0) -> None:
        self._av: Any = _pyav()
        self.key, self.fps, self.frames, self.file = key, fps, 0, file
        chunk, index = divmod(file, CHUNK)
        self._path = root / VIDEO.format(video_key=key, chunk_index=chunk, file_index=index)
        self._container: Any = None
        self._stream: Any = None
        self._all: list[npt.NDArray[np.uint8]] = []

    def add(self, jpegs: Iterator[bytes], count: int) -> dict[str, Any]:
        """Append an episode of `count` frames, and return the statistics of its pictures."""
        every = max(1, count // SAMPLED)
        seen = []
        for number, jpeg in enumerate(jpegs):
            picture = _decoded(jpeg, self.key)
            self._open(picture)
            if number % every == 0:
                seen.append(picture[::THINNED, ::THINNED])
            with writing(self._path):
                self._encode(picture)
        self.frames += count
        some = np.stack(seen)
        self._all.append(some)
        return picture_statistics(some)

    def _open(self, picture: npt.NDArray[np.uint8]) -> None:
        """Begin with the first picture; refuse one of another size."""
        height, width, _ = picture.shape
        if self._container is None:
            make_directory(self._path.parent)
            with writing(self._path):
                self._container = self._av.open(str(self._path), "w")
            # Key frames are dense, so that training may begin anywhere.
            options = {"g": "2", "crf": "23"}
            self._stream = self._container.add_stream(CODEC, rate=self.fps, options=options)
            self._stream.width, self._stream.height = width, height
            self._stream.pix_fmt = PIXELS
            self._stream.time_base = Fraction(1, self.fps)
        if (width, height) != (self._stream.width, self._stream.height):
            raise RecordingError(f"{self.key}: its pictures differ in size; a dataset has one")

    def _encode(self, picture: npt.NDArray[np.uint8]) -> None:
        frame = self._av.VideoFrame.from_ndarray(picture, format="rgb24")
        self._container.mux(self._stream.encode(frame))

    def feature(self) -> dict[str, Any]:
        """Return what `info.json` says of it."""
        height, width = self._stream.height, self._stream.width
        return {
            "dtype": "video",
            "shape": [height, width, 3],
            "names": ["height", "width", "channels"],
            "info": {
                "video.height": height, "video.width": width, "video.codec": CODEC,
                "video.pix_fmt": PIXELS, "video.is_depth_map": False, "video.fps": self.fps,
                "video.channels": 3, "has_audio": False,
            },
        }  # fmt: skip

    def close(self) -> dict[str, Any]:
        """Complete the file, and return the statistics of all."""
        with writing(self._path):
            self._container.mux(self._stream.encode(None))
            self._container.close()
        return picture_statistics(np.concatenate(self._all))


def picture_statistics(some: npt.NDArray[np.uint8]) -> dict[str, Any]:
    """Return statistics by channel, shape (3, 1, 1), of n pictures, shape (n, h, w, 3)."""
    table = some.reshape(-1, 3) / 255.0  # as LeRobot reads them
    levels = np.quantile(table, (0.01, 0.1, 0.5, 0.9, 0.99), axis=0)
    statistics = {"min": table.min(axis=0), "max": table.max(axis=0),
             "mean": table.mean(axis=0), "std": table.std(axis=0),
             **dict(zip(("q01", "q10", "q50", "q90", "q99"), levels, strict=True))}  # fmt: skip
    shaped = {name: value.reshape(3, 1, 1).tolist() for name, value in statistics.items()}
    return {**shaped, "count": [len(some)]}


def _whole(directory: Path, name: str) -> Iterator[Picture]:
    """Give the pictures that begin and end as a JPEG does; cameras send some that are cut off."""
    for one in pictures(directory, name):
        if one.jpeg.startswith(BEGIN) and one.jpeg.rstrip(b"\0").endswith(END):
            yield one


def _decoded(jpeg: bytes, key: str) -> npt.NDArray[np.uint8]:
    from PIL import Image

    try:
        return np.asarray(Image.open(io.BytesIO(jpeg)).convert("RGB"))
    except OSError as err:
        raise RecordingError(
            f"{key}: a picture is damaged ({err}); --no-video leaves the camera out"
        ) from err


def _pyav() -> Any:
    try:
        return importlib.import_module("av")
    except ImportError as err:
        raise ConfigError(
            "the run has cameras, whose videos need PyAV: pip install 'tautwave[video]', or"
            " --no-video"
        ) from err
