"""canopen's own master, BaseNode402 with its Notifier thread, on our simulated drives."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from tautwave.errors import ConfigError
from tautwave_sim.canopen import simulator
from tautwave_sim.canopen.bench import CanopenBench, bench

canopen = pytest.importorskip("canopen")
p402 = pytest.importorskip("canopen.profiles.p402")

U8, U16, U32, I8, I16, I32 = 5, 6, 7, 2, 3, 4
SINGLE = (
    (0x6040, U16, "Controlword"),
    (0x6041, U16, "Statusword"),
    (0x6060, I8, "Modes of operation"),
    (0x6061, I8, "Modes of operation display"),
    (0x6064, I32, "Position actual value"),
    (0x606C, I32, "Velocity actual value"),
    (0x6071, I16, "Target torque"),
    (0x6077, I16, "Torque actual value"),
    (0x607A, I32, "Target position"),
    (0x6083, U32, "Profile acceleration"),
    (0x6098, I8, "Homing method"),
    (0x60FF, I32, "Target velocity"),
    (0x6502, U32, "Supported drive modes"),
)


def dictionary() -> Any:
    """The part of a CiA 402 EDS that BaseNode402 needs, written from canopen's point of view."""
    variables = canopen.objectdictionary
    od = variables.ObjectDictionary()

    def variable(name: str, index: int, sub: int, kind: int) -> Any:
        entry = variables.ODVariable(name, index, sub)
        entry.data_type = kind
        entry.access_type = "rw"
        entry.pdo_mappable = True
        return entry

    for index, kind, name in SINGLE:
        od.add_object(variable(name, index, 0, kind))
    heartbeat = variable("Producer heartbeat time", 0x1017, 0, U16)
    od.add_object(heartbeat)
    for number in range(4):
        for base, what in ((0x1400, "RPDO"), (0x1800, "TPDO")):
            record = variables.ODRecord(f"{what} {number + 1} communication", base + number)
            for sub, kind, name in (
                (0, U8, "count"),
                (1, U32, "COB-ID"),
                (2, U8, "type"),
                (3, U16, "inhibit time"),
                (5, U16, "event timer"),
            ):
                record.add_member(variable(name, base + number, sub, kind))
            od.add_object(record)
            array = variables.ODRecord(f"{what} {number + 1} mapping", base + 0x200 + number)
            array.add_member(variable("count", base + 0x200 + number, 0, U8))
            for sub in range(1, 9):
                array.add_member(variable(f"object {sub}", base + 0x200 + number, sub, U32))
            od.add_object(array)
    return od


@contextmanager
def drives(channel: str, *ids: int) -> Iterator[None]:
    """Simulated drives on a virtual bus, in a thread."""
    given = bench(CanopenBench(nodes=ids, interface="virtual", channel=channel, damping=1e-4))
    ready, stop = threading.Event(), threading.Event()
    thread = threading.Thread(
        target=simulator.serve, args=(*given, lambda _: ready.set(), stop.is_set), daemon=True
    )
    thread.start()
    try:
        assert ready.wait(10.0)
        yield
    finally:
        stop.set()
        thread.join(10.0)


@contextmanager
def master(channel: str, node_id: int) -> Iterator[Any]:
    network = canopen.Network()
    network.connect(interface="virtual", channel=channel)
    try:
        node = p402.BaseNode402(node_id, dictionary())
        node.sdo.RESPONSE_TIMEOUT = 5.0  # a busy machine
        for name in ("SWITCH_OP_MODE", "SWITCH_STATE_FINAL", "SWITCH_STATE_SINGLE", "CHECK_TPDO"):
            setattr(node, f"TIMEOUT_{name}", 10.0)
        network.add_node(node)
        node.sdo["Producer heartbeat time"].raw = 20
        node.nmt.wait_for_heartbeat(timeout=10.0)
        assert node.nmt.state == "PRE-OPERATIONAL"
        yield node
    finally:
        network.disconnect()


def wait_until(what: Any) -> None:
    end = time.monotonic() + 20.0
    while not what():
        assert time.monotonic() < end
        time.sleep(0.01)


