"""The files of a LeRobot dataset, format v3.0."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.files import make_directory, write_text, writing
from tautwave.report.export.lerobot_resume import (
    EPISODE_FILES,
    Before,
    arrow_library,
    refuse_unlike,
    together,
)
from tautwave.report.export.lerobot_video import CHUNK, VIDEO, Video

VERSION = "v3.0"
DATA = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
EPISODES = "meta/episodes/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
LARGEST_MB = 100
"""A data file that has reached this size is followed by another."""
QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}
OWN = {
    "timestamp": "float32", "frame_index": "int64", "episode_index": "int64", "index": "int64",
    "task_index": "int64", "success": "int64",
}  # fmt: skip
INTERVENTION = "intervention"

Floats = npt.NDArray[np.float32]


class Frames(NamedTuple):
    """An episode: values of each feature, shape (frames, signals), and what was done.

    `pictures` are a JPEG for each frame, by camera; `success` is 1, 0 for failed, -1 for none.
    `person`, shape (frames,), says where a person led and no policy; None: everywhere.
    """

    values: Mapping[str, Floats]
    task: str
    pictures: Mapping[str, Iterator[bytes]]
    success: int = -1
    person: npt.NDArray[np.bool_] | None = None


class Dataset:
    """A dataset being written: episode by episode, each a row group.

    Parameters
    ----------
    root : Path
        An empty directory.
    fps : int
        Frames a second.
    robot : str
        Name of the robot.
    names : mapping
        The names of the signals of each feature.
    cameras : sequence of str
        Their names.
    before : Before, optional
        What the directory has already, instead of being empty: numbers, tasks and statistics
        continue, in new files.
    led : bool
        Whether a policy leads in some of the episodes: who does is a feature then.

    Raises
    ------
    ConfigError
        What it has is of another robot, rate, signals or cameras.
    """

    def __init__(
        self,
        root: Path,
        fps: int,
        robot: str,
        names: Mapping[str, Sequence[str]],
        cameras: Sequence[str] = (),
        before: Before | None = None,
        led: bool = False,
    ) -> None:
        self._arrow, self._parquet = arrow_library()
        self._root, self._fps, self._robot = root, fps, robot
        self._led = led or (before is not None and INTERVENTION in before.info["features"])
        own = {**OWN, INTERVENTION: "bool"} if self._led else OWN
        self._features: dict[str, dict[str, Any]] = {
            key: {"dtype": "float32", "shape": [len(each)], "names": list(each)}
            for key, each in names.items()
        } | {key: {"dtype": kind, "shape": [1], "names": None} for key, kind in own.items()}
        file = 0 if before is None else before.video_files
        keys = {name: f"observation.images.{name}" for name in cameras}
        self._videos = {name: Video(root, key, fps, file) for name, key in keys.items()}
        self._schema = self._make_schema()
        self._writer: Any = None
        self._file, self._bytes = 0, 0
        self._tasks: dict[str, int] = {}
        self._rows: list[dict[str, Any]] = []
        self._all: list[Mapping[str, npt.NDArray[Any]]] = []
        self._before = before
        self.frames = self._old_frames = self._old_episodes = 0
        if before is not None:
            refuse_unlike(root, before, fps, robot, self._features, list(keys.values()))
            self._file, self._tasks = before.data_files, dict(before.tasks)
            self._rows, self._all = list(before.rows), [before.values]
            self.frames = self._old_frames = len(before.values["index"])
            self._old_episodes = len(before.rows)

    @property
    def episodes(self) -> int:
        """Episodes written so far, with those that were there before."""
        return len(self._rows)

    @property
    def added(self) -> tuple[int, int]:
        """Episodes and frames that were added."""
        return len(self._rows) - self._old_episodes, self.frames - self._old_frames

    def add(self, episode: Frames) -> None:
        """Write an episode."""
        count, number = len(episode.values["action"]), len(self._rows)
        task = self._tasks.setdefault(episode.task, len(self._tasks))
        frame = np.arange(count)
        data: dict[str, npt.NDArray[Any]] = {
            **episode.values,
            "timestamp": (frame / self._fps).astype(np.float32),
            "frame_index": frame,
            "episode_index": np.full(count, number),
            "index": frame + self.frames,
            "task_index": np.full(count, task),
            "success": np.full(count, episode.success),
        }
        if self._led:
            data[INTERVENTION] = np.ones(count, bool) if episode.person is None else episode.person
        self._write(data)
        chunk, file = divmod(self._file, CHUNK)
        self._rows.append(
            {
                "episode_index": number, "tasks": [episode.task], "length": count,
                "data/chunk_index": chunk, "data/file_index": file,
                "dataset_from_index": self.frames, "dataset_to_index": self.frames + count,
            }
            | {
                f"stats/{key}/{name}": value
                for key, values in data.items() for name, value in statistics(values).items()
            }
            | self._filmed(episode, count)
        )  # fmt: skip
        self._all.append(data)
        self.frames += count

    def _filmed(self, episode: Frames, count: int) -> dict[str, Any]:
        """Append its pictures to the videos, and return what its row says of them."""
        entries: dict[str, Any] = {}
        for name, video in self._videos.items():
            begin = video.frames / self._fps
            stats = video.add(episode.pictures[name], count)
            chunk, file = divmod(video.file, CHUNK)
            where = {"chunk_index": chunk, "file_index": file, "from_timestamp": begin,
                     "to_timestamp": video.frames / self._fps}  # fmt: skip
            entries |= {f"videos/{video.key}/{key}": value for key, value in where.items()}
            entries |= {f"stats/{video.key}/{key}": value for key, value in stats.items()}
        return entries

    def _write(self, data: dict[str, npt.NDArray[Any]]) -> None:
        size = sum(values.nbytes for values in data.values())
        if self._writer is not None and self._bytes + size > LARGEST_MB * 1024 * 1024:
            with writing(self._root):
                self._writer.close()
            self._writer, self._bytes, self._file = None, 0, self._file + 1
        with writing(self._root):
            if self._writer is None:
                chunk, file = divmod(self._file, CHUNK)
                path = self._root / DATA.format(chunk_index=chunk, file_index=file)
                make_directory(path.parent)
                self._writer = self._parquet.ParquetWriter(path, self._schema, compression="snappy")
            columns = [self._column(key, values) for key, values in data.items()]
            table = self._arrow.Table.from_arrays(columns, schema=self._schema)
            self._writer.write_table(table, row_group_size=max(1, len(table)))
        self._bytes += size

    def _column(self, key: str, values: npt.NDArray[Any]) -> Any:
        if values.ndim == 1:
            return self._arrow.array(values, self._schema.field(key).type)
        flat = self._arrow.array(np.ascontiguousarray(values).ravel(), self._arrow.float32())
        return self._arrow.FixedSizeListArray.from_arrays(flat, values.shape[1])

    def _make_schema(self) -> Any:
        arrow = self._arrow
        fields, features = [], {}
        for key, feature in self._features.items():
            value = {"dtype": feature["dtype"], "_type": "Value"}
            plain = arrow.type_for_alias(feature["dtype"])
            if feature["names"] is None:
                fields.append(arrow.field(key, plain))
                features[key] = value
            else:
                length = feature["shape"][0]
                fields.append(arrow.field(key, arrow.list_(plain, length)))
                features[key] = {"feature": value, "length": length, "_type": "List"}
        note = json.dumps({"info": {"features": features}})
        return arrow.schema(fields, {"huggingface": note})

    def close(self) -> None:
        """Write what stands about all episodes."""
        if self._writer is not None:
            with writing(self._root):
                self._writer.close()
        meta = self._root / "meta"
        make_directory(meta)
        whole = {key: np.concatenate([one[key] for one in self._all]) for key in self._features}
        stats: dict[str, Any] = {key: statistics(values) for key, values in whole.items()}
        for video in self._videos.values():
            old = () if self._before is None else (self._before.stats[video.key],)
            stats[video.key] = together([*old, video.close()])
        write_text(meta / "stats.json", json.dumps(stats, indent=4))
        write_text(meta / "info.json", json.dumps(self._info(), indent=4))
        with writing(meta):
            self._parquet.write_table(self._task_table(), meta / "tasks.parquet")
            for old_file in self._root.glob(EPISODE_FILES):
                old_file.unlink()
            path = self._root / EPISODES.format(chunk_index=0, file_index=0)
            make_directory(path.parent)
            rows = [row | {"meta/episodes/chunk_index": 0, "meta/episodes/file_index": 0}
                    for row in self._rows]  # fmt: skip
            self._parquet.write_table(self._arrow.Table.from_pylist(rows), path)

    def _info(self) -> dict[str, Any]:
        return {
            "codebase_version": VERSION,
            "robot_type": self._robot,
            "total_episodes": len(self._rows),
            "total_frames": self.frames,
            "total_tasks": len(self._tasks),
            "chunks_size": CHUNK,
            "data_files_size_in_mb": LARGEST_MB,
            "video_files_size_in_mb": 200,
            "fps": self._fps,
            "splits": {"train": f"0:{len(self._rows)}"},
            "data_path": DATA,
            "video_path": VIDEO if self._videos else None,
            "features": self._features
            | {video.key: video.feature() for video in self._videos.values()},
        }

    def _task_table(self) -> Any:
        """Return the tasks, with metadata that makes `task` the index of a pandas frame."""
        column = {"field_name": None, "metadata": None}
        pandas = {
            "index_columns": ["task"],
            "column_indexes": [],
            "columns": [
                {
                    **column, "name": "task_index", "field_name": "task_index",
                    "pandas_type": "int64", "numpy_type": "int64",
                },
                {
                    **column, "name": "task", "field_name": "task",
                    "pandas_type": "unicode", "numpy_type": "object",
                },
            ],
            "creator": {"library": "pyarrow", "version": self._arrow.__version__},
            "pandas_version": "2.2.0",
        }  # fmt: skip
        table = self._arrow.table(
            {
                "task_index": self._arrow.array(self._tasks.values(), self._arrow.int64()),
                "task": self._arrow.array(self._tasks.keys(), self._arrow.string()),
            }
        )
        return table.replace_schema_metadata({"pandas": json.dumps(pandas)})


def statistics(values: npt.NDArray[Any]) -> dict[str, list[float] | list[int]]:
    """Return minimum, maximum, mean, deviation, count and quantiles over the frames."""
    table = values.reshape(len(values), -1).astype(np.float64)
    levels = np.quantile(table, list(QUANTILES.values()), axis=0)
    return {
        "min": table.min(axis=0).tolist(),
        "max": table.max(axis=0).tolist(),
        "mean": table.mean(axis=0).tolist(),
        "std": table.std(axis=0).tolist(),
        "count": [len(table)],
    } | {name: level.tolist() for name, level in zip(QUANTILES, levels, strict=True)}
