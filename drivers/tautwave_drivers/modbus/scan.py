"""`tautwave scan modbus`: which units answer on a line or at hosts, and which profile fits."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from tautwave.contracts import ScanProgress, no_progress
from tautwave.errors import ConfigError, DriverError
from tautwave_drivers.serial_ports import ports_found

if TYPE_CHECKING:
    from tautwave.contracts import BytePort, Clock
    from tautwave_drivers.modbus.line.link import Link
    from tautwave_drivers.modbus.profile import Profile

NOBODY = 11
"""Exception of a gateway for a unit that is not there."""


class ScanOptions(BaseModel):
    """Options of `tautwave scan modbus`."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)

    endpoint: list[str] = Field(
        default=[],
        description="tcp://HOST:PORT, several with commas, or a serial device, e.g. /dev/ttyUSB0; "
        "if omitted, lists the serial ports present.",
    )
    units: str = Field(
        default="", description="Units to ask, e.g. 1-16 or 1,2,9; all of 1-247 on a serial line."
    )
    baud: Annotated[int, Field(ge=300)] = Field(default=115_200, description="Of a serial line.")
    parity: Literal["N", "E", "O"] = Field(default="N", description="Of a serial line.")
    rtu: bool = Field(
        default=False,
        description="At tcp:// endpoints: RTU frames, as serial servers pass them on.",
    )
    stop_bits: Annotated[int, Field(ge=1, le=2)] = Field(default=1, description="Of a serial line.")
    timeout_s: Annotated[float, Field(gt=0.0)] = Field(
        default=0.05, description="How long to wait for each unit [s]."
    )
    profiles: list[str] = Field(
        default=[], description="Files of profiles to try besides those that are shipped."
    )


def units_of(text: str, serial: bool) -> list[int]:
    """Return the units that a text names.

    Raises
    ------
    ConfigError
        It names none, or one beyond 1 to 247; over TCP 0 to 255.
    """
    if not text:
        return list(range(1, 248)) if serial else list(range(1, 17))
    units: list[int] = []
    for part in text.split(","):
        first, dash, last = (word.strip() for word in part.partition("-"))
        ends = (first, last) if dash else (first, first)
        if not all(word.isascii() and word.isdigit() for word in ends):
            raise ConfigError(f"scan modbus: --units {text!r} should be like 1-16 or 1,2,9")
        begin, end = (int(word) for word in ends)
        least, most = (1, 247) if serial else (0, 255)
        if not least <= begin <= end <= most:
            raise ConfigError(f"scan modbus: --units {text!r}: unit ids are {least} to {most}")
        units += range(begin, end + 1)
    return units


def scan(options: ScanOptions, progress: ScanProgress = no_progress) -> Sequence[dict[str, Any]]:
    """Return every unit that answers: endpoint, profile or identity, state and fault.

    Nothing is written. An endpoint that cannot be reached, where others can, has a row of its own.

    Raises
    ------
    ConfigError
        An option is wrong.
    DriverError
        A line cannot be opened, or no host can be reached.
    """
    if not options.endpoint:
        raise ConfigError(f"scan modbus: --endpoint is missing; {ports_found()}")
    from tautwave.clock import MonotonicClock
    from tautwave_drivers.modbus.profile import SHIPPED, load_profile

    clock = MonotonicClock()
    profiles = [load_profile(name) for name in (*options.profiles, *SHIPPED)]
    rows: list[dict[str, Any]] = []
    failed: dict[str, str] = {}
    for endpoint in options.endpoint:
        units = units_of(options.units, options.rtu or not endpoint.startswith("tcp://"))
        try:
            link = _open(endpoint, options, clock)
        except DriverError as err:
            failed[endpoint] = str(err)
            continue
        try:
            for at, unit in enumerate(units):
                progress(at / len(units), f"{endpoint}, unit {unit}, {len(rows)} found")
                rows += _at_unit(link, clock, options, endpoint, unit, profiles)
        finally:
            link.close()
    if failed and len(failed) == len(options.endpoint):
        raise DriverError("; ".join(failed.values()))
    return rows + [
        {"endpoint": one, "unit": None, "fault": why.removeprefix(f"{one}: ")}
        for one, why in failed.items()
    ]


