"""A run as a ROS 2 bag: the joint states of both sides, MCAP with rosbag2's metadata.yaml."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import numpy as np

from tautwave.errors import ConfigError, WritingError
from tautwave.recordings.recording import Recording, read_recording

JOINT_STATE = "sensor_msgs/msg/JointState"
EFFORTS = ("motor_effort", "commanded")
"""Columns that are a joint's effort, the first that was recorded."""


def export_bag(directory: Path, out: Path) -> Path:
    """Write a run as a bag; return its directory.

    `/master/joint_states` and `/slave/joint_states` have every row: position [rad or m], velocity
    and effort [N m or N] of each axis, NaN in rows without a sample; `/SIDE/measured_efforts` what
    effort sensors showed, where there were any. Stamps are the recording's `time_s`.

    Raises
    ------
    ConfigError
        rosbags is not installed, or the run has no axis.
    WritingError
        The directory exists, or cannot be written.
    """
    try:
        rosbag2: Any = importlib.import_module("rosbags.rosbag2")
        types: Any = importlib.import_module("rosbags.typesys")
    except ImportError as err:
        raise ConfigError("this needs rosbags; pip install 'tautwave[ros]'") from err
    recording = read_recording(directory)
    sides = {side: _axes(recording, side) for side in ("master", "slave")}
    if not any(sides.values()):
        raise ConfigError(f"{directory}: has no axis of a master or a slave")
    store = types.get_typestore(types.Stores.ROS2_JAZZY)
    if out.exists():
        raise WritingError(f"{out}: exists already; choose another directory with --out")
    stamps = np.rint(1e9 * np.array(recording["time_s"])).astype(np.int64)
    try:
        with rosbag2.Writer(out, version=9, storage_plugin=rosbag2.StoragePlugin.MCAP) as bag:
            topics = [
                (bag.add_connection(f"/{side}/{name}", JOINT_STATE, typestore=store), axes, parts)
                for side, axes in sides.items()
                for name, axes, parts in _topics(recording, axes)
            ]
            for row, stamp in enumerate(stamps.tolist()):
                for connection, axes, parts in topics:
                    message = _message(store, stamp, axes, [values[row] for values in parts])
                    bag.write(connection, stamp, store.serialize_cdr(message, JOINT_STATE))
    except OSError as err:
        raise WritingError(f"{out}: cannot be written: {err}") from err
    return out


def _axes(recording: Recording, side: str) -> list[str]:
    return [name for name in recording.axes() if name.startswith(f"{side}.")]


def _topics(recording: Recording, axes: list[str]) -> list[tuple[str, list[str], list[Any]]]:
    """Return names, axes, and arrays of positions, velocities and efforts: a column each axis."""
    if not axes:
        return []
    felt = [name for name in axes if f"{name}.measured_effort" in recording.columns]
    empty = np.empty((len(recording), 0))
    effort = [
        next((f"{name}.{one}" for one in EFFORTS if f"{name}.{one}" in recording.columns), "")
        for name in axes
    ]
    states = [
        _table(recording, [f"{name}.position" for name in axes]),
        _table(recording, [f"{name}.velocity" for name in axes]),
        _table(recording, effort),
    ]
    topics = [("joint_states", axes, states)]
    if felt:
        shown = _table(recording, [f"{name}.measured_effort" for name in felt])
        topics.append(("measured_efforts", felt, [empty, empty, shown]))
    return topics


def _table(recording: Recording, columns: list[str]) -> Any:
    """Return columns side by side; none at all where one was not recorded."""
    if not all(name in recording.columns for name in columns):
        return np.empty((len(recording), 0))
    return np.column_stack([np.array(recording[name]) for name in columns])


def _message(store: Any, stamp: int, axes: list[str], parts: list[Any]) -> Any:
    types = store.types
    header = types["std_msgs/msg/Header"](
        stamp=types["builtin_interfaces/msg/Time"](sec=stamp // 10**9, nanosec=stamp % 10**9),
        frame_id="",
    )
    names = [name.partition(".")[2] for name in axes]
    position, velocity, effort = (np.ascontiguousarray(part) for part in parts)
    return types[JOINT_STATE](
        header=header, name=names, position=position, velocity=velocity, effort=effort
    )
