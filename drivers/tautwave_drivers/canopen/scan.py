"""`tautwave scan canopen`: the nodes on a bus; nothing is enabled or written."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from tautwave.clock import MonotonicClock
from tautwave.contracts import Clock, FramePort, ScanProgress, no_progress
from tautwave.errors import DriverError
from tautwave_drivers.can.opening import open_port
from tautwave_drivers.canopen.health import state_text
from tautwave_drivers.cia402 import communication as c
from tautwave_drivers.cia402 import objects as o
from tautwave_drivers.cia402.emergency import decode_emergency, error_text, register_text
from tautwave_drivers.cia402.entry import Entry
from tautwave_drivers.cia402.modes import mode_name
from tautwave_drivers.cia402.states import decode

_READ_DEVICE_TYPE = bytes.fromhex("4000100000000000")
MOTOR = {
    "rated_torque": o.RATED_TORQUE,
    "increments": o.ENCODER_INCREMENTS,
    "revolutions": o.ENCODER_REVOLUTIONS,
    "position_unit": o.POSITION_UNIT,
    "feed": o.FEED,
    "feed_revolutions": o.FEED_REVOLUTIONS,
    "gear_motor": o.GEAR_MOTOR,
    "gear_shaft": o.GEAR_SHAFT,
    "max_speed": o.MAX_MOTOR_SPEED,
}
"""What a drive may know of its motor, by column."""

_BURST = 8
_BURST_NS = 2_000_000


class ScanOptions(BaseModel):
    """Where to look, and for how long."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)

    interface: str = Field(default="socketcan", description="interface name in python-can")
    channel: str = Field(default="can0", description="its channel")
    bitrate: Annotated[int, Field(ge=10_000, le=1_000_000)] = Field(
        default=1_000_000, description="[bit/s]"
    )
    backend: Literal["auto", "raw", "python-can"] = Field(
        default="auto", description="auto, raw or python-can"
    )
    listen_s: Annotated[float, Field(gt=0.0)] = Field(
        default=1.2, description="[s] how long to listen for heartbeats"
    )
    timeout_s: Annotated[float, Field(gt=0.0)] = Field(
        default=0.1, description="[s] how long to wait for an object"
    )


def scan(options: ScanOptions, progress: ScanProgress = no_progress) -> Sequence[Mapping[str, Any]]:
    """Return one row per node that responds or is heard."""
    clock = MonotonicClock()
    port = open_port(options, clock)
    progress(0.0, f"listening for {options.listen_s:g} s")
    try:
        return look(port, clock, options)
    finally:
        port.close()


def look(port: FramePort, clock: Clock, options: ScanOptions) -> Sequence[Mapping[str, Any]]:
    """Read the device type of every id, listen, then read the objects of those found."""
    from tautwave_drivers.canopen.network import PolledNetwork

    answered: Counter[int] = Counter()
    states: dict[int, int] = {}
    emergencies: dict[int, int] = {}

    def hear(can_id: int, data: bytes, arrival_ns: int) -> None:
        node, service = can_id & 0x7F, can_id & ~0x7F
        if not node:  # 0 addresses all nodes, so it is not an id (CiA 301, 7.3.5)
            return
        if service == 0x580:
            answered[node] += 1
        elif service == 0x700 and data:
            states[node] = data[0] & 0x7F
        elif service == 0x80:
            reported = decode_emergency(data)
            if reported is not None:
                emergencies[node] = reported.code

    net = PolledNetwork(port, clock, hear, options.timeout_s)
    end = clock.now_ns() + round(options.listen_s * 1e9)
    for node in range(1, 128):
        net.send_message(0x600 + node, _READ_DEVICE_TYPE)
        if node % _BURST == 0:  # a queue holds ten frames or so
            until = clock.now_ns() + _BURST_NS
            while net.pump(until):
                pass
    net.listen(end)
    return [
        _row(net, node, states.get(node), emergencies.get(node), answered[node])
        for node in sorted(set(answered) | set(states))
    ]


def _row(
    net: Any, node: int, state: int | None, emergency: int | None, answers: int
) -> dict[str, Any]:
    row: dict[str, Any] = {"node": node, "nmt": state_text(state)}
    if not answers:
        return {**row, "device": "present, but no SDO response"}
    from tautwave_drivers.canopen.network import EndlessError

    drive = net.remote(node, f"node {node}")
    endless: list[Entry] = []

    def value(entry: Entry) -> Any:
        if endless:
            return None
        try:
            return drive.read(entry)
        except EndlessError:
            endless.append(entry)
        except DriverError:  # refused or silent: a scan shows what it finds
            pass
        return None

    def hexed(entry: Entry) -> str | None:
        number = value(entry)
        return f"0x{number:X}" if isinstance(number, int) else None

    row["device"] = value(c.DEVICE_NAME)
    row["vendor"], row["product"] = hexed(c.VENDOR_ID), hexed(c.PRODUCT_CODE)
    row["revision"], row["serial"] = hexed(c.REVISION), hexed(c.SERIAL_NUMBER)
    word, mode = value(o.STATUSWORD), value(o.MODE_DISPLAY)
    for column, entry in MOTOR.items():
        number = value(entry)
        if isinstance(number, int):
            row[column] = number
    row["state"] = decode(word).value if isinstance(word, int) else None
    row["mode"] = mode_name(mode) if isinstance(mode, int) else None
    code = value(o.ERROR_CODE)
    register = value(c.ERROR_REGISTER)
    errors = []
    if isinstance(code, int) and code:
        errors.append(error_text(code))
    if isinstance(register, int) and register:
        errors.append(f"register: {register_text(register)}")
    if answers > 1:
        errors.append(f"{answers} responses to one request: two nodes have this id")
    if emergency:
        errors.append(f"EMCY {error_text(emergency)}")
    errors += [f"response to {entry.address} {entry.name} never ends" for entry in endless]
    row["errors"] = "; ".join(dict.fromkeys(errors)) or "none"
    return row
