"""Runs as a LeRobot dataset, format v3.0, with NumPy and pyarrow alone.

Frame k of an episode is the newest row not after k / fps: nothing of the future is in it, as it
would be in an average or in the nearest row. Action and observation come of the same row.
Source: the files that `lerobot` 0.4.4 and 0.6.1 write and read (codebase version v3.0).
"""

from __future__ import annotations

import hashlib
import json
import math
import shutil
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.errors import ConfigError, RecordingError
from tautwave.files import make_directory, write_text, writing
from tautwave.reading import open_file
from tautwave.recordings import RUN
from tautwave.recordings.cameras import camera_names, refuse_others
from tautwave.recordings.recording import Recording, read_recording
from tautwave.report.export.episodes import Episode, axis_blocks, episodes, pair_ratios
from tautwave.report.export.lerobot_files import VERSION, Dataset, Frames
from tautwave.report.export.lerobot_resume import (
    OURS,
    linked_copy,
    read_before,
    refuse_twice,
    take_place,
)
from tautwave.report.export.lerobot_video import CHUNK, Camera
from tautwave.report.export.signals import (
    INTERVENTION,
    LEADER,
    SCALE,
    STATE,
    Signals,
    engaged,
    signals,
)
from tautwave.report.units import plural

FPS = 30
"""Frames a second where none are given."""
PIECE = 1 << 20
"""[bytes] Read at once for a digest."""
SLACK_S = 1e-9
"""[s] A row this much after its frame is at the frame: times are rounded."""
OLDEST_S = 0.05
"""[s] A row that is older than this, or than a frame, is none of that frame."""
SHORTEST_S = 1.0
"""[s] An episode with fewer frames is no demonstration."""


class Choice(NamedTuple):
    """How a dataset is made: frames a second, task of episodes that name none, what is cut.

    `fps` None: 30, or those of the dataset that is resumed. `successes`: only episodes of which
    success was said. `max_gap_s` [s]: episodes with more frames in a row cut out of their middle
    are left out. `resume`: the episodes follow those of a dataset that exists.
    """

    fps: int | None
    task: str | None
    velocities: bool
    cut: bool
    video: bool
    successes: bool = False
    max_gap_s: float = math.inf
    resume: bool = False


class LeftOut(NamedTuple):
    """What a dataset leaves out: frames by their reason, and episodes."""

    missing: int = 0
    outside: int = 0
    unsuccessful: int = 0
    gap: int = 0
    discarded: int = 0
    short: int = 0

    def plus(self, **more: int) -> LeftOut:
        """Return it with more of some."""
        return self._replace(**{name: getattr(self, name) + n for name, n in more.items()})

    def __str__(self) -> str:
        each = (
            (self.missing, "frame", "without a sample"),
            (self.outside, "frame", "outside `engaged`"),
            (self.unsuccessful, "episode", "without success"),
            (self.gap, "episode", "with a gap beyond --max-gap"),
            (self.discarded, "episode", "recorded again"),
            (self.short, "episode", f"shorter than {SHORTEST_S:g} s"),
        )
        parts = [f"{plural(n, noun)} {why}".strip() for n, noun, why in each if n]
        return f"{', '.join(parts)} left out" if parts else ""


def _recorded(recording: Recording, velocities: bool) -> Signals:
    """Return the signals of a recording; raise `RecordingError` where it lacks one."""
    axes, ratios = axis_blocks(recording.attachments), pair_ratios(recording.attachments)
    recorded = signals(recording.metadata.get("rig", "tautwave"), axes, ratios, velocities)
    lacking = [one for one in recorded.columns if one not in recording.columns]
    if not recorded.action or not recorded.state or lacking:
        what = f"column {lacking[0]}" if lacking else "both sides' axes in a rig file of its own"
        raise RecordingError(
            f"a LeRobot dataset needs master and slave of a coupled rig, but the run lacks {what}"
        )
    return recorded._replace(led=INTERVENTION in recording.columns)


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


