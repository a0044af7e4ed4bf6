"""A run's rows on topics, over DDS on the loopback interface; Bools on their way back."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("cyclonedds")
pytest.importorskip("rosbags")

from cyclonedds.core import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from tautwave.cli.rigs import ros as cli
from tautwave.clock import MonotonicClock
from tautwave.config import load_rig
from tautwave.errors import ConfigError
from tautwave.view.ros import dead_man
from tautwave.view.ros.exporter import Exporter, refuse_rate
from tautwave.view.ros.messages import Bool, DiagnosticArray, JointState
from tautwave.view.ros.node import Node, check_namespace, configuration, taken
from tautwave.view.watched import Watched
from tests.commands import tautwave
from tests.view.served import BENCH, Run

LEVER = [f"slave.lever.{leaf}" for leaf in ("position", "velocity", "commanded", "valid")]
COLUMNS = ["time_s", "lateness_us", "skipped_slots", "lever.position_error", *LEVER]
DOMAIN = 100 + int("0" + os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw"))


@pytest.fixture(scope="module")
def node() -> Node:
    return Node("tautwave", "/left", DOMAIN)


@contextmanager
def exported(directory: Path, node: Node, *, allow_commands: bool = False) -> Iterator[Run]:
    """Export a run that is only its rows; both end with the block."""
    run = Run(directory, columns=COLUMNS)
    exporter = Exporter(
        Watched.of_run(directory), load_rig(BENCH), node, 100.0, allow_commands=allow_commands
    )
    thread = threading.Thread(target=exporter.export, args=(MonotonicClock(),))
    thread.start()
    try:
        yield run
    finally:
        run.close()
        thread.join(20)
    assert not thread.is_alive()


def commit(run: Run, seconds: float) -> None:
    """Commit rows at a rate; each second one has no sample of the lever."""
    for _ in range(round(seconds / 0.002)):
        run.recorder.row[4] = run.rows
        run.recorder.row[7] = run.rows % 2
        run.recorder.row[0] = 0.002 * run.rows
        run.recorder.commit()
        run.rows += 1
        time.sleep(0.002)


def subscribe(node: Node, reliability: Any, topic: str, message: Any) -> Any:
    place = Topic(node._participant, f"rt{topic}", message)
    return DataReader(node._participant, place, Qos(reliability, Policy.History.KeepAll))


def names(one: Any) -> set[str]:
    """Return what a diagnostic array is about."""
    return {status.name for status in one.status} if one.sample_info.valid_data else set()


@pytest.mark.slow
def test_joints_diagnostics_and_the_end_arrive(tmp_path: Path, node: Node) -> None:
    kinds = (Policy.Reliability.BestEffort, Policy.Reliability.Reliable(10**9))
    readers = [subscribe(node, kind, "/left/slave/joint_states", JointState) for kind in kinds]
    diagnostics = subscribe(node, kinds[1], "/diagnostics", DiagnosticArray)
    with exported(tmp_path, node) as run:
        commit(run, 0.6)
        while not any("bench: lever" in names(one) for one in diagnostics.read(99)):
            commit(run, 0.2)
    for reader in readers:
        states = [one for one in reader.take(200) if one.sample_info.valid_data]
        assert len(states) >= 10
        assert all(state.name == ["lever"] for state in states)
        numbers = [round(state.position[0]) for state in states]
        assert numbers == sorted(set(numbers))
        assert all(number % 2 for number in numbers)  # never a row without a sample
        stamps = [state.header.stamp.sec + 1e-9 * state.header.stamp.nanosec for state in states]
        assert stamps[-1] - stamps[0] == pytest.approx(0.002 * (numbers[-1] - numbers[0]))
        epoch_s = 1e-9 * Run.recorder_epoch_ns
        assert stamps[0] == pytest.approx(epoch_s + 0.002 * numbers[0], abs=1e-6)
    told = [{one.name: one.message for one in array.status} for array in taken(diagnostics)]
    levers = [one["bench: lever"] for one in told if "bench: lever" in one]
    assert levers[0].startswith("tracking error")
    assert told[-1] == {"bench: run": "the run has ended"}


def test_what_a_writer_leaves_behind_is_no_message(node: Node) -> None:
    writer = node.publisher("/tautwave/other", Bool)
    reader = node.subscription("/tautwave/other", Bool)
    writer.write(Bool(True))
    writer.dispose(Bool(True))
    assert [one.data for one in taken(reader)] == [True]


@pytest.mark.slow
def test_a_repeated_bool_reaches_the_run(tmp_path: Path, node: Node) -> None:
    person = node.publisher(dead_man.TOPIC, Bool)
    with exported(tmp_path, node, allow_commands=True) as run:
        commit(run, 0.3)
        for value in (False, True, True, False):
            person.write(Bool(value))
            commit(run, 0.05)
        orders = run.mailbox.source._source.take(0)  # type: ignore[attr-defined]
        words = [(order.word, order.source) for order in orders]
        assert words == [(word, "ros") for word in ("held", "engage", "held", "loose")]


def test_commands_need_a_rig_that_takes_them(tmp_path: Path, node: Node) -> None:
    run = Run(tmp_path, columns=COLUMNS, mailbox=None)
    watched = Watched.of_run(tmp_path)
    with pytest.raises(ConfigError, match="--allow-commands: this run accepts no commands"):
        Exporter(watched, load_rig(BENCH), node, 100.0, allow_commands=True)
    run.close()


def test_the_loopback_interface_unless_another_is_named() -> None:
    assert '<NetworkInterface name="lo"' in configuration("lo")
    assert '<Peer Address="10.0.0.7"/>' in configuration("lo", ["10.0.0.7"])
    for wrong, words in ((("nosuch0",), "--interface nosuch0: there are lo"),
                         (("lo", ["<x>"]), "--peer: give a numeric address")):  # fmt: skip
        with pytest.raises(ConfigError, match=words):
            configuration(*wrong)
    check_namespace("/")
    check_namespace("/lab/left_2")
    with pytest.raises(ConfigError, match="--namespace: must be names preceded by slashes"):
        check_namespace("left")


def test_what_is_faster_is_in_the_recording() -> None:
    refuse_rate(100.0)
    with pytest.raises(ConfigError, match=r"--rate 200: at most 100 Hz.*is in the recording"):
        refuse_rate(200.0)


def test_the_command_says_what_is_missing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found = tautwave("ros", tmp_path, cwd=tmp_path)
    assert (found.exit_code, found.stderr) == (2, f"{tmp_path}: no run in progress here\n")
    monkeypatch.setattr(cli, "find_spec", lambda name: None)
    found = tautwave("ros", tmp_path, cwd=tmp_path)
    assert found.exit_code == 2
    assert "pip install 'tautwave[ros]'" in found.stderr


def test_the_command_says_where_it_publishes_and_what_to_do_after_the_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = Run(tmp_path, columns=COLUMNS)
    export = Exporter.export

    def end_at_once(self: Exporter, clock: MonotonicClock) -> None:
        run.close()
        export(self, clock)

    monkeypatch.setattr(Exporter, "export", end_at_once)
    domain = DOMAIN + 64  # a process joins a domain with one configuration, and `node` has
    words = ("--domain", domain, "--namespace", "/left", "--allow-commands")
    found = tautwave("ros", tmp_path, *words, cwd=tmp_path)
    assert (found.exit_code, found.stderr) == (0, "")
    begin, end = found.stdout.splitlines()
    assert begin == f"domain {domain}, lo: /left/slave/joint_states, /diagnostics"
    assert end == (
        f"{tmp_path}: the run has ended; run `tautwave report {tmp_path}` to write its report"
    )
