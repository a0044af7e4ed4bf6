"""Another DDS, and the network: an exporter, and Fast DDS as ROS 2 uses it by default."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("cyclonedds")
pytest.importorskip("rosbags")

from rosbags.typesys import Stores, get_typestore

from tests.view.test_page import ALONE, ROOT, can_be_alone

pytestmark = [pytest.mark.slow, pytest.mark.realtime, pytest.mark.timeout(300)]
SOURCE = Path(__file__).with_name("peer.cpp")
JAZZY = get_typestore(Stores.ROS2_JAZZY)
JOINTS, NODES = "sensor_msgs/msg/JointState", "rmw_dds_common/msg/ParticipantEntitiesInfo"


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Compile the peer and run all of it; CI does not allow that Fast DDS is missing."""
    if shutil.which("g++") is None or not Path("/usr/include/fastdds").exists():
        reason = "Fast DDS or g++ is not installed: apt-get install g++ libfastrtps-dev"
        if os.environ.get("CI") == "true":
            pytest.fail(reason)
        pytest.skip(reason)
    if not can_be_alone() or shutil.which("ip") is None:
        pytest.skip("no network namespace of its own here")
    folder = tmp_path_factory.mktemp("ros")
    peer = folder / "peer"
    words = ["g++", "-std=c++17", "-O0", str(SOURCE), "-lfastrtps", "-lfastcdr", "-o", str(peer)]
    subprocess.run(words, check=True, capture_output=True)
    order = [*ALONE, sys.executable, "-m", "tests.view.ros.alone", str(folder), str(peer)]
    done = subprocess.run(order, cwd=ROOT, capture_output=True, text=True, check=False, timeout=280)
    assert done.returncode == 0, done.stderr
    return dict(json.loads(done.stdout))


def got(seen: dict[str, Any], label: str) -> list[bytes]:
    lines = (line.split() for line in seen["lines"])
    return [bytes.fromhex(words[2]) for words in lines if words[:2] == ["got", label]]


def by_stamp(messages: list[bytes]) -> dict[tuple[int, int], bytes]:
    found = {}
    for message in messages:
        stamp = JAZZY.deserialize_cdr(message, JOINTS).header.stamp
        found[stamp.sec, stamp.nanosec] = message.ljust(-(-len(message) // 4) * 4, b"\0")
    return found


def test_it_discovers_types_hashes_and_the_node(seen: dict[str, Any]) -> None:
    writers = {line.split()[1]: line.split()[2:] for line in seen["lines"] if line[:6] == "writer"}
    for topic, name in (
        ("rt/master/joint_states", JOINTS), ("rt/slave/joint_states", JOINTS),
        ("rt/diagnostics", "diagnostic_msgs/msg/DiagnosticArray"), ("ros_discovery_info", NODES),
    ):  # fmt: skip
        package, _, last = name.split("/")
        hashed = f"typehash={JAZZY.hash_rihs01(name)};"
        assert writers[topic] == [f"{package}::msg::dds_::{last}_", hashed]
    assert "participant enclave=/;" in seen["lines"]
    nodes = [JAZZY.deserialize_cdr(one, NODES) for one in got(seen, "nodes")]
    named = {node.node_name: node for one in nodes for node in one.node_entities_info_seq}
    assert len(named["tautwave"].writer_gid_seq) == 3
    assert len(named["tautwave"].reader_gid_seq) == 1


@pytest.mark.parametrize("reliability", ["reliable", "best_effort"])
def test_it_receives_what_our_own_dds_does(seen: dict[str, Any], reliability: str) -> None:
    theirs, ours = by_stamp(got(seen, reliability)), by_stamp(map(bytes.fromhex, seen["seen"]))
    begin, end = max(min(theirs), min(ours)), min(max(theirs), max(ours))
    common = {stamp for stamp in ours if begin <= stamp <= end}
    assert len(common) > 200
    assert len(common & set(theirs)) >= 0.95 * len(common)
    assert all(theirs[stamp] == ours[stamp] for stamp in common & set(theirs))


def test_its_dead_man_reaches_the_run(seen: dict[str, Any]) -> None:
    words = [word for word, source in seen["orders"] if source == "ros"]
    assert words[:2] == ["held", "engage"]
    assert words.count("engage") == 1
    assert words.count("held") > 20
    assert words[-1] == "loose"  # it fell silent


def test_nothing_leaves_the_machine_unless_an_interface_is_named(seen: dict[str, Any]) -> None:
    assert seen["away"] == 0
    assert seen["peer_away"] > 0  # Fast DDS by itself uses all there are, and is counted


def test_a_killed_exporter_costs_the_run_nothing(seen: dict[str, Any]) -> None:
    assert seen["killed"] < seen["rows"] == seen["recorded"]
