"""The same drives in another process, on the virtual bus of this one, and from the command line."""

from __future__ import annotations

import json
import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from tautwave.clock import FakeClock, MonotonicClock
from tautwave.contracts import AxisSpec, BusSpec
from tautwave.errors import ConfigError, DriverError
from tautwave.multicast import only_its_group
from tautwave.registry import load_simulator
from tautwave_sim.canopen import simulator
from tautwave_sim.canopen.bench import CanopenBench, bench
from tautwave_sim.canopen.options import SimulatedCanopenOptions
from tautwave_sim.canopen.world import DriveBus
from tautwave_sim.wire.can_served import Gateway, PythonCan
from tests.sim.truths import truth

can = pytest.importorskip("can")
virtual = pytest.importorskip("can.interfaces.virtual")

NODE = {"id": 1, "rated_torque": 1.0, "counts_per_revolution": 4096}


def options(**keys: Any) -> SimulatedCanopenOptions:
    return SimulatedCanopenOptions.model_validate({"nodes": (NODE,), **keys})


def spec(*ids: int) -> BusSpec:
    axes = tuple(AxisSpec(f"slave.a{node}", node, "rotary", "impedance", 1.0) for node in ids)
    return BusSpec("arm", axes, 1000.0)


def frame(can_id: int, data: str) -> Any:
    return can.Message(arbitration_id=can_id, data=bytes.fromhex(data), is_extended_id=False)


def await_frame(bus: Any, can_id: int, timeout_s: float = 10.0) -> Any:
    end = time.monotonic() + timeout_s
    while time.monotonic() < end:
        message = bus.recv(0.1)
        if message is not None and message.arbitration_id == can_id:
            return message
    raise AssertionError(f"no frame {can_id:03X}")


def test_the_entry_point_is_this_plugin() -> None:
    assert load_simulator("canopen") is simulator


def test_where_the_drives_live() -> None:
    assert not simulator.served(options(interface="virtual"))
    assert simulator.served(options(interface="socketcan"))
    assert simulator.served(options(interface="udp_multicast"))


def test_a_node_that_is_not_listed_is_named() -> None:
    with pytest.raises(ConfigError, match=r"slave\.a7 has id 7"):
        simulator.make(options(), spec(7), [truth()], FakeClock())


def test_keys_of_the_driver_are_let_through_and_own_ones_checked() -> None:
    given = options(master_id=5, backend="raw", nodes=({**NODE, "eds": "x.eds"},))
    assert given.nodes[0].id == 1
    with pytest.raises(ValueError, match="quirk"):
        options(simulator={"quirks": {}})


def test_a_quirk_of_a_node_that_is_not_there_is_refused() -> None:
    with pytest.raises(ValueError, match="names node 77"):
        options(simulator={"nodes": {"77": {"starts_in_fault": True}}})


@pytest.mark.parametrize("faults", [{"queue_full": 0.1}, {"events": [{"kind": "queue_full"}]}])
def test_a_queue_that_is_the_interfaces_own_cannot_be_filled(faults: dict[str, Any]) -> None:
    given = options(interface="udp_multicast", simulator={"faults": faults})
    with pytest.raises(ConfigError, match=r"bus arm: simulator\.faults: queue_full would do"):
        simulator.serve(given, spec(1), [truth()], lambda _: None, lambda: True)


class Echoing:
    """An interface that returns what is sent on it, as udp_multicast does."""

    def __init__(self) -> None:
        self.frames: list[Any] = []

    def send(self, message: Any) -> None:
        self.frames.append(message)

    def recv(self, timeout: float) -> Any:
        return self.frames.pop(0) if self.frames else None

    def fileno(self) -> int:
        return -1


def test_own_frames_that_come_back_are_not_on_the_wire_again() -> None:
    world = DriveBus(options(), spec(1), [truth()], 0)
    seen: list[int] = []
    world.medium.listeners.append(lambda _, can_id, __: seen.append(can_id))
    interface = Echoing()
    gateway = Gateway(world, PythonCan(interface, FakeClock()))
    interface.send(frame(0x601, "4000100000000000"))
    for now_us in range(0, 3000, 100):
        gateway.run(now_us * 1000)
    assert seen == [0x701, 0x601, 0x581]


def test_an_interface_that_is_not_there_is_reported_with_a_way_out() -> None:
    with pytest.raises(DriverError, match=r"nowhere0.*udp_multicast"):
        simulator.serve(options(channel="nowhere0"), spec(1), [truth()], print, lambda: True)


