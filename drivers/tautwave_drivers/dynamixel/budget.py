"""Bus time of one cycle: bytes at the baud rate, return delays, the adapter's latency timer.

8 data bits, start and stop bit: 10 bits a byte. Per cycle: sync write of the goals, sync read, one
status packet per servo (or one for all, fast). Packet lengths: e-manual, "DYNAMIXEL Protocol 2.0".
Not counted: the servos' own turn-around, some tens of us each.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tautwave.contracts import READ_SHARE, Budget, BusSpec
from tautwave_drivers.dynamixel.options import DynamixelOptions, match_servos
from tautwave_drivers.dynamixel.state import FORGETS_NS, TORQUE, remembered_blocks

BITS_PER_BYTE = 10

BLOCK = 10
"""Bytes read of each servo: current, velocity, position."""

READ_BYTES = 14 + 11
"""A read and its response, without what is read."""

STATUS_BLOCK = 13
"""The same with torque enable, hardware error and watchdog."""


class Traffic(NamedTuple):
    """What one cycle puts on the line: servos by command, bytes read of each, and how.

    `followers` take positions; `shadows` are only read, as they obey the goals of others.
    """

    impedance: int
    admittance: int
    size: int = BLOCK
    fast: bool = False
    followers: int = 0
    shadows: int = 0

    @property
    def servos(self) -> int:
        """How many are read."""
        return self.impedance + self.admittance + self.followers + self.shadows

    @property
    def sent(self) -> int:
        """Bytes from the host: sync writes of 2- and 4-byte goals, one sync read."""
        count = 14 + self.servos
        for servos, goal in ((self.impedance, 2), (self.admittance, 4), (self.followers, 4)):
            if servos:
                count += 14 + servos * (1 + goal)
        return count

    @property
    def received(self) -> int:
        """Bytes from the servos."""
        if self.fast:
            return 8 + self.servos * (self.size + 4)
        return self.servos * (11 + self.size)

    @property
    def delays(self) -> int:
        """How often a return delay passes."""
        return 1 if self.fast else self.servos

    def time_s(self, baud: int, return_delay_s: float, latency_s: float) -> float:
        """Return the time from the first byte sent to the last byte handed to the host [s]."""
        wire = (self.sent + self.received) * BITS_PER_BYTE / baud
        return wire + self.delays * return_delay_s + latency_s


def traffic_of(options: DynamixelOptions, bus: BusSpec) -> Traffic:
    """Return what one cycle of a bus puts on the line."""
    impedance = sum(axis.causality == "impedance" for axis in bus.axes)
    followers = sum(axis.takes_position for axis in bus.axes)
    size = STATUS_BLOCK if options.status_block else BLOCK
    others = len(bus.axes) - impedance - followers
    used = {axis.device_id for axis in bus.axes}
    shadows = sum(one.shadow is not None for one in options.servos if one.id in used)
    return Traffic(impedance, others, size, options.read == "fast_sync", followers, shadows)


def budget(options: DynamixelOptions, bus: BusSpec) -> Budget:
    """Return the bus time of one cycle, and what would shorten it.

    Raises
    ------
    ConfigError
        The axes do not go with the servos.
    """
    match_servos(options, bus)
    traffic = traffic_of(options, bus)
    exchange = _exchange_s(options, traffic)
    lines = [_arithmetic(options, traffic, exchange)]
    if bus.period_ns > FORGETS_NS and not options.status_block:
        each = (READ_BYTES + TORQUE.size) * BITS_PER_BYTE / options.baud
        each += options.return_delay_s + options.latency_s
        exchange += traffic.servos * each
        lines.append(
            f"a servo can restart within a period: {traffic.servos} x {each * 1e3:.3f} ms to check "
            f"that none did = {exchange * 1e3:.3f} ms (status_block: true reads it with the rest)"
        )
    if not options.status_block:
        lines.append(_read_back(options))
    needed = exchange / READ_SHARE
    lines.append(
        f"responses have to be in by {READ_SHARE:.0%} of the period: "
        f"{exchange * 1e3:.3f} ms / {READ_SHARE:g} = {needed * 1e3:.3f} ms, at most "
        f"{1.0 / needed:.0f} Hz"
    )
    remedies = _remedies(options, bus, traffic)
    remedy = f"more axes or a higher rate, each alone: {', '.join(remedies)}" if remedies else ""
    return Budget(needed, 1.0 / needed, "\n".join(lines), remedy)


def _read_back(options: DynamixelOptions) -> str:
    """Say what reading back costs of a servo that may have forgotten."""
    sizes = [TORQUE.size, *(block.size for block in remembered_blocks(mapped=False))]
    each = (READ_BYTES + max(sizes)) * BITS_PER_BYTE / options.baud
    each += options.return_delay_s + options.latency_s
    return (
        f"a servo that was not heard for 20 ms is read back in {len(sizes)} reads of at most "
        f"{each * 1e3:.3f} ms, unseen meanwhile: in what is left of each period, else one instead "
        "of the samples (status_block: true needs none)"
    )


def _exchange_s(options: DynamixelOptions, traffic: Traffic) -> float:
    return traffic.time_s(options.baud, options.return_delay_s, options.latency_s)


def _arithmetic(options: DynamixelOptions, traffic: Traffic, exchange: float) -> str:
    count = traffic.sent + traffic.received
    wire = count * BITS_PER_BYTE / options.baud
    servos = "1 servo" if traffic.servos == 1 else f"{traffic.servos} servos"
    text = (
        f"{servos}: {traffic.sent} bytes out, {traffic.received} back, "
        f"{count} x {BITS_PER_BYTE} bits at {options.baud} baud = {wire * 1e3:.3f} ms"
    )
    if options.return_delay_s > 0.0:
        text += f" + {traffic.delays} x {options.return_delay_s * 1e3:.3f} ms return delay"
    if options.latency_s > 0.0:
        text += f" + {options.latency_s * 1e3:g} ms USB latency timer"
    if options.return_delay_s > 0.0 or options.latency_s > 0.0:
        text += f" = {exchange * 1e3:.3f} ms"
    return text


def _remedies(options: DynamixelOptions, bus: BusSpec, traffic: Traffic) -> list[str]:
    """Return what each single change would bring, in Hz, and a divisor where it needs one."""

    def rate(changed: DynamixelOptions, load: Traffic) -> str:
        return f"{READ_SHARE / _exchange_s(changed, load):.0f} Hz"

    remedies = []
    fastest = min((s.model.fastest_baud for s in match_servos(options, bus)), default=4_000_000)
    fastest = min(fastest, 4_000_000)
    if options.baud < fastest:
        changed = options.model_copy(update={"baud": fastest})
        remedies.append(f"baud: {fastest} gives {rate(changed, traffic)}")
    if options.return_delay_s > 0.0:
        changed = options.model_copy(update={"return_delay_s": 0.0})
        remedies.append(f"return_delay_s: 0 gives {rate(changed, traffic)}")
    if options.latency_s > 0.001:
        changed = options.model_copy(update={"usb_latency_s": 0.001})
        remedies.append(f"a USB latency timer of 1 ms gives {rate(changed, traffic)}")
    if options.latency_s > 0.0:
        changed = options.model_copy(update={"usb_latency_s": 0.0})
        remedies.append(f"a real UART instead of USB gives {rate(changed, traffic)}")
    if not traffic.fast and traffic.servos > 1:
        remedies.append(f"read: fast_sync gives {rate(options, traffic._replace(fast=True))}")
    if options.status_block:
        remedies.append(f"status_block: false gives {rate(options, traffic._replace(size=BLOCK))}")
    if traffic.servos > 1:
        fewer = (
            traffic._replace(impedance=traffic.impedance - 1)
            if traffic.impedance
            else traffic._replace(admittance=traffic.admittance - 1)
            if traffic.admittance
            else traffic._replace(followers=traffic.followers - 1)
        )
        remedies.append(f"one axis fewer on this bus gives {rate(options, fewer)}")
    nth = math.ceil(_exchange_s(options, traffic) * bus.rate_hz / READ_SHARE)
    if nth > 1:
        remedies.append(
            f"divisor: {nth * bus.divisor} on this bus ({bus.rate_hz / nth:.0f} Hz) fits"
        )
    return remedies
