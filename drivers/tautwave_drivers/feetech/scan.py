"""`tautwave scan feetech`: every servo on a line, at every baud rate; nothing is written."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Annotated, Any

from pydantic import BaseModel, Field

from tautwave.clock import MonotonicClock
from tautwave.contracts import BytePort, Clock, ScanProgress, no_progress
from tautwave.errors import ConfigError
from tautwave_drivers.adapter import adapter_of
from tautwave_drivers.echo import Unechoed
from tautwave_drivers.feetech import tables
from tautwave_drivers.feetech.line import ServoLine
from tautwave_drivers.feetech.models import model_name
from tautwave_drivers.feetech.options import STRICT, ServoId
from tautwave_drivers.feetech.tables import Identity, Register, identity_of, status_text
from tautwave_drivers.serial_port import SerialPort
from tautwave_drivers.serial_ports import ports_found

LATENCY_S = 0.002
"""Of adapters with an unknown latency timer; FTDI's is known, 16 ms unless set."""
HOST_S = 0.005
"""Of this machine, for each id without a servo."""
USUAL = range(1, 17)
"""Ids that are asked one by one where no servo answers a broadcast ping."""
TRIES = 3


class ScanOptions(BaseModel):
    """Options of `tautwave scan feetech`."""

    model_config = STRICT

    port: str = Field(
        default="",
        description="Serial device, e.g. /dev/ttyACM0; if omitted, lists the ports present.",
    )
    baud: Annotated[int, Field(ge=9600)] | None = Field(
        default=None, description="Only this baud rate; else all that these servos have."
    )
    ids: list[ServoId] = Field(
        default=[], description="Only these ids, e.g. 1,2 or 1-6; else who answers a broadcast "
        "ping, and 1 to 16.",
    )  # fmt: skip


def scan(options: ScanOptions, progress: ScanProgress = no_progress) -> Sequence[dict[str, Any]]:
    """Return every servo found: series, model, firmware, settings, supply and errors.

    Raises
    ------
    ConfigError
        No port is given; it names those that are found.
    DriverError
        The device cannot be opened, or was lost.
    """
    if not options.port:
        raise ConfigError(f"scan feetech: --port is missing; {ports_found()}")
    clock = MonotonicClock()
    bauds = [options.baud] if options.baud else list(tables.BAUDS.values())
    rows: list[dict[str, Any]] = []
    latency_s = adapter_of(options.port).found_s
    port = SerialPort(options.port, bauds[0])
    try:
        for at, baud in enumerate(bauds):
            progress(at / len(bauds), f"{baud} baud, {len(rows)} found")
            try:
                port.set_baud(baud)
            except OSError:
                continue  # the adapter does not support this rate
            rows += look(port, clock, baud, options.ids, latency_s or LATENCY_S)
    finally:
        port.close()
    return rows


def look(
    port: BytePort, clock: Clock, baud: int, ids: Sequence[int], latency_s: float
) -> Iterator[dict[str, Any]]:
    """Yield a row for every servo that answers on an open line."""
    bare = Unechoed(port)
    line = ServoLine(bare, clock, baud, latency_s, HOST_S)
    line.find_echo()
    heard = [] if ids else line.ping_all()
    for number in ids or sorted({*heard, *(() if heard and not line.garbled else USUAL)}):
        for _ in range(TRIES if ids or number in heard else 1):
            answers = line.answers(number, tables.IDENTITY)
            if answers or not line.garbled:
                break
        if answers:
            row = _row(line, number, identity_of(answers[0]))
            twice = len(answers) > 1 or heard.count(number) > 1
            if twice:
                row["errors"] = "two servos have this id"
        elif line.garbled:
            row = {"id": number, "series": "unknown", "model": "unknown"}
            row["errors"] = "its answers are garbled: two servos with this id?"
        else:
            continue
        yield {**row, "baud": baud}


def _row(line: ServoLine, number: int, identity: Identity) -> dict[str, Any]:
    row: dict[str, Any] = {
        "id": number,
        "series": identity.series,
        "model": model_name(identity.model),
        "model_number": identity.model,
        "firmware": identity.firmware,
    }
    table = identity.table
    if table is None:  # another table has other things at these places
        return row | {"errors": "unknown: no axis runs on it"}

    def value(register: Register) -> int | None:
        response = line.read(number, register)
        return None if response is None else register.decode(response.data)

    mode, delay, second = value(tables.MODE), None, None
    if mode is not None:
        row["mode"] = table.modes.get(mode, str(mode))
    if table.return_delay is not None and (delay := value(table.return_delay)) is not None:
        row["return_delay_us"] = round(delay * tables.DELAY_UNIT_S * 1e6)
    if table.second_id is not None and (second := value(table.second_id)) is not None:
        row["second_id"] = second
    for name, register in (
        ("offset", table.offset),
        ("position_counts", tables.POSITION),
        ("torque", tables.TORQUE),
        ("lock", tables.LOCK),
        ("temperature_degc", tables.TEMPERATURE),
    ):
        if (number_read := value(register)) is not None:
            row[name] = number_read
    if (volts := value(tables.VOLTAGE)) is not None:
        row["voltage"] = round(volts * tables.VOLT, 1)
    status = value(tables.STATUS)
    row["errors"] = "unknown" if status is None else status_text(status) if status else ""
    return row