def _open(endpoint: str, options: ScanOptions, clock: Clock) -> Link:
    from tautwave_drivers.modbus.line.ports import TcpPort
    from tautwave_drivers.modbus.line.rtu import RtuLink
    from tautwave_drivers.modbus.line.tcp import TcpLink
    from tautwave_drivers.modbus.options import DeviceOptions, ModbusOptions
    from tautwave_drivers.serial_port import SerialPort

    serial_line = not endpoint.startswith("tcp://")
    if serial_line or options.rtu:
        if (
            serial_line
            and not endpoint.startswith(("/", "."))
            and endpoint.rpartition(":")[2].isdigit()
        ):
            raise ConfigError(f"scan modbus: --endpoint {endpoint}: write tcp://{endpoint}")
        line = ModbusOptions(
            link="rtu",
            endpoint=endpoint,
            baud=options.baud,
            parity=options.parity,
            stop_bits=options.stop_bits,
            late_s=options.timeout_s,
            devices=[DeviceOptions(unit=1)],
        )
        serial: Callable[[], BytePort] = partial(TcpPort, endpoint)
        if serial_line:
            serial = partial(SerialPort, endpoint, line.baud, line.parity, line.stop_bits)
        link: Link = RtuLink(serial, clock, line)
    else:
        link = TcpLink(lambda: TcpPort(endpoint), clock, 3600.0)
    until = clock.now_ns() + 2_000_000_000
    while not link.connect():
        if clock.now_ns() > until:
            link.close()
            raise DriverError(
                f"{endpoint}: no connection within 2 s; check cable, supply and address"
            )
        clock.sleep_until(clock.now_ns() + 1_000_000)
    return link


class _Unit:
    """One unit that may be there."""

    def __init__(self, link: Link, clock: Clock, unit: int, timeout_s: float) -> None:
        self._link = link
        self._clock = clock
        self._unit = unit
        self._timeout_ns = round(1e9 * timeout_s)

    def request(self, request: Any) -> bytes:
        """Return the response, b'' if there is none."""
        from tautwave_drivers.modbus.line.client import request_once

        limit = self._clock.now_ns() + self._timeout_ns
        return request_once(self._link, self._clock, self._unit, request, limit)

    def value(self, profile: Profile, name: str) -> int | None:
        """Return the value of a register, None where it refuses."""
        from tautwave_drivers.modbus.protocol.frames import REFUSED
        from tautwave_drivers.modbus.sequence import RegisterCodec

        codec = RegisterCodec(profile, profile.functions)
        pdu = self.request(codec.read(name))
        return None if not pdu or pdu[0] & REFUSED else codec.decode(name, pdu)


def _at_unit(
    link: Link,
    clock: Clock,
    options: ScanOptions,
    endpoint: str,
    unit: int,
    profiles: Sequence[Profile],
) -> Iterator[dict[str, Any]]:
    from tautwave_drivers.modbus.protocol import frames

    one = _Unit(link, clock, unit, options.timeout_s)
    first = one.request(frames.read(3, 0, 1))
    if not first or (first[0] & frames.REFUSED and first[1] in (10, NOBODY)):
        return
    row: dict[str, Any] = {"endpoint": endpoint, "unit": unit}
    identity = one.request(frames.identify())
    if identity and not identity[0] & frames.REFUSED:
        row["identity"] = ", ".join(frames.identity_of(identity).values())
    for profile in profiles:
        if _matches(one, profile):
            row["profile"] = profile.family
            _state(one, profile, row)
            break
    yield row


def _matches(one: _Unit, profile: Profile) -> bool:
    """Return whether a unit has every register of a profile that says what it is and does."""
    if profile.identity is not None:
        identity = one.value(profile, profile.identity.register_name)
        if identity is None or profile.identity.value not in (None, identity):
            return False
    names = {profile.roles["status"], profile.roles["position"], *profile.reported}
    return all(one.value(profile, name) is not None for name in sorted(names))


def _state(one: _Unit, profile: Profile, row: dict[str, Any]) -> None:
    status = one.value(profile, profile.roles["status"]) or 0
    if profile.machine == "cia402":
        from tautwave_drivers.cia402.states import status_text

        row["state"] = status_text(status)
    elif profile.states is not None:
        states = profile.states
        row["state"] = (
            "fault"
            if states.fault.fits(status)
            else "enabled"
            if states.enabled.fits(status)
            else f"off ({status:#x})"
        )
    row["position_counts"] = one.value(profile, profile.roles["position"])
    name = profile.roles.get("fault")
    code = one.value(profile, name) if name is not None else None
    if code:
        row["fault"] = profile.faults.get(code, f"code {code:#x}")
        if profile.machine == "cia402":
            from tautwave_drivers.cia402.emergency import error_text

            row["fault"] = error_text(code)
