"""`tautwave scan dynamixel`: every servo on a line, at every baud rate, in both protocols."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Annotated, Any

from pydantic import BaseModel, Field

from tautwave.clock import MonotonicClock
from tautwave.contracts import BytePort, Clock, ScanProgress, no_progress
from tautwave.errors import ConfigError
from tautwave_drivers import protocol1
from tautwave_drivers.adapter import adapter_of
from tautwave_drivers.dynamixel.line.transactions import PacketLine, Protocol1Line, ping_all
from tautwave_drivers.dynamixel.options import LAST_ID, STRICT, Protocol
from tautwave_drivers.dynamixel.protocol import registers as reg
from tautwave_drivers.dynamixel.protocol.families import family_of
from tautwave_drivers.dynamixel.protocol.messages import hardware_text, protocol1_text
from tautwave_drivers.dynamixel.protocol.models import FIRST_NAMES, model_name
from tautwave_drivers.dynamixel.protocol.registers import Register
from tautwave_drivers.serial_port import SerialPort
from tautwave_drivers.serial_ports import ports_found

LATENCY_S = 0.002
"""Of adapters with an unknown latency timer; FTDI's is known, 16 ms unless set."""

HOST_S = 0.005
"""Of this machine, for each of the many unused ids in protocol 1.0."""

FIRST_ID, FEETECH_ID = 3, 5
"""Where a servo of protocol 1.0 has its id, and one of Feetech (SCS and STS series), which answers
the same packets."""

FEETECH = "no Dynamixel (a Feetech servo)"

TRIES = 3
"""Pings of an id that was given; a busy host can miss a response."""


class ScanOptions(BaseModel):
    """Options of `tautwave scan dynamixel`."""

    model_config = STRICT

    port: str = Field(
        default="",
        description="Serial device, e.g. /dev/ttyUSB0; if omitted, lists the ports present.",
    )
    baud: Annotated[int, Field(ge=9600)] | None = Field(
        default=None, description="Only this baud rate; else all of the X series."
    )
    protocol: Protocol | None = Field(
        default=None, description="Only protocol 2.0 or 1.0; else both."
    )
    ids: list[Annotated[int, Field(ge=0, le=252)]] = Field(
        default=[], description="Only these ids, e.g. 1,2 or 1-6; else all. Faster in protocol 1.0."
    )


def scan(options: ScanOptions, progress: ScanProgress = no_progress) -> Sequence[dict[str, Any]]:
    """Return every servo found: baud, protocol, id, model, firmware, supply and errors.

    Limits are the servo's own, [A] and [rad/s].

    Raises
    ------
    ConfigError
        No port is given; it names those that are found.
    DriverError
        The device cannot be opened, or was lost.
    """
    if not options.port:
        raise ConfigError(f"scan dynamixel: --port is missing; {ports_found()}")
    clock = MonotonicClock()
    bauds = [options.baud] if options.baud else list(reg.BAUDS.values())
    rows: list[dict[str, Any]] = []
    found_s = adapter_of(options.port).found_s
    latency_s = LATENCY_S if found_s is None else found_s
    port = SerialPort(options.port, bauds[0])
    try:
        for at, baud in enumerate(bauds):
            progress(at / len(bauds), f"{baud} baud, {len(rows)} found")
            try:
                port.set_baud(baud)
            except OSError:
                continue  # the adapter does not support this rate
            rows.extend(find_at_baud(port, clock, baud, options, latency_s))
    finally:
        port.close()
    return rows


def find_at_baud(
    port: BytePort, clock: Clock, baud: int, options: ScanOptions, latency_s: float
) -> Iterator[dict[str, Any]]:
    """Yield a row for every servo that answers on an open line."""
    if options.protocol != 1.0:
        line = PacketLine(port, clock, baud, latency_s)
        seen = set()
        for device_id, number, firmware in _ping_all(port, clock, baud, line, options.ids):
            if device_id in seen:
                continue
            seen.add(device_id)
            yield _row(line, baud, device_id, number, firmware)
    if options.protocol != 2.0:
        first = Protocol1Line(port, clock, baud, latency_s, HOST_S)
        times = TRIES if options.ids else 1
        for device_id in options.ids or range(253):
            rows = (_protocol1_row(first, baud, device_id) for _ in range(times))
            if (row := next(filter(None, rows), None)) is not None:
                yield row


