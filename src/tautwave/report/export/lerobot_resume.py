"""A LeRobot dataset that goes on: what is in it already, and whether more of the same can follow.

The new episodes are written beside it, into a copy whose data and videos are hard links, and the
copy takes its place when it is complete: an export that is killed leaves the dataset as it was.
"""

from __future__ import annotations

import importlib
import math
import os
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.config.guard import parse_json, read_guarded
from tautwave.errors import ConfigError
from tautwave.files import writing
from tautwave.summary.file import LARGEST

OURS = "meta/tautwave.json"
"""What a dataset is made from: runs, the digest of each recording, what was left out."""
DATA_FILES = "data/chunk-*/file-*.parquet"
EPISODE_FILES = "meta/episodes/chunk-*/file-*.parquet"


class Before(NamedTuple):
    """A dataset as it stands.

    `values` are the columns of all frames, `rows` what is said of each episode, `stats` the
    statistics of each feature, `data_files` and `video_files` the numbers of the files that
    follow. `origins` and `left` are what it was made from and what was left out, as it was kept.
    """

    info: Mapping[str, Any]
    rows: Sequence[dict[str, Any]]
    tasks: Mapping[str, int]
    values: Mapping[str, npt.NDArray[Any]]
    stats: Mapping[str, Any]
    data_files: int
    video_files: int
    origins: Sequence[Mapping[str, str]]
    left: Mapping[str, int]

    @property
    def fps(self) -> int:
        """Frames a second."""
        return int(self.info["fps"])


def read_before(root: Path, version: str, chunk: int) -> Before:
    """Read a dataset that is to go on.

    Parameters
    ----------
    root : Path
        Its directory.
    version : str
        The format that is written.
    chunk : int
        Files in a folder.

    Raises
    ------
    ConfigError
        It is no dataset of this format that `tautwave export` made, or is damaged.
    """
    pyarrow, parquet = arrow_library()
    try:
        info = _stated(root / "meta/info.json")
        written_as = info["codebase_version"]
    except (ConfigError, KeyError, TypeError) as err:
        raise ConfigError(
            f"{root}: no LeRobot dataset, so there is nothing to resume; leave --resume out to "
            "write a new one"
        ) from err
    if written_as != version:
        raise ConfigError(f"{root}: format {written_as}; only {version} can be resumed")
    if not (root / OURS).is_file():
        raise ConfigError(
            f"{root}: no {OURS}, so `tautwave export` has not made it; write a new dataset, and "
            "have LeRobot merge the two"
        )
    try:
        ours = _stated(root / OURS)
        numeric = {key: one for key, one in info["features"].items() if one["dtype"] != "video"}
        tables = [parquet.read_table(one) for one in sorted(root.glob(DATA_FILES))]
        values = _columns(pyarrow.concat_tables(tables), numeric)
        rows = [
            row for one in sorted(root.glob(EPISODE_FILES))
            for row in parquet.read_table(one).to_pylist()
        ]  # fmt: skip
        tasks = parquet.read_table(root / "meta/tasks.parquet").to_pydict()
        numbered = dict(zip(tasks["task"], tasks["task_index"], strict=True))
        stats = _stated(root / "meta/stats.json")
        last = max(_number(row, "data", chunk) for row in rows)
        videos = [key for key, one in info["features"].items() if one["dtype"] == "video"]
        filmed = [_number(row, f"videos/{key}", chunk) for key in videos for row in rows]
        frames, origins, left = info["total_frames"], ours["runs"], ours["left_out"]
    except (ConfigError, OSError, ValueError, LookupError, TypeError) as err:
        raise ConfigError(f"{root}: damaged, and cannot be resumed: {err}") from err
    if len(values["index"]) != frames or len(rows) != info["total_episodes"]:
        raise ConfigError(
            f"{root}: damaged, and cannot be resumed: {len(values['index'])} frames and "
            f"{len(rows)} episodes in its files, {frames} and {info['total_episodes']} in info.json"
        )
    files = max(filmed, default=-1) + 1
    return Before(info, rows, numbered, values, stats, last + 1, files, origins, left)


def _stated(path: Path) -> Any:
    return parse_json(read_guarded(path, "part of a dataset", LARGEST))


def _number(row: Mapping[str, Any], kind: str, chunk: int) -> int:
    return chunk * int(row[f"{kind}/chunk_index"]) + int(row[f"{kind}/file_index"])


