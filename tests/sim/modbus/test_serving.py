"""Real sockets: how connections fail and come back, and what `tautwave sim modbus` takes."""

from __future__ import annotations

import contextlib
import socket
import struct
import subprocess
import sys
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from pydantic import ValidationError

from tautwave.clock import MonotonicClock
from tautwave.contracts import AxisSpec, BusSpec
from tautwave.errors import ConfigError, DriverError
from tautwave_sim.modbus import simulator
from tautwave_sim.modbus.bus import DriveBus
from tautwave_sim.modbus.options import ModbusBenchOptions
from tautwave_sim.modbus.wire.framing import tcp_frame
from tautwave_sim.modbus.wire.serving import TcpServer, serve_bus
from tautwave_sim.modbus.wire.tcp import TcpSide
from tests.sim.modbus.masters import read, read_write, write_one
from tests.sim.truths import PERIOD, truth

Script = Iterator[None]
IDENTITY = bytes.fromhex("03 02 5457")


def options(**more: Any) -> Any:
    block = {"link": "tcp", "endpoint": "sim", "devices": [{"unit": 1}], **more}
    return simulator.options.model_validate(block)


SPEC = BusSpec("modbus", (AxisSpec("slave.x", 1, "rotary", "impedance", 10.0),), 1.0 / PERIOD)


def run(script: Callable[[int], Script], *events: dict[str, Any]) -> None:
    """Serve a drive for as long as the script goes on; both take turns in this thread."""
    bus = DriveBus(options(simulator={"faults": {"events": list(events)}}), SPEC, [truth()])
    server = TcpServer(TcpSide(bus, (1,), wire=False), ("127.0.0.1", 0))
    try:
        turns = script(server.port)
        server.run(lambda: next(turns, turns) is turns)
    finally:
        server.close()


class Client:
    """A master that never blocks the server beside it."""

    def __init__(self, port: int) -> None:
        self.sock = socket.create_connection(("127.0.0.1", port), timeout=30.0)
        self.sock.setblocking(False)
        self.got = b""

    def ask(self, pdu: bytes, turns: int = 40) -> Iterator[None]:
        """Send a request and take turns until something comes, or nothing for many."""
        self.got = b""
        self.sock.send(tcp_frame(1, 1, pdu))
        for _ in range(turns):
            yield
            with contextlib.suppress(BlockingIOError):
                self.got = self.sock.recv(4096)
                return

    def move(self) -> Iterator[None]:
        """Have the drive begin to move."""
        for pdu in (write_one(17, 2), write_one(16, 1), read_write(2, 7, 18, 10)):
            yield from self.ask(pdu)
            assert self.got[7] < 0x80

    def close(self) -> None:
        self.sock.close()


def test_two_masters_at_once() -> None:
    def script(port: int) -> Script:
        one, other = Client(port), Client(port)
        yield from one.ask(read(0))
        yield from other.ask(read(1))
        assert one.got == tcp_frame(1, 1, IDENTITY)
        assert other.got == tcp_frame(1, 1, bytes.fromhex("03 02 0001"))
        one.close()
        yield from other.ask(read(0))
        assert other.got == tcp_frame(1, 1, IDENTITY)
        other.close()

    run(script)


@pytest.mark.slow
def test_a_request_that_comes_in_pieces() -> None:
    def script(port: int) -> Script:
        client = Client(port)
        for byte in tcp_frame(1, 1, read(0)):
            client.sock.send(bytes([byte]))
            yield
        for _ in range(10):
            yield
            with contextlib.suppress(BlockingIOError):
                client.got += client.sock.recv(4096)
        assert client.got == tcp_frame(1, 1, IDENTITY)
        client.close()

    run(script)


def test_a_master_that_resets_takes_nobody_with_it() -> None:
    def script(port: int) -> Script:
        rude, other = Client(port), Client(port)
        yield from rude.ask(read(0))
        rude.sock.send(tcp_frame(1, 1, read(0)))
        rude.sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        rude.close()
        for _ in range(5):
            yield
        yield from other.ask(read(0))
        assert other.got == tcp_frame(1, 1, IDENTITY)
        other.close()

    run(script)


def test_a_reset_reaches_the_master() -> None:
    def script(port: int) -> Script:
        client = Client(port)
        with pytest.raises(ConnectionResetError):
            yield from client.ask(read(0))
        client.close()
        again = Client(port)
        yield from again.ask(read(0))
        assert again.got == tcp_frame(1, 1, IDENTITY)
        again.close()

    run(script, {"kind": "reset"})


@pytest.mark.slow
def test_a_server_is_gone_and_back() -> None:
    def script(port: int) -> Script:
        client = Client(port)
        yield from client.move()
        with pytest.raises(ConnectionResetError):
            yield from client.ask(read(0))
        client.close()
        yield
        with pytest.raises(ConnectionRefusedError):
            Client(port)
        clock = MonotonicClock()
        back = clock.now_ns() + 300_000_000
        while clock.now_ns() < back:
            yield
        again = Client(port)
        yield from again.ask(read(0))
        assert again.got == tcp_frame(1, 1, IDENTITY)
        again.close()

    run(script, {"kind": "gone", "nth": 4, "duration_s": 0.2})


def test_half_open_is_silence() -> None:
    def script(port: int) -> Script:
        client = Client(port)
        yield from client.ask(read(0))
        yield from client.ask(read(0), turns=3)
        assert client.got == b""
        with pytest.raises(BlockingIOError):
            client.sock.recv(1)  # and no end of it either
        client.close()
        again = Client(port)
        yield from again.ask(read(0))
        assert again.got == tcp_frame(1, 1, IDENTITY)
        again.close()

    run(script, {"kind": "half_open", "nth": 2})