def moved(node: Any, counts: int) -> None:
    start = node.sdo["Position actual value"].raw
    wait_until(lambda: abs(node.sdo["Position actual value"].raw - start) > counts)


@pytest.mark.sparse(2)
@pytest.mark.parametrize("pdos", ["as found", "by SDO only"])
def test_it_enables_the_drive_and_moves_it_in_profile_velocity(pdos: str) -> None:
    with drives(f"pv {pdos}", 5), master(f"pv {pdos}", 5) as node:
        if pdos == "as found":
            node.setup_402_state_machine()
        node.nmt.state = "OPERATIONAL"
        node.op_mode = "PROFILED VELOCITY"
        assert node.op_mode == "PROFILED VELOCITY"
        node.state = "OPERATION ENABLED"
        assert node.state == "OPERATION ENABLED"
        node.sdo["Profile acceleration"].raw = 100_000
        node.sdo["Target velocity"].raw = 8192  # two turns per second
        wait_until(lambda: abs(node.sdo["Velocity actual value"].raw - 8192) < 200)
        moved(node, 1000)
        assert node.sdo["Statusword"].raw & 0x400  # target reached
        node.sdo["Target velocity"].raw = 0
        wait_until(lambda: abs(node.sdo["Velocity actual value"].raw) < 200)
        node.state = "SWITCHED ON"
        assert node.state == "SWITCHED ON"


@pytest.mark.slow
def test_it_moves_the_drive_in_cyclic_synchronous_torque() -> None:
    with drives("cst", 5, 6), master("cst", 5) as node:
        node.setup_402_state_machine()
        node.nmt.state = "OPERATIONAL"
        node.op_mode = "CYCLIC SYNCHRONOUS TORQUE"
        node.state = "OPERATION ENABLED"
        node.sdo["Target torque"].raw = 20
        moved(node, 1000)
        assert node.sdo["Torque actual value"].raw == 20
        assert node.sdo["Velocity actual value"].raw > 0
        node.sdo["Target torque"].raw = -40
        wait_until(lambda: node.sdo["Velocity actual value"].raw < 0)
        node.state = "SWITCH ON DISABLED"
        assert node.sdo["Torque actual value"].raw == 0


def test_it_homes_the_drive() -> None:
    with drives("hm", 5), master("hm", 5) as node:
        node.sdo["TPDO 1 communication"]["event timer"].raw = 10  # it waits for the next one
        node.setup_402_state_machine()
        node.nmt.state = "OPERATIONAL"
        node.op_mode = "CYCLIC SYNCHRONOUS TORQUE"
        node.state = "OPERATION ENABLED"
        node.sdo["Target torque"].raw = 5
        moved(node, 100)
        node.sdo["Homing method"].raw = 35
        assert node.homing(timeout=10.0)
        assert abs(node.sdo["Position actual value"].raw) < 400


def test_it_maps_pdos_and_drives_through_them() -> None:
    with drives("pdo", 5), master("pdo", 5) as node:
        node.tpdo.read()
        node.rpdo.read()
        status = node.tpdo[1]
        status.clear()
        for index in (0x6041, 0x6061):
            status.add_variable(index)
        status.trans_type, status.event_timer, status.enabled = 255, 10, True
        command = node.rpdo[1]
        command.clear()
        for index in (0x6040, 0x6060, 0x6071):
            command.add_variable(index)
        command.trans_type, command.enabled = 255, True
        node.tpdo.save()
        node.rpdo.save()
        node.nmt.state = "OPERATIONAL"
        node.setup_402_state_machine(read_pdos=False)
        node.op_mode = "CYCLIC SYNCHRONOUS TORQUE"
        node.state = "OPERATION ENABLED"
        command["Target torque"].raw = 20
        command.transmit()
        moved(node, 500)


def test_two_nodes_with_one_id_are_refused() -> None:
    with pytest.raises(ConfigError, match=r"--nodes 1, 2, 1: two nodes cannot share an id"):
        bench(CanopenBench(nodes=(1, 2, 1)))
