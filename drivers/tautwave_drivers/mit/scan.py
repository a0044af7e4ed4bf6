"""`tautwave scan mit`: the motors on a bus; nothing is enabled or written."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from tautwave.clock import MonotonicClock
from tautwave.contracts import Clock, FramePort, ScanProgress, no_progress
from tautwave.errors import DriverError
from tautwave_drivers.can.framing import Framing
from tautwave_drivers.can.opening import open_port
from tautwave_drivers.mit import damiao
from tautwave_drivers.mit.damiao import Register
from tautwave_drivers.mit.registers import Registers

LAST_ID = 0x20
"""Ids that makers and arms use; others have to be asked for."""
TRIES = 2
BURST = 4
"""Requests in a row: a queue holds ten frames or so."""
COLUMNS: tuple[tuple[str, Register, int], ...] = (
    ("p_max", damiao.P_MAX, 6),
    ("v_max", damiao.V_MAX, 6),
    ("t_max", damiao.T_MAX, 6),
    ("gear", damiao.GEAR, 6),
    ("rotor_inertia", damiao.INERTIA, 4),
    ("velocity_filter_hz", damiao.V_BANDWIDTH, 4),
    ("voltage", damiao.VOLTAGE, 3),
)


class ScanOptions(BaseModel):
    """Where to look, and for which ids."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)

    interface: str = Field(default="socketcan", description="interface name in python-can")
    channel: str = Field(default="can0", description="its channel")
    bitrate: Annotated[int, Field(ge=10_000, le=1_000_000)] = Field(
        default=1_000_000, description="[bit/s]"
    )
    data_bitrate: Annotated[int, Field(ge=0, le=8_000_000)] = Field(
        default=0, description="[bit/s] of the data phase of CAN FD; 0: classic CAN"
    )
    backend: Literal["auto", "raw", "python-can"] = Field(
        default="auto", description="auto, raw or python-can"
    )
    ids: list[Annotated[int, Field(ge=0, le=0x7FF)]] = Field(
        default=[], description="Only these ids, e.g. 1,2 or 1-8; else 1 to 32"
    )
    timeout_s: Annotated[float, Field(gt=0.0)] = Field(
        default=0.01, description="[s] how long to wait for an answer"
    )


def scan(options: ScanOptions, progress: ScanProgress = no_progress) -> Sequence[Mapping[str, Any]]:
    """Return one row per motor that answers."""
    clock = MonotonicClock()
    port = open_port(options, clock, Framing(options.data_bitrate or None))
    progress(0.0, "asking for ESC_ID")
    try:
        return look(port, clock, options)
    finally:
        port.close()


def look(port: FramePort, clock: Clock, options: ScanOptions) -> Sequence[Mapping[str, Any]]:
    """Ask every id for its ESC_ID, accept answers on any id; then read the motors found."""
    motors: dict[tuple[int, int], int] = {}

    def hear(frame: tuple[int, bytes, int]) -> None:
        can_id, data, _ = frame
        if len(data) != 8 or can_id == damiao.PARAMETERS:
            return
        number = int.from_bytes(data[:2], "little")
        if number in asked and damiao.register_value(data, number, damiao.ESC_ID) == number:
            motors[number, can_id] = motors.get((number, can_id), 0) + 1

    asked = list(options.ids or range(1, LAST_ID + 1))
    for at in range(0, len(asked), BURST):
        burst = asked[at : at + BURST]
        for _ in range(TRIES):
            heard = {number for number, _ in motors}
            for number in burst:
                if number not in heard:
                    port.send(damiao.PARAMETERS, damiao.read_register(number, damiao.ESC_ID))
            until = clock.now_ns() + round(options.timeout_s * 1e9)
            while clock.wait(port, until):
                frame = port.receive()
                if frame is not None:
                    hear(frame)
                if clock.now_ns() >= until:
                    break
    registers = Registers(port, clock, options.timeout_s)
    classic = getattr(port, "classic_ids", ())
    return [
        _row(registers, number, answer, times, answer in classic)
        for (number, answer), times in sorted(motors.items())
    ]


def _row(
    registers: Registers, number: int, answer: int, times: int, classic: bool
) -> dict[str, Any]:
    row: dict[str, Any] = {"id": number, "feedback_id": answer}
    problems = []
    if times > 1:
        problems.append(f"{times} motors have this id")
    if answer == 0:
        problems.append("MST_ID is 0: give it its own")
    if classic:
        problems.append("answers in classic CAN")

    def value(register: Register) -> float | None:
        try:
            value_read = registers.read(number, answer, register)
        except DriverError:
            return None
        return value_read if value_read is not None and math.isfinite(value_read) else None

    for column, register, digits in COLUMNS:
        shown = value(register)
        row[column] = None if shown is None else float(f"{shown:.{digits}g}")
    version, sub = value(damiao.SOFTWARE), value(damiao.SUB_VERSION)
    row["firmware"] = None if version is None else f"{version:.0f}.{sub or 0:.0f}"
    serial = value(damiao.SERIAL)
    row["serial"] = None if serial is None else f"{serial:.0f}"
    mode, counts = value(damiao.CTRL_MODE), value(damiao.TIMEOUT)
    row["mode"] = None if mode is None else damiao.MODES.get(int(mode), f"{mode:.0f}")
    row["watchdog_s"] = None if counts is None else float(f"{counts * damiao.TIMEOUT_S:.4g}")
    rate = value(damiao.CAN_RATE)
    row["can_rate"] = None if rate is None else damiao.FD_RATES.get(int(rate), f"{rate:.0f}")
    row["errors"] = "; ".join(problems) or "none"
    return row