def export_dataset(runs: Sequence[Path], out: Path, choice: Choice) -> str:
    """Write the episodes of runs as one dataset, and return a sentence that counts.

    A run without episodes is one. Frames while the rig is not engaged, and episodes that were
    recorded again, are left out; `success` says of each frame what was said of its episode.

    Parameters
    ----------
    runs : sequence of Path
        Directories of runs whose axes are alike.
    out : Path
        Must not exist, or with `resume` be a dataset of such runs.
    choice : Choice
        Its `fps` is at most the rate of the runs. With `cut`, frames that miss a sample or a
        picture are left out, and episodes that are too short then, instead of refusing.

    Raises
    ------
    ConfigError
        `out` exists, fps is too high, or an episode has no task; or pyarrow is not installed. With
        `resume`: `out` is no dataset, of another robot, rate, signals or cameras, or has one of the
        recordings already.
    RecordingError
        A run cannot be read, misses samples, or has other axes than the first; an episode is
        too short, or none is left.
    WritingError
        Something cannot be written.
    """
    if out.exists() and not choice.resume:
        raise ConfigError(
            f"{out} exists; choose another --out, or add to this dataset with --resume"
        )
    place = out.resolve() if choice.resume else out  # a link goes on pointing at it
    before = read_before(out, VERSION, CHUNK) if choice.resume else None
    fps = choice.fps or (before.fps if before else FPS)
    choice = choice._replace(fps=fps)
    plans, origins = _plan(runs, choice, fps)
    if before is not None:
        refuse_twice(out, before.origins, origins)
    draft = place.with_name(f"{place.name}.part")
    if draft.exists():
        raise ConfigError(f"{draft} exists, left by an export that was killed; remove it first")
    if before is None:
        make_directory(draft)
    else:
        linked_copy(place, draft)
    try:
        first = plans[0]
        names = {key: [one.name for one in each] for key, each in first.features.items()}
        led = any(one.led for one in plans)
        dataset = Dataset(draft, fps, first.robot, names, first.cameras, before, led)
        left = LeftOut()
        for run, wanted in zip(runs, plans, strict=True):
            for frames, cut in _episodes_of(run, wanted, choice, fps):
                left = left.plus(**cut)
                if frames is not None:
                    dataset.add(frames)
        _close(dataset, left)
        made_of: list[Mapping[str, str]] = [*origins]
        altogether = left
        if before is not None:
            made_of = [*before.origins, *origins]
            altogether = left.plus(**before.left)
        kept = {"runs": made_of, "left_out": altogether._asdict()}
        write_text(draft / OURS, json.dumps(kept, indent=4))
        write_text(draft / "README.md", _card(made_of, first, fps, altogether))
        if before is not None:
            take_place(draft, place)
        else:
            with writing(out):
                draft.rename(out)
    except BaseException:
        shutil.rmtree(draft, ignore_errors=True)
        raise
    episodes_added, frames_added = dataset.added
    counted = f"{plural(episodes_added, 'episode')}, {plural(frames_added, 'frame')} at {fps} fps"
    if before is not None:
        now = f"{plural(dataset.episodes, 'episode')}, {plural(dataset.frames, 'frame')}"
        counted = f"added {counted}, now {now}"
    return ", ".join(filter(None, [f"{out}: {counted}", str(left)]))


def _close(dataset: Dataset, left: LeftOut) -> None:
    """Complete a dataset; one without any episode is none."""
    if not dataset.added[0]:
        raise RecordingError(f"no episode is left for a dataset: {left}")
    dataset.close()


def _episodes_of(
    run: Path, wanted: Signals, choice: Choice, fps: int
) -> Iterator[tuple[Frames | None, dict[str, int]]]:
    """Give the frames of each episode, None of one that is left out, and what is."""
    cameras = [Camera.of_run(run, name) for name in wanted.cameras]
    recorded = read_recording(run, rows=slice(0, 1)).columns
    some = (STATE, SCALE, INTERVENTION)
    columns = [*wanted.columns, *(one for one in some if one in recorded)]
    for episode in episodes(run):
        if episode.discarded:
            yield None, {"discarded": 1}
            continue
        if choice.successes and episode.success is not True:
            yield None, {"unsuccessful": 1}
            continue
        text = episode.task or choice.task
        if not text:
            raise ConfigError(
                f"{run}: {_name(episode)} has no task; say what was done with --task TEXT"
            )
        rows = read_recording(run, ["time_s", *columns], rows=episode.rows)
        taken, recent = frame_rows(rows.time_s, fps, 1.0 / float(rows.metadata["rate_hz"]))
        row = {name: rows[name][taken] for name in columns}
        is_engaged = engaged(row[STATE]) if STATE in row else np.ones(len(taken), bool)
        finite = np.all([np.isfinite(row[name]) for name in wanted.columns], axis=0)
        valid = np.all([row[name] != 0.0 for name in wanted.valid], axis=0)
        whole = recent & finite & valid
        filmed = [camera.numbers(rows.time_s[taken]) for camera in cameras]
        for seen in filmed:
            whole &= seen >= 0
        kept = whole & is_engaged
        cut = {
            "outside": int(np.count_nonzero(~is_engaged)),
            "missing": int(np.count_nonzero(is_engaged & ~whole)),
        }
        if cut["missing"] and not choice.cut:
            also = " or a picture" if cameras else ""
            raise RecordingError(
                f"{run}: {cut['missing']} of {len(taken)} frames of {_name(episode)} miss a "
                f"sample{also}, and a held value would be invented; --missing cut leaves these "
                "frames out"
            )
        if longest_gap(kept) > choice.max_gap_s * fps:
            yield None, {"gap": 1}
            continue
        if (count := int(np.count_nonzero(kept))) < SHORTEST_S * fps:
            if not choice.cut:
                raise RecordingError(
                    f"{run}: {_name(episode)} has {count / fps:.3g} s of "
                    f"{len(taken) / fps:.3g} s in which the rig was engaged, and a dataset "
                    f"needs {SHORTEST_S:g} s; --missing cut leaves such episodes out"
                )
            yield None, {"short": 1}
            continue
        pictures = {
            camera.name: camera.jpegs(seen[kept].tolist())
            for camera, seen in zip(cameras, filmed, strict=True)
        }
        values = {
            key: np.stack([one.of(row)[kept] for one in each], axis=1).astype(np.float32)
            for key, each in wanted.features.items()
        }
        person = row[INTERVENTION][kept] != 0.0 if INTERVENTION in row else None
        yield Frames(values, text, pictures, said_in_frames(episode.success), person), cut


