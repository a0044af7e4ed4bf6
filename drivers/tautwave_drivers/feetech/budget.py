"""Bus time of one cycle: bytes at the baud rate, delays of the answers, the adapter's latency.

10 bits a byte. Per cycle: a sync write of the goals (one for efforts, one for positions), a sync
read, and an answer of each servo, behind its return delay and a turn-around that is assumed.
"""

from __future__ import annotations

import math

from tautwave.contracts import READ_SHARE, Budget, BusSpec
from tautwave_drivers.feetech.line import BITS_PER_BYTE
from tautwave_drivers.feetech.options import FeetechOptions, Servo, match_servos
from tautwave_drivers.feetech.tables import CYCLE, HLS
from tautwave_drivers.protocol1 import HEAD

HOST = 8
"""Bytes of a sync write or a sync read without what is per servo."""
GOAL = 3
ANSWER = HEAD + CYCLE.size + 1


def sent_bytes(servos: list[Servo]) -> int:
    """Return the bytes from the host in a cycle."""
    efforts = sum(servo.impedance for servo in servos)
    count = HOST + len(servos)
    for some in (efforts, len(servos) - efforts):
        count += HOST + GOAL * some if some else 0
    return count


def exchange_s(options: FeetechOptions, servos: list[Servo]) -> float:
    """Return the time from the first byte sent to the last byte handed to the host [s]."""
    wire = (sent_bytes(servos) + ANSWER * len(servos)) * BITS_PER_BYTE / options.baud
    return wire + _delays_s(options, servos) + options.latency_s


def _delays_s(options: FeetechOptions, servos: list[Servo]) -> float:
    delayed = sum(servo.table is not HLS for servo in servos)
    return delayed * options.return_delay_s + len(servos) * options.turn_around_s


def budget(options: FeetechOptions, bus: BusSpec) -> Budget:
    """Return the bus time of one cycle, and what would shorten it.

    Raises
    ------
    ConfigError
        The axes do not go with the servos.
    """
    servos = match_servos(options, bus)
    sent, answers = sent_bytes(servos), ANSWER * len(servos)
    wire = (sent + answers) * BITS_PER_BYTE / options.baud
    exchange = exchange_s(options, servos)
    needed = exchange / READ_SHARE
    many = "1 servo" if len(servos) == 1 else f"{len(servos)} servos"
    delayed = sum(servo.table is not HLS for servo in servos)
    lines = [
        f"{many}: {sent} bytes out, {answers} back ({CYCLE.size} of registers each: samples, and "
        f"what a restart would reset), {sent + answers} x {BITS_PER_BYTE} bits at {options.baud} "
        f"baud = {wire * 1e3:.3f} ms"
    ]
    if delayed and options.return_delay_s > 0.0:
        lines.append(f"return delay: {delayed} x {options.return_delay_s * 1e6:g} us")
    lines.append(
        f"turn-around: {len(servos)} x {options.turn_around_s * 1e6:g} us, assumed (turn_around_s)"
    )
    if options.latency_s > 0.0:
        lines.append(f"USB latency: {options.latency_s * 1e3:g} ms")
    lines.append(
        f"answers have to be in by {READ_SHARE:.0%} of the period: {exchange * 1e3:.3f} ms / "
        f"{READ_SHARE:g} = {needed * 1e3:.3f} ms, at most {1.0 / needed:.0f} Hz"
    )
    remedies = _remedies(options, bus, servos)
    remedy = f"more axes or a higher rate, each alone: {', '.join(remedies)}" if remedies else ""
    return Budget(needed, 1.0 / needed, "\n".join(lines), remedy)


def _remedies(options: FeetechOptions, bus: BusSpec, servos: list[Servo]) -> list[str]:
    """Return what each single change would bring, in Hz."""

    def rate(change: dict[str, object], some: list[Servo]) -> str:
        return f"{READ_SHARE / exchange_s(options.model_copy(update=change), some):.0f} Hz"

    remedies = []
    if options.baud < 1_000_000:
        remedies.append(f"baud: 1000000 gives {rate({'baud': 1_000_000}, servos)}")
    if options.return_delay_s > 0.0 and any(servo.table is not HLS for servo in servos):
        remedies.append(f"return_delay_s: 0 gives {rate({'return_delay_s': 0.0}, servos)}")
    if options.latency_s > 0.001:
        remedies.append(f"a USB latency of 1 ms gives {rate({'usb_latency_s': 0.001}, servos)}")
    if options.latency_s > 0.0:
        remedies.append(f"a real UART gives {rate({'usb_latency_s': 0.0}, servos)}")
    if len(servos) > 1:
        half = servos[: (len(servos) + 1) // 2]
        remedies.append(f"two buses give {rate({}, half)}")
    nth = math.ceil(exchange_s(options, servos) * bus.rate_hz / READ_SHARE)
    if nth > 1:
        remedies.append(
            f"divisor: {nth * bus.divisor} on this bus ({bus.rate_hz / nth:.0f} Hz) fits"
        )
    return remedies