def test_refused_leaves_what_is_connected() -> None:
    def script(port: int) -> Script:
        client = Client(port)
        yield from client.ask(read(0))
        assert client.got == tcp_frame(1, 1, IDENTITY)
        yield
        with pytest.raises(ConnectionRefusedError):
            Client(port)
        yield from client.ask(read(0))
        assert client.got == tcp_frame(1, 1, IDENTITY)
        client.close()

    run(script, {"kind": "refused"})


def test_a_port_that_is_taken_is_named() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        for server in ("own", "pymodbus"):
            block = options(endpoint=f"tcp://127.0.0.1:{port}", simulator={"server": server})
            with pytest.raises(DriverError, match=f"cannot listen on 127.0.0.1:{port}"):
                serve_bus(block, SPEC, [truth()], lambda found: None, lambda: True)


def test_an_endpoint_that_is_none_is_named() -> None:
    with pytest.raises(ConfigError, match="'here' is not HOST:PORT"):
        serve_bus(options(endpoint="here"), SPEC, [truth()], lambda found: None, lambda: True)


def test_there_is_one_server_for_all() -> None:
    block = options(devices=[{"unit": 1, "endpoint": "tcp://10.0.0.2:502"}])
    with pytest.raises(ConfigError, match="unit 1: simulated drives are served on one endpoint"):
        serve_bus(block, SPEC, [truth()], lambda found: None, lambda: True)


def test_only_endpoint_sim_has_a_process_of_its_own() -> None:
    assert simulator.served(options())
    assert not simulator.served(options(endpoint="tcp://10.0.0.2:502"))


def test_an_axis_needs_its_device_and_a_quirk_its_drive() -> None:
    clock = MonotonicClock()
    with pytest.raises(ConfigError, match=r"axis slave\.x is unit 1, which is not among"):
        simulator.make(options(devices=[{"unit": 2}]), SPEC, [truth()], clock)
    with pytest.raises(ConfigError, match="names unit 5"):
        simulator.make(options(simulator={"devices": {5: {}}}), SPEC, [truth()], clock)
    late = {"faults": {"events": [{"kind": "answer_late", "nth": 3, "unit": 5}]}}
    with pytest.raises(ConfigError, match="answer_late is for unit 5"):
        simulator.make(options(simulator=late), SPEC, [truth()], clock)


def test_keys_that_are_the_drivers_are_none_of_its_business() -> None:
    block = options(timeout_s=0.1, devices=[{"unit": 1, "velocity_loop": 3}])
    assert block.devices[0].unit == 1
    with pytest.raises(ValueError, match="fautls"):
        options(simulator={"fautls": {}})


def test_the_plugin_alone_is_light() -> None:
    code = (
        "import sys; import tautwave_sim.modbus; "
        "heavy = {'pymodbus', 'serial', 'tautwave_sim.canopen', 'tautwave_sim.axis'}; "
        "sys.exit(str(sorted(heavy & set(sys.modules))) if heavy & set(sys.modules) else 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_a_bench_of_drives() -> None:
    assert simulator.bench is not None
    assert simulator.bench_options is not None
    made = simulator.bench(
        simulator.bench_options(profile="cia402", rtu=True, units=(3, 4), causality="admittance")
    )
    assert (made.options.link, made.options.endpoint) == ("rtu", "sim")
    assert [axis.device_id for axis in made.bus.axes] == [3, 4]
    assert all(model.servo is not None for model in made.physics)
    made = simulator.bench(simulator.bench_options(rate_hz=500.0))
    assert (made.bus.rate_hz, [model.period for model in made.physics]) == (500.0, [0.002])
    with pytest.raises(ConfigError, match="not both"):
        simulator.bench(simulator.bench_options(rtu=True, tcp="127.0.0.1:0"))
    with pytest.raises(ConfigError, match="no simulated drives of profile 'dsy'"):
        simulator.bench(simulator.bench_options(profile="dsy"))


@pytest.mark.parametrize("parity", ["N", "E"])
def test_a_pseudo_terminal_says_that_it_has_no_parity(parity: str) -> None:
    assert simulator.bench is not None
    assert simulator.bench_options is not None
    assert simulator.serve is not None
    made = simulator.bench(simulator.bench_options(rtu=True, parity=parity))
    reported: list[Any] = []
    simulator.serve(*made, reported.append, lambda: True)
    assert ("open it with parity N" in reported[0].get("note", "")) == (parity == "E")


@pytest.mark.parametrize(
    ("given", "reported"),
    [
        ({"units": (1, 1)}, "--units 1, 1: two drives cannot share an id"),
        ({"rtu": True, "server": "pymodbus"}, "serves TCP only"),
        ({"tcp": "127.0.0.1"}, "'127.0.0.1' is not HOST:PORT"),
        ({"tcp": "127.0.0.1:99999"}, "'127.0.0.1:99999' is not HOST:PORT"),
    ],
)
def test_a_bench_that_cannot_be_is_refused(given: dict[str, Any], reported: str) -> None:
    assert simulator.bench is not None
    with pytest.raises(ConfigError, match=reported):
        simulator.bench(ModbusBenchOptions(**given))


@pytest.mark.parametrize("units", [(), (-1,), (256,)])
def test_units_are_those_of_the_standard(units: tuple[int, ...]) -> None:
    with pytest.raises(ValidationError, match="units"):
        ModbusBenchOptions(units=units)


def test_the_address_that_was_asked_for_is_announced() -> None:
    for host, reached in (("127.0.0.2", "127.0.0.2"), ("0.0.0.0", "127.0.0.1")):
        reported: list[Any] = []
        serve_bus(
            options(endpoint=f"tcp://{host}:0"), SPEC, [truth()], reported.append, lambda: True
        )
        assert reported[0]["endpoint"].startswith(f"tcp://{reached}:")
