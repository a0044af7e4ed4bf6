"""Runs as a LeRobot dataset, format v3.0, with NumPy and pyarrow alone.

Frame k of an episode is the newest row not after k / fps: nothing of the future is in it, as it
would be in an average or in the nearest row. Action and observation come of the same row.
Source: the files that `lerobot` 0.4.4 and 0.6.1 write and read (codebase version v3.0).
"""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.errors import ConfigError, RecordingError
from tautwave.files import make_directory, write_text, writing
from tautwave.recordings.cameras import camera_names, refuse_others
from tautwave.recordings.recording import Recording, read_recording
from tautwave.report.export.episodes import Episode, axis_blocks, episodes
from tautwave.report.export.lerobot_files import Dataset, Frames
from tautwave.report.export.lerobot_video import Camera
from tautwave.report.units import plural

SLACK_S = 1e-9
"""[s] A row this much after its frame is at the frame: times are rounded."""
OLDEST_S = 0.05
"""[s] A row that is older than this, or than a frame, is none of that frame."""
EFFORT = {"rotary": "torque", "linear": "force"}


class Signals(NamedTuple):
    """Columns that become action and observation, the names a dataset has for them, cameras.

    `valid` are columns that are 0 where an axis had no sample, and others keep what was before.
    """

    robot: str
    action: dict[str, str]
    state: dict[str, str]
    units: dict[str, str]
    valid: tuple[str, ...]
    cameras: tuple[str, ...] = ()


def signals(robot: str, axes: Mapping[str, Mapping[str, Any]], velocities: bool) -> Signals:
    """Return what an operator did, and what the slave felt: all axes of a rig.

    The master's positions are the action (with `velocities` these too), position, velocity and
    effort of the slave's motors the observation. Effort is what the slave was commanded, on an
    admittance axis what it measured.

    Parameters
    ----------
    robot : str
        The rig's name.
    axes : mapping
        `kind` and `causality` of each axis by its full name, such as `master.lever`.
    velocities : bool
        Whether the master's are part of the action.
    """
    action: dict[str, str] = {}
    state: dict[str, str] = {}
    units: dict[str, str] = {}
    for axis, block in axes.items():
        side, _, name = axis.partition(".")
        linear = block.get("kind") == "linear"
        effort = "measured_effort" if block.get("causality") == "admittance" else "commanded"
        picked = {f"{axis}.position": f"{name}.pos"}
        if side == "slave" or velocities:
            picked[f"{axis}.velocity"] = f"{name}.vel"
        if side == "slave":
            picked[f"{axis}.{effort}"] = f"{name}.{EFFORT['linear' if linear else 'rotary']}"
        (action if side == "master" else state).update(picked)
        length = "m" if linear else "rad"
        named = {"pos": length, "vel": f"{length}/s", "torque": "N m", "force": "N"}
        for column, name in picked.items():
            units[column] = named[name.rpartition(".")[2]]
    return Signals(robot, action, state, units, tuple(f"{axis}.valid" for axis in axes))


def _recorded(recording: Recording, velocities: bool) -> Signals:
    """Return the signals of a recording; raise `RecordingError` where it lacks one."""
    axes = axis_blocks(recording.attachments)
    found = signals(recording.metadata.get("rig", "tautwave"), axes, velocities)
    needed = (*found.action, *found.state, *found.valid)
    lacking = [one for one in needed if one not in recording.columns]
    if not found.action or not found.state or lacking:
        what = f"column {lacking[0]}" if lacking else "both sides' axes in a rig file of its own"
        raise RecordingError(
            f"a LeRobot dataset needs master and slave of a coupled rig, but the run lacks {what}"
        )
    return found


def frame_rows(
    times: npt.NDArray[np.float64], fps: int, period_s: float
) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.bool_]]:
    """Return the row of each frame, the newest not after it, and whether it is recent.

    Where slots or a chunk of the recording are missing, a row would stand for frames after its own.

    Parameters
    ----------
    times : array
        Time of each row [s], rising.
    fps : int
        Frames a second.
    period_s : float
        Of a cycle [s].
    """
    span = times[-1] - times[0] + SLACK_S
    at = times[0] + np.arange(int(span * fps) + 1) / fps
    newest: npt.NDArray[np.intp] = np.searchsorted(times, at + SLACK_S, side="right") - 1
    oldest = max(min(1.0 / fps, OLDEST_S), period_s)
    return newest, at - times[newest] < oldest - SLACK_S