def longest_gap(kept: npt.NDArray[np.bool_]) -> int:
    """Return how many frames in a row are cut at most between two that are kept."""
    at = np.flatnonzero(kept)
    return int(np.max(np.diff(at), initial=1)) - 1


def said_in_frames(success: bool | None) -> int:
    """Return the verdict on an episode as a number: 1 success, 0 failed, -1 none."""
    return -1 if success is None else int(success)


def _name(episode: Episode) -> str:
    return f"episode {episode.name}" if episode.number else "the run"


def _plan(
    runs: Sequence[Path], choice: Choice, fps: int
) -> tuple[list[Signals], list[dict[str, str]]]:
    """Return the signals of each run, whose names are alike, and the origin of each."""
    plans: list[Signals] = []
    origins = []
    for run in runs:
        head = read_recording(run, rows=slice(0, 1))
        wanted = _recorded(head, choice.velocities)
        if choice.video and run.is_dir():
            refuse_others(run, float(head.time_s[0]))
        plans.append(wanted._replace(cameras=camera_names(run) if choice.video else ()))
        if not plans[-1].alike(plans[0]):
            raise RecordingError(
                f"{run}: its rig, axes, units or cameras are not those of {runs[0]}; a dataset "
                "has one robot"
            )
        rate = float(head.metadata.get("rate_hz", "nan"))
        if not fps <= rate:
            raise ConfigError(f"{run}: recorded at {rate:g} Hz, so at most --fps {int(rate)}")
        origins.append(_origin(run, head))
    return plans, origins


def _origin(run: Path, head: Recording) -> dict[str, str]:
    digest = hashlib.sha256()
    with open_file(run / RUN if run.is_dir() else run) as file:
        while piece := file.read(PIECE):
            digest.update(piece)
    return {
        "run": run.resolve().name,
        "recording": digest.hexdigest(),
        "rig": head.metadata.get("rig", ""),
        "rig_sha256": hashlib.sha256(head.attachments.get("rig.yaml", b"")).hexdigest(),
        "tautwave": head.metadata.get("version", "of unknown version"),
    }


def _origin_line(one: Mapping[str, str]) -> str:
    rig = f"rig {one['rig']} (sha256 {one['rig_sha256'][:16]})"
    return f"- `{one['run']}`: {rig}, tautwave {one['tautwave']}"


def _card(origins: Sequence[Mapping[str, str]], picked: Signals, fps: int, left: LeftOut) -> str:
    lines = [
        f"| {feature} | `{one.name}` | {one} | {one.unit} |"
        for feature, signals in picked.features.items()
        for one in signals
    ]
    cut = f"\nOf the recordings, {left}: frames on either side of a cut follow each other."
    note = cut if str(left) else ""
    return f"""# Demonstrations recorded with tautwave

Action: the target position of each slave axis, in the slave's coordinates: (master - offset) x
position_scale x sign, with the offset of that engagement and the live scale; a replay commands it.
Observation: position, velocity and effort of the slave's axes. `{LEADER}`: the master's axes, in
its own coordinates. All are of one control cycle: the newest one not after k / {fps} s.{note}
The force between hand and task is not part of an action; it is in the recordings.
`success` is the verdict on the episode: 1 success, 0 failed, -1 none.
`intervention`, where a policy led: a person leads this frame, as everywhere in a demonstration.

| feature | name | of the recording's columns | unit |
| --- | --- | --- | --- |
{chr(10).join(lines)}

Made from:

{chr(10).join(map(_origin_line, origins))}
"""
