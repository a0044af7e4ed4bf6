"""ROS 2 bags, MCAP and SQLite: joint states and wrenches, with the times of their headers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from tautwave.errors import ConfigError
from tautwave.reading import open_file
from tautwave.recordings.readers.shared import Array, chosen, library
from tautwave.recordings.stated import Stated

METADATA = "metadata.yaml"
STORAGES = (".mcap", ".db3")
JOINTS, WRENCH = "sensor_msgs/msg/JointState", "geometry_msgs/msg/WrenchStamped"
TIME = "time_s"


class Message(NamedTuple):
    """A message as it is stored: topic, type, time of its recording [ns], CDR."""

    topic: str
    kind: str
    stored_ns: int
    data: bytes


def is_bag(path: Path) -> bool:
    """Return whether a path is a bag: its directory, or one of its files that is not of ours."""
    if path.is_dir():
        return (path / METADATA).is_file()
    if path.suffix == ".db3":
        return True
    if path.suffix != ".mcap":
        return False
    try:
        with open_file(path) as file:
            start = file.read(64)
    except OSError:
        return False
    return start.startswith(b"\x89MCAP") and b"tautwave" not in start


def bag_names(path: Path, stated: Stated) -> list[str]:
    """Return the columns of a bag: `time_s`, `TOPIC.JOINT.position`, `TOPIC.force.x`."""
    return [TIME, *(name for table in _tables(path).values() for name in table if name != TIME)]


def bag_columns(
    path: Path, wanted: Sequence[str], stated: Stated, *, holes: bool
) -> dict[str, Array]:
    """Read columns of a bag, on the times of the first topic that is wanted.

    Those of another topic are interpolated between its messages, where both have some.
    """
    tables = _tables(path)
    every = {TIME: np.empty(0)} | {n: v for table in tables.values() for n, v in table.items()}
    chosen(path, every, wanted)
    names = [name for name in wanted if name != TIME]
    whose = {name: next(t for t in tables.values() if name in t) for name in names}
    first = whose[names[0]] if names else next(iter(tables.values()))
    times = first[TIME]
    inside = np.ones(len(times), dtype=bool)
    for table in whose.values():
        inside &= (times >= table[TIME][0]) & (times <= table[TIME][-1])
    times = times[inside]
    columns = {TIME: times}
    for name, table in whose.items():
        own = table is first
        columns[name] = table[name][inside] if own else np.interp(times, table[TIME], table[name])
    return columns


def _tables(path: Path) -> dict[str, dict[str, Array]]:
    """Return the numbers of each topic by column, with its times since the bag's first [s]."""
    types = library(path, "rosbags.typesys", "ros")
    store = types.get_typestore(types.Stores.ROS2_JAZZY)
    rows: dict[str, list[tuple[int, dict[str, float]]]] = {}
    files = sorted(f for f in path.iterdir() if f.suffix in STORAGES) if path.is_dir() else [path]
    for file in files:
        for message in _messages(file):
            try:
                told = store.deserialize_cdr(message.data, message.kind)
            except Exception as err:
                raise ConfigError(f"{file}: a damaged {message.kind} on {message.topic}") from err
            stamp = told.header.stamp.sec * 10**9 + told.header.stamp.nanosec
            row = (stamp or message.stored_ns, _numbers(message, told))
            rows.setdefault(message.topic, []).append(row)
    if not rows:
        raise ConfigError(f"{path}: has no message of {JOINTS} or {WRENCH}")
    begin = min(stamp for table in rows.values() for stamp, _ in table)
    return {topic: _table(table, begin) for topic, table in rows.items()}


def _table(rows: list[tuple[int, dict[str, float]]], begin: int) -> dict[str, Array]:
    rows.sort(key=lambda row: row[0])
    names = dict.fromkeys(name for _, row in rows for name in row)
    columns = {name: np.array([row.get(name, np.nan) for _, row in rows]) for name in names}
    return columns | {TIME: np.array([1e-9 * (stamp - begin) for stamp, _ in rows])}


def _numbers(message: Message, told: Any) -> dict[str, float]:
    topic = message.topic.strip("/")
    if message.kind == WRENCH:
        return {
            f"{topic}.{part}.{axis}": float(getattr(getattr(told.wrench, part), axis))
            for part in ("force", "torque")
            for axis in "xyz"
        }
    return {
        f"{topic}.{name}.{part}": float(value)
        for part in ("position", "velocity", "effort")
        for name, value in zip(told.name, getattr(told, part), strict=False)
    }


def _messages(file: Path) -> Iterator[Message]:
    """Yield the messages of a file that hold joint states or wrenches.

    Raises
    ------
    ConfigError
        It cannot be read.
    """
    if file.suffix == ".mcap":
        yield from _of_mcap(file)
        return
    import sqlite3  # for this kind of file alone

    try:
        open_file(file).close()  # no pipe, which would be waited for
        with closing(sqlite3.connect(f"file:{file.resolve()}?mode=ro", uri=True)) as bag:
            yield from map(
                Message._make,
                bag.execute(
                    "SELECT name, type, timestamp, data FROM messages JOIN topics ON "
                    "topic_id = topics.id WHERE type IN (?, ?) ORDER BY timestamp",
                    (JOINTS, WRENCH),
                ),
            )
    except (OSError, sqlite3.Error) as err:
        raise ConfigError(f"{file}: cannot be read as a bag: {err}") from err


def _of_mcap(file: Path) -> Iterator[Message]:
    from mcap.exceptions import McapError
    from mcap.reader import make_reader

    try:
        with open_file(file) as stream:
            for schema, channel, message in make_reader(stream).iter_messages():
                if schema is not None and schema.name in (JOINTS, WRENCH):
                    yield Message(channel.topic, schema.name, message.log_time, message.data)
    except (OSError, McapError, ValueError) as err:
        raise ConfigError(f"{file}: cannot be read as a bag: {err}") from err