def _columns(table: Any, features: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Return the columns of a table as arrays, shape (frames,) or (frames, signals)."""
    arrays = {}
    for key, feature in features.items():
        column = table[key].combine_chunks()
        if feature["names"] is None:
            arrays[key] = column.to_numpy(zero_copy_only=False)
        else:
            flat = column.flatten().to_numpy(zero_copy_only=False)
            arrays[key] = flat.reshape(len(column), feature["shape"][0])
    return arrays


def refuse_unlike(
    root: Path,
    before: Before,
    fps: int,
    robot: str,
    features: Mapping[str, Mapping[str, Any]],
    videos: Sequence[str],
) -> None:
    """Refuse to go on with another robot, rate, signals or cameras, by what differs first."""
    mine: dict[str, Any] = {"robot_type": robot, "fps": fps}
    for key, value in mine.items():
        if before.info[key] != value:
            raise ConfigError(f"{root}: {key} {before.info[key]}, but {value} would follow")
    old = before.info["features"]
    for key in [*old, *(one for one in (*features, *videos) if one not in old)]:
        if key not in old or (key not in features and key not in videos):
            who = "the dataset has" if key in old else "the runs have"
            hint = "; write a new dataset" if key not in videos else "; --no-video leaves it out"
            raise ConfigError(f"{root}: only {who} the feature {key}{hint}")
        if key in videos:
            continue  # its pictures are compared when they come
        for part in ("dtype", "names"):
            if old[key][part] != features[key][part]:
                raise ConfigError(
                    f"{root}: {part} of {key} is {_listed(old[key][part])}, but "
                    f"{_listed(features[key][part])} would follow"
                )


def _listed(value: Any) -> str:
    return ", ".join(map(str, value)) if isinstance(value, list | tuple) else str(value)


def refuse_twice(
    root: Path, before: Sequence[Mapping[str, str]], origins: Sequence[Mapping[str, str]]
) -> None:
    """Refuse a recording that a dataset has already."""
    known = {one["recording"]: one["run"] for one in before}
    for one in origins:
        if one["recording"] in known:
            raise ConfigError(
                f"{root}: has the recording of {one['run']} already, as {known[one['recording']]}; "
                "its episodes would be there twice"
            )


def linked_copy(root: Path, draft: Path) -> None:
    """Copy a dataset; what is never written again is linked, where the file system has links."""
    with writing(draft):
        shutil.copytree(root, draft, symlinks=True, copy_function=_link)


def _link(source: str, target: str) -> str:
    kept = Path(source).suffix in (".parquet", ".mp4") and "meta" not in Path(source).parts[-4:-1]
    if kept:
        try:
            os.link(source, target)
        except OSError:  # none on FAT, nor across mounts
            pass
        else:
            return target
    return shutil.copy2(source, target)


def take_place(draft: Path, out: Path) -> None:
    """Put a complete dataset in the place of the one it goes on from."""
    before = out.with_name(f"{out.name}.before")
    if before.exists():
        raise ConfigError(f"{before} exists, left by an export that was killed; look at it first")
    with writing(out):
        out.rename(before)
        try:
            draft.rename(out)
        except OSError:
            before.rename(out)
            raise
        shutil.rmtree(before)


def together(parts: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the statistics of several parts of a feature's values.

    Quantiles are means by count, as LeRobot merges them; everything else is exact.
    """
    counts = np.array([part["count"][0] for part in parts], float)
    share = counts / counts.sum()

    def mean_of(name: str) -> npt.NDArray[np.float64]:
        return np.tensordot(share, np.array([part[name] for part in parts]), 1)

    mean = mean_of("mean")
    square = sum(
        one * (np.square(part["std"]) + np.square(part["mean"]))
        for one, part in zip(share, parts, strict=True)
    )
    exact = {
        "min": np.min([part["min"] for part in parts], axis=0),
        "max": np.max([part["max"] for part in parts], axis=0),
        "mean": mean,
        "std": np.sqrt(np.maximum(square - np.square(mean), 0.0)),
    }
    rest = {name: mean_of(name) for name in parts[0] if name not in exact and name != "count"}
    combined: dict[str, Any] = {name: value.tolist() for name, value in (exact | rest).items()}
    return combined | {"count": [math.floor(counts.sum() + 0.5)]}


def arrow_library() -> tuple[Any, Any]:
    """Return pyarrow and its Parquet; raise `ConfigError` where it is not installed."""
    try:
        return importlib.import_module("pyarrow"), importlib.import_module("pyarrow.parquet")
    except ImportError as err:
        raise ConfigError("--to lerobot needs pyarrow: pip install 'tautwave[parquet]'") from err
