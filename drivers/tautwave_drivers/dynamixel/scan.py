"""`tautwave scan dynamixel`: every servo on a line, at every baud rate, in both protocols."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Annotated, Any

from pydantic import BaseModel, Field

from tautwave.clock import MonotonicClock
from tautwave.contracts import BytePort, Clock, ScanProgress, no_progress
from tautwave.errors import ConfigError
from tautwave_drivers.dynamixel.line.ftdi import latency_timer_s
from tautwave_drivers.dynamixel.line.transactions import PacketLine, Protocol1Line, ping_all
from tautwave_drivers.dynamixel.options import LAST_ID, STRICT, Protocol
from tautwave_drivers.dynamixel.protocol import packet1
from tautwave_drivers.dynamixel.protocol import registers as reg
from tautwave_drivers.dynamixel.protocol.messages import hardware_text, protocol1_text
from tautwave_drivers.dynamixel.protocol.models import MODELS, VELOCITY_UNIT, model_name
from tautwave_drivers.serial_port import SerialPort
from tautwave_drivers.serial_ports import ports_found

LATENCY_S = 0.002
"""Of adapters with an unknown latency timer; FTDI's is known, 16 ms unless set."""

HOST_S = 0.005
"""Of this machine, for each of the many unused ids in protocol 1.0."""

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
    found: list[dict[str, Any]] = []
    latency_s = latency_timer_s(options.port)
    if latency_s is None:
        latency_s = LATENCY_S
    port = SerialPort(options.port, bauds[0])
    try:
        for at, baud in enumerate(bauds):
            progress(at / len(bauds), f"{baud} baud, {len(found)} found")
            try:
                port.set_baud(baud)
            except OSError:
                continue  # the adapter does not support this rate
            found.extend(find_at_baud(port, clock, baud, options, latency_s))
    finally:
        port.close()
    return found


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
    found = []
    if ids:
        for device_id in ids:
            responses = (line.ping(device_id) for _ in range(TRIES))
            response = next(filter(None, responses), None)
            if response is not None and not response.number:
                number = reg.MODEL_NUMBER.decode(response.data)
                found.append((device_id, number, response.data[2]))
        return found
    for device_id, response in ping_all(port, clock, baud):
        number = reg.MODEL_NUMBER.decode(response.data)
        found.append((device_id, number, response.data[2]))
    return found


def _row(line: PacketLine, baud: int, device_id: int, number: int, firmware: int) -> dict[str, Any]:
    row: dict[str, Any] = {
        "id": device_id,
        "model": model_name(number),
        "model_number": number,
        "firmware": firmware,
        "protocol": 2.0,
        "baud": baud,
    }
    mode = line.read(device_id, reg.OPERATING_MODE.address, 1)
    if mode is not None and mode.data:
        row["mode"] = reg.MODES.get(mode.data[0], str(mode.data[0]))
    delay = line.read(device_id, reg.RETURN_DELAY.address, 1)
    if delay is not None and delay.data:
        row["return_delay_us"] = 2 * delay.data[0]
    second = line.read(device_id, reg.SECONDARY_ID.address, 1)
    if second is not None and second.data and second.data[0] <= LAST_ID:
        row["obeys_too"] = second.data[0]
    model = MODELS.get(str(row["model"]))
    if model is not None:
        current = line.read(device_id, reg.CURRENT_LIMIT.address, 2)
        if model.current_unit and current is not None and len(current.data) == 2:
            counts = reg.CURRENT_LIMIT.decode(current.data)
            row["current_limit"] = round(counts * model.current_unit, 3)
        speed = line.read(device_id, reg.VELOCITY_LIMIT.address, 4)
        if speed is not None and len(speed.data) == 4:
            row["velocity_limit"] = round(reg.VELOCITY_LIMIT.decode(speed.data) * VELOCITY_UNIT, 2)
    supply = line.read(device_id, reg.PRESENT_VOLTAGE.address, 3)
    if supply is not None and len(supply.data) == 3:
        row["voltage"] = round(0.1 * reg.PRESENT_VOLTAGE.decode(supply.data), 1)
        row["temperature_degc"] = supply.data[2]
    error = line.read(device_id, reg.HARDWARE_ERROR.address, 1)
    row["errors"] = "unknown"
    if error is not None and error.data:
        row["errors"] = hardware_text(error.data[0]) if error.data[0] else ""
    return row


def _protocol1_row(line: Protocol1Line, baud: int, device_id: int) -> dict[str, Any] | None:
    found = line.ping(device_id)
    if found is None:
        return None
    identity = line.read(device_id, 0, 3)
    if identity is None and found.error == packet1.PING:
        return None  # our own request: in this protocol an echoed ping looks like a response
    row: dict[str, Any] = {"id": device_id, "model": "unknown", "protocol": 1.0, "baud": baud}
    if identity is not None:
        number = reg.FIRST_MODEL_NUMBER.decode(identity.data)
        row.update(model=model_name(number, 1.0), model_number=number, firmware=identity.data[2])
    present = line.read(device_id, reg.FIRST_PRESENT.address, 8)
    if present is not None:
        data = present.data
        load = int.from_bytes(data[4:6], "little")
        row["position_counts"] = int.from_bytes(data[0:2], "little")
        # Bit 10 is the direction; 0.1 % of the greatest torque.
        row["load_percent"] = round((-0.1 if load & 0x400 else 0.1) * (load & 0x3FF), 1)
        row["voltage"] = round(0.1 * data[6], 1)
        row["temperature_degc"] = data[7]
    row["errors"] = protocol1_text(found.error) if found.error else ""
    return row
