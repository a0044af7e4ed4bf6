"""Other people's masters and servers: mbpoll (libmodbus) and pymodbus, on real endpoints."""

from __future__ import annotations

import re
import time
from collections.abc import Iterator
from typing import Any

import pytest

from tautwave_sim.modbus.wire.framing import open_rtu, rtu_frame
from tests.sim.modbus.masters import read_write
from tests.sim.modbus.served import mbpoll, served

pytestmark = pytest.mark.realtime

pymodbus_client = pytest.importorskip("pymodbus.client")

# 8N2: a pseudo-terminal has no parity, and pyserial's second try to set one is an EINVAL.
WAYS = {
    "tcp": ("--tcp", "127.0.0.1:0"),
    "rtu": ("--rtu", "--baud", "115200", "--stop-bits", "2"),
    "pymodbus": ("--tcp", "127.0.0.1:0", "--server", "pymodbus"),
}


@pytest.fixture(scope="module", params=sorted(WAYS))
def drives(request: pytest.FixtureRequest) -> Iterator[dict[str, Any]]:
    """Two generic drives, whose words for mbpoll are in `words`."""
    with served("--units", "1,2", *WAYS[request.param]) as found:
        endpoint = found["endpoint"]
        if request.param == "rtu":
            words = ["-m", "rtu", "-b", "115200", "-P", "none", "-s", "2"]
            yield {**found, "way": request.param, "words": words, "where": endpoint}
        else:
            host, port = endpoint.removeprefix("tcp://").split(":")
            words = ["-m", "tcp", "-p", port]
            yield {**found, "way": request.param, "words": words, "where": host}


def polled(text: str) -> list[int]:
    return [int(value) for value in re.findall(r"^\[\d+\]:\s+(-?\d+)", text, re.MULTILINE)]


@pytest.mark.sparse(3)
def test_what_is_announced_leads_a_driver_there(drives: dict[str, Any]) -> None:
    assert drives["driver"] == "modbus"
    assert drives["options"] == {"endpoint": drives["endpoint"]}
    assert drives["units"] == [1, 2]
    begin = "/dev/" if drives["way"] == "rtu" else "tcp://127.0.0.1:"
    assert drives["endpoint"].startswith(begin)


@pytest.mark.parametrize("unit", ["1", "2"])
def test_mbpoll_reads_and_writes(drives: dict[str, Any], unit: str) -> None:
    begin = [*drives["words"], "-a", unit]
    code, said = mbpoll(*begin, "-r", "0", "-c", "9", drives["where"])
    assert (code, polled(said)) == (0, [0x5457, 1, 1, 0, 0, 0, 0, 0, 0]), said
    code, said = mbpoll(*begin, "-r", "17", drives["where"], "2")
    assert code == 0, said
    code, said = mbpoll(*begin, "-t", "4:int", "-B", "-r", "19", drives["where"], "70000")
    assert code == 0, said
    code, said = mbpoll(*begin, "-r", "17", "-c", "4", drives["where"])
    assert (code, polled(said)) == (0, [2, 0, 1, 4464]), said
    code, said = mbpoll(*begin, "-t", "3", "-r", "0", drives["where"])
    assert (code, polled(said)) == (0, [0x5457]), said


def test_mbpoll_understands_the_exceptions(drives: dict[str, Any]) -> None:
    begin = [*drives["words"], "-a", "1"]
    code, said = mbpoll(*begin, "-r", "9", drives["where"])
    assert code != 0
    assert "Illegal data address" in said
    code, said = mbpoll(*begin, "-r", "17", drives["where"], "9")
    assert code != 0
    assert "Illegal data value" in said
    code, said = mbpoll(*begin, "-t", "0", "-r", "0", drives["where"])
    assert code != 0
    assert "Illegal function" in said


def connected(drives: dict[str, Any]) -> Any:
    if drives["way"] == "rtu":
        return pymodbus_client.ModbusSerialClient(
            drives["where"], baudrate=115200, parity="N", stopbits=2, timeout=20, retries=0
        )
    port = int(drives["endpoint"].rpartition(":")[2])
    return pymodbus_client.ModbusTcpClient("127.0.0.1", port=port, timeout=20, retries=0)


def test_pymodbus_switches_a_drive_on_and_moves_it(drives: dict[str, Any]) -> None:
    with connected(drives) as client:
        assert not client.write_register(17, 2, device_id=2).isError()
        assert not client.write_register(16, 1, device_id=2).isError()
        response = client.readwrite_registers(
            read_address=2, read_count=7, write_address=18, values=[100], device_id=2
        )
        assert response.registers[0] == 3
        position = 0
        deadline = time.monotonic() + 60.0
        while position <= 100 and time.monotonic() < deadline:
            response = client.read_holding_registers(2, count=7, device_id=2)
            position = client.convert_from_registers(
                response.registers[2:4], client.DATATYPE.INT32, word_order="big"
            )
        assert position > 100
        assert response.registers[6] == 100
        assert not client.write_registers(16, [0], device_id=2).isError()
        assert client.read_holding_registers(2, count=1, device_id=2).registers == [1]


def test_pymodbus_understands_the_exceptions(drives: dict[str, Any]) -> None:
    with connected(drives) as client:
        assert client.read_holding_registers(9, count=1, device_id=1).exception_code == 2
        assert client.write_register(17, 9, device_id=1).exception_code == 3
        assert client.write_register(2, 9, device_id=1).exception_code == 2
        assert client.read_coils(0, count=1, device_id=1).exception_code == 1


def test_pymodbus_broadcasts(drives: dict[str, Any]) -> None:
    with connected(drives) as client:
        client.write_register(22, 777, device_id=0, no_response_expected=True)
        for unit in (1, 2):
            time.sleep(0.02)  # the silence that ends a frame, which pymodbus does not keep
            got = client.read_holding_registers(22, count=1, device_id=unit)
            assert got.registers == [777]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("baud", "words"), [(115200, ()), (38400, ("--turnaround-s", "0.005"))], ids=["plain", "slow"]
)
def test_a_served_line_answers_no_earlier_than_its_wire_allows(
    baud: int, words: tuple[str, ...]
) -> None:
    serial = pytest.importorskip("serial")
    request = rtu_frame(1, read_write(2, 6, 18, 0, 0, 0, 0))
    least = (len(request) + 17) * 11 / baud + 1.75e-3 + (0.005 if words else 0.0)
    with (
        served("--rtu", "--stop-bits", "2", "--baud", str(baud), *words) as found,
        serial.Serial(found["endpoint"], baud, stopbits=2, timeout=30.0) as line,
    ):
        for _ in range(20):
            begin = time.monotonic_ns()
            line.write(request)
            response = line.read(17)
            assert (time.monotonic_ns() - begin) * 1e-9 >= least
            assert open_rtu(response) is not None
            time.sleep(0.002)
