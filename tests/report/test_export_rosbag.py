"""`tautwave export --to rosbag`: two readers of bags that others wrote find each row's numbers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from tautwave.cli import main
from tautwave.recordings.columns import read_columns
from tautwave.runtime.recorder import Recorder

COLUMNS = (
    "time_s",
    *(f"{side}.{pair}.{what}" for side in ("master", "slave") for pair in ("pan", "lift")
      for what in ("position", "velocity", "commanded")),
    "slave.lift.measured_effort",
)  # fmt: skip
ROWS = np.random.default_rng(2).normal(size=(50, len(COLUMNS)))
ROWS[:, 0] = 0.001 * np.arange(50) + 3.7e-5
ROWS[7, 1] = np.nan


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("rosbags")
    folder = tmp_path_factory.mktemp("run")
    recorder = Recorder(
        folder / "recording.mcap", COLUMNS, metadata={}, attachments={}, rows=64, lossless=True,
        rate_hz=1000.0,
    )  # fmt: skip
    recorder.start()
    for values in ROWS.tolist():
        for at, value in enumerate(values):
            recorder.row[at] = value
        recorder.commit()
    recorder.close()
    out = folder / "bag"
    done = CliRunner().invoke(main, ["export", str(folder), "--to", "rosbag", "--out", str(out)])
    assert done.exit_code == 0, done.output
    assert done.output == f"{out}\n"
    again = CliRunner().invoke(main, ["export", str(folder), "--to", "rosbag", "--out", str(out)])
    assert again.exit_code != 0
    assert "exists already" in again.output
    return out


STAMPS = np.rint(1e9 * ROWS[:, 0]).astype(np.int64)


def stamp_of(message: Any) -> int:
    return int(message.header.stamp.sec * 10**9 + message.header.stamp.nanosec)


def check(topics: dict[str, list[tuple[int, Any]]]) -> None:
    assert set(topics) == {
        "/master/joint_states", "/slave/joint_states", "/slave/measured_efforts",
    }  # fmt: skip
    for side in ("master", "slave"):
        messages = topics[f"/{side}/joint_states"]
        assert [stored for stored, _ in messages] == STAMPS.tolist()
        assert [stamp_of(message) for _, message in messages] == STAMPS.tolist()
        assert list(messages[0][1].name) == ["pan", "lift"]
        for part, what in (("position", "position"), ("velocity", "velocity"),
                           ("effort", "commanded")):  # fmt: skip
            places = [COLUMNS.index(f"{side}.{pair}.{what}") for pair in ("pan", "lift")]
            found = np.array([getattr(message, part) for _, message in messages])
            np.testing.assert_array_equal(found, ROWS[:, places])
    felt = np.array([message.effort for _, message in topics["/slave/measured_efforts"]])
    np.testing.assert_array_equal(felt[:, 0], ROWS[:, -1])


def test_rosbags_reads_it(bag: Path) -> None:
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_JAZZY)
    topics: dict[str, list[tuple[int, Any]]] = {}
    with AnyReader([bag], default_typestore=store) as reader:
        for connection, stored, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            topics.setdefault(connection.topic, []).append((stored, message))
    check(topics)


def test_mcap_ros2_support_reads_it(bag: Path) -> None:
    ros2: Any = pytest.importorskip("mcap_ros2.reader")
    topics: dict[str, list[tuple[int, Any]]] = {}
    [file] = bag.glob("*.mcap")
    for one in ros2.read_ros2_messages(str(file)):
        topics.setdefault(one.channel.topic, []).append((one.log_time_ns, one.ros_msg))
    check(topics)


def test_we_read_it_ourselves(bag: Path) -> None:
    name = "slave/joint_states.lift.position"
    found = read_columns(bag, [name], "time_s")
    np.testing.assert_allclose(np.diff(found["time_s"]), 0.001, atol=1e-12)
    np.testing.assert_array_equal(found[name], ROWS[:, COLUMNS.index("slave.lift.position")])


def test_columns_are_for_tables(tmp_path: Path) -> None:
    done = CliRunner().invoke(
        main, ["export", str(tmp_path), "--to", "rosbag", "--columns", "time_s"]
    )
    assert done.exit_code == 2