def test_on_the_real_clock_frames_cross_a_virtual_bus_that_others_may_join() -> None:
    clock = MonotonicClock()
    made = simulator.make(options(interface="virtual", channel="join"), spec(1), [truth()], clock)
    listener = can.Bus(interface="virtual", channel="join")
    try:
        port: Any = made.transport
        assert clock.wait(port, clock.now_ns() + 30 * 10**9)
        assert port.receive()[:2] == (0x701, b"\0")
        begun = clock.now_ns()
        assert port.send(0x601, bytes.fromhex("4000100000000000"))
        assert clock.wait(port, clock.now_ns() + 30 * 10**9)
        can_id, data, arrival_ns = port.receive()
        assert (can_id, data) == (0x581, bytes.fromhex("4300100092010200"))
        assert arrival_ns - begun > 220_000  # two frames of at least 111 bits at 1 Mbit/s
        seen = [await_frame(listener, expected) for expected in (0x701, 0x601, 0x581)]
        assert [message.is_extended_id for message in seen] == [False] * 3
        listener.send(frame(0x000, "0101"))  # another master's word counts too
        listener.send(can.Message(arbitration_id=0x601, data=bytes(8), is_extended_id=True))
        end = clock.now_ns() + 30 * 10**9
        while made.world.devices[0].nmt.name != "OPERATIONAL" and clock.now_ns() < end:
            clock.wait(port, clock.now_ns() + 1_000_000)
        assert made.world.devices[0].nmt.name == "OPERATIONAL"
    finally:
        listener.shutdown()
        made.close()


def test_a_full_queue_on_the_virtual_bus() -> None:
    clock = MonotonicClock()
    made = simulator.make(
        options(interface="virtual", channel="full", bitrate=10_000), spec(1), [truth()], clock
    )
    try:
        reported = [made.transport.send(0x7FF, bytes(8)) for _ in range(15)]
        assert reported.count(False) >= 3
        assert reported[:10] == [True] * 10
    finally:
        made.close()
    assert "full" not in virtual.channels  # it has left the bus


@pytest.mark.parametrize("kind", ["rotary", "linear"])
def test_a_bench_is_a_bus_of_free_drives(kind: Any) -> None:
    given = bench(CanopenBench(nodes=(3, 4), interface="virtual", kind=kind))
    made = simulator.make(given.options, given.bus, given.physics, FakeClock())
    assert [device.id for device in made.world.devices] == [3, 4]
    scale = made.world.devices[0].drive.motor.scale
    assert scale.position == given.physics[0].encoder_quantum
    assert scale.effort == given.physics[0].effort_quantum


MAIN = "import sys; from tautwave.cli import main; sys.exit(main())"
GROUP = f"239.74.{1 + os.getpid() % 250}.77"


@contextmanager
def process(*words: str) -> Iterator[tuple[subprocess.Popen[str], dict[str, Any]]]:
    command = [sys.executable, "-c", MAIN, "sim", "canopen", *words]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as child:
        try:
            assert child.stdout is not None
            ready, _, _ = select.select([child.stdout], [], [], 90.0)
            assert ready
            yield child, json.loads(child.stdout.readline())
        finally:
            child.send_signal(signal.SIGTERM)
            assert child.wait(60.0) == 0


@pytest.mark.slow
def test_drives_in_another_process() -> None:
    pytest.importorskip("msgpack")
    try:
        bus = can.Bus(interface="udp_multicast", channel=GROUP)
    except OSError as err:
        pytest.skip(f"no multicast here: {err}")
    only_its_group(bus)
    try:
        with process("--nodes", "1,2", "--interface", "udp_multicast", "--channel", GROUP) as found:
            assert found[1] == {
                "driver": "canopen",
                "endpoint": f"udp_multicast:{GROUP}",
                "nodes": [1, 2],
                "options": {},
            }
            bus.send(frame(0x602, "4000100000000000"))
            response = await_frame(bus, 0x582)
            assert bytes(response.data) == bytes.fromhex("4300100092010200")
            bus.send(frame(0x601, "2B17100032000000"))  # heartbeat every 50 ms
            assert bytes(await_frame(bus, 0x701).data) == b"\x7f"
            bus.send(frame(0x000, "0100"))
            for _ in range(3):
                beat = await_frame(bus, 0x701)
            assert bytes(beat.data) == b"\x05"
    finally:
        bus.shutdown()