def _ping_all(
    port: BytePort, clock: Clock, baud: int, line: PacketLine, ids: Sequence[int]
) -> list[tuple[int, int, int]]:
    """Return id, model number and firmware of all that answer a ping."""
    servos = []
    if ids:
        for device_id in ids:
            responses = (line.ping(device_id) for _ in range(TRIES))
            response = next(filter(None, responses), None)
            if response is not None and not response.number:
                number = reg.MODEL_NUMBER.decode(response.data)
                servos.append((device_id, number, response.data[2]))
        return servos
    for device_id, response in ping_all(port, clock, baud):
        number = reg.MODEL_NUMBER.decode(response.data)
        servos.append((device_id, number, response.data[2]))
    return servos


def _row(line: PacketLine, baud: int, device_id: int, number: int, firmware: int) -> dict[str, Any]:
    row: dict[str, Any] = {
        "id": device_id,
        "model": model_name(number),
        "model_number": number,
        "firmware": firmware,
        "protocol": 2.0,
        "baud": baud,
    }
    row["errors"] = "unknown"
    family = family_of(number)
    if family is None:
        return row

    def value(register: Register | None) -> int | None:
        """Return the value of a register; None where there is none, or no valid answer."""
        if register is None:
            return None
        response = line.read(device_id, register.address, register.size)
        if response is None or len(response.data) != register.size:
            return None
        return register.decode(response.data)

    if (mode := value(family.mode)) is not None:
        row["mode"] = reg.MODES.get(mode, str(mode))
    if (delay := value(family.return_delay)) is not None:
        row["return_delay_us"] = 2 * delay
    if (second := value(family.second_id)) is not None and second <= LAST_ID:
        row["obeys_too"] = second
    if (current := value(family.current_limit)) is not None:
        row["current_limit"] = round(current * family.current_unit, 3)
    if (speed := value(family.velocity_limit)) is not None:
        row["velocity_limit"] = round(speed * family.velocity_unit, 2)
    if (voltage := value(family.voltage)) is not None:
        row["voltage"] = round(0.1 * voltage, 1)
    if (temperature := value(family.temperature)) is not None:
        row["temperature_degc"] = temperature
    if (error := value(family.error)) is not None:
        row["errors"] = hardware_text(error) if error else ""
    return row


def _protocol1_row(line: Protocol1Line, baud: int, device_id: int) -> dict[str, Any] | None:
    response = line.ping(device_id)
    if response is None:
        return None
    identity = line.read(device_id, 0, 3)
    if identity is None and response.error == protocol1.PING:
        return None  # our own request: in this protocol an echoed ping looks like a response
    row: dict[str, Any] = {"id": device_id, "model": "unknown", "protocol": 1.0, "baud": baud}
    errors = protocol1_text(response.error) if response.error else ""
    if identity is None:
        return row | {"errors": errors}
    number = reg.FIRST_MODEL_NUMBER.decode(identity.data)
    ids = line.read(device_id, FIRST_ID, 3)
    if (
        ids is not None
        and ids.data[0] != device_id
        and ids.data[FEETECH_ID - FIRST_ID] == device_id
    ):
        # It answers like one, but its table has other things at the places of ours.
        return row | {"model": FEETECH, "errors": "unknown"}
    row.update(model=model_name(number, 1.0), model_number=number, firmware=identity.data[2])
    if number in FIRST_NAMES:
        row |= _protocol1_state(line, device_id)
    return row | {"errors": errors}


def _protocol1_state(line: Protocol1Line, device_id: int) -> dict[str, Any]:
    present = line.read(device_id, reg.FIRST_PRESENT.address, 8)
    if present is None:
        return {}
    data = present.data
    load = int.from_bytes(data[4:6], "little")
    return {
        "position_counts": int.from_bytes(data[0:2], "little"),
        # Bit 10 is the direction; 0.1 % of the greatest torque.
        "load_percent": round((-0.1 if load & 0x400 else 0.1) * (load & 0x3FF), 1),
        "voltage": round(0.1 * data[6], 1),
        "temperature_degc": data[7],
    }