def export_dataset(
    runs: Sequence[Path],
    out: Path,
    fps: int,
    task: str | None = None,
    *,
    velocities: bool = False,
    cut: bool = False,
    video: bool = True,
) -> str:
    """Write the episodes of runs as one dataset, and return a sentence that counts.

    A run without episodes is one.

    Parameters
    ----------
    runs : sequence of Path
        Directories of runs whose axes are alike.
    out : Path
        Must not exist.
    fps : int
        Frames a second, at most the rate of the runs.
    task : str, optional
        What was done, for episodes whose mark does not say.
    velocities : bool
        Whether the master's velocities are part of the action.
    cut : bool
        Leave out frames that miss a sample or a picture, instead of refusing.
    video : bool
        Whether pictures of the runs' cameras are part of it.

    Raises
    ------
    ConfigError
        `out` exists, fps is too high, or an episode has no task; or pyarrow is not installed.
    RecordingError
        A run cannot be read, misses samples, or has other axes than the first.
    WritingError
        Something cannot be written.
    """
    if out.exists():
        raise ConfigError(f"{out} exists; a dataset is written to a new directory: choose --out")
    wanted, origins = _plan(runs, fps, velocities, video)
    draft = out.with_name(f"{out.name}.part")
    if draft.exists():
        raise ConfigError(f"{draft} exists, left by an export that was killed; remove it first")
    make_directory(draft)
    try:
        dataset = Dataset(draft, fps, wanted.robot, wanted.action, wanted.state, wanted.cameras)
        for run in runs:
            for frames in _episodes_of(run, wanted, fps, task, cut):
                dataset.add(frames)
        dataset.close()
        write_text(draft / "README.md", _card(origins, wanted, fps, dataset.cut))
        with writing(out):
            draft.rename(out)
    except BaseException:
        shutil.rmtree(draft, ignore_errors=True)
        raise
    left = f", {plural(dataset.cut, 'frame')} without a sample left out" if dataset.cut else ""
    counted = f"{plural(dataset.episodes, 'episode')}, {plural(dataset.frames, 'frame')}"
    return f"{out}: {counted} at {fps} fps{left}"


def _episodes_of(
    run: Path, wanted: Signals, fps: int, task: str | None, cut: bool
) -> Iterator[Frames]:
    cameras = [Camera.of_run(run, name) for name in wanted.cameras]
    columns = ["time_s", *wanted.action, *wanted.state, *wanted.valid]
    split, end = len(wanted.action), len(wanted.action) + len(wanted.state)
    for episode in episodes(run):
        rows = read_recording(run, columns, rows=episode.rows)
        text = episode.task or task
        if not text:
            raise ConfigError(
                f"{run}: {_name(episode)} has no task; say what was done with --task TEXT"
            )
        taken, recent = frame_rows(rows.time_s, fps, 1.0 / float(rows.metadata["rate_hz"]))
        data = rows.data[taken, 1:]
        whole = recent & np.all(np.isfinite(data), axis=1) & np.all(data[:, end:] != 0.0, axis=1)
        also = " or a picture" if cameras else ""
        filmed = [camera.numbers(rows.time_s[taken]) for camera in cameras]
        for seen in filmed:
            whole &= seen >= 0
        missing = len(data) - int(np.count_nonzero(whole))
        if missing and not cut:
            raise RecordingError(
                f"{run}: {missing} of {len(data)} frames of {_name(episode)} miss a sample{also}, "
                "and a held value would be invented; --missing cut leaves these frames out"
            )
        if not whole.any():
            raise RecordingError(f"{run}: {_name(episode)} has no frame with all samples")
        kept = data[whole, :end].astype(np.float32)
        pictures = {
            camera.name: camera.jpegs(seen[whole].tolist())
            for camera, seen in zip(cameras, filmed, strict=True)
        }
        yield Frames(kept[:, :split], kept[:, split:], text, missing, pictures)


def _name(episode: Episode) -> str:
    return f"episode {episode.name}" if episode.number else "the run"


def _plan(
    runs: Sequence[Path], fps: int, velocities: bool, video: bool
) -> tuple[Signals, list[str]]:
    """Return what all runs have alike, and a line on the origin of each."""
    first: Signals | None = None
    origins = []
    for run in runs:
        head = read_recording(run, rows=slice(0, 1))
        wanted = _recorded(head, velocities)
        if video and run.is_dir():
            refuse_others(run, float(head.time_s[0]))
        wanted = wanted._replace(cameras=camera_names(run) if video else ())
        first = first or wanted
        if wanted != first:
            raise RecordingError(
                f"{run}: its rig, axes, units or cameras are not those of {runs[0]}; a dataset "
                "has one robot"
            )
        rate = float(head.metadata.get("rate_hz", "nan"))
        if not fps <= rate:
            raise ConfigError(f"{run}: recorded at {rate:g} Hz, so at most --fps {int(rate)}")
        origins.append(_origin(run, head))
    assert first is not None
    return first, origins


def _origin(run: Path, head: Recording) -> str:
    rig = hashlib.sha256(head.attachments.get("rig.yaml", b"")).hexdigest()[:16]
    version = head.metadata.get("version", "of unknown version")
    return f"- `{run.name}`: rig {head.metadata.get('rig', '')} (sha256 {rig}), tautwave {version}"


def _card(origins: Sequence[str], picked: Signals, fps: int, cut: int) -> str:
    lines = [
        f"| {feature} | `{name}` | `{column}` | {picked.units[column]} |"
        for feature, columns in (("action", picked.action), ("observation.state", picked.state))
        for column, name in columns.items()
    ]
    left = f" {cut} frames without a sample were left out." if cut else ""
    return f"""# Demonstrations recorded with tautwave

Action: the master's axes. Observation: position, velocity and effort of the slave's. Both are of
one control cycle: the newest one not after k / {fps} s.{left} The force between hand and task is
not part of an action; it is in the recordings.

| feature | name | column of the recording | unit |
| --- | --- | --- | --- |
{chr(10).join(lines)}

Made from:

{chr(10).join(origins)}
"""
