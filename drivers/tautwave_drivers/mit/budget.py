"""Bus time of one cycle: a command to each motor, an answer from each, at their worst."""

from __future__ import annotations

from tautwave.contracts import READ_SHARE, Budget, BusSpec
from tautwave_drivers.can.latency import latency_lines, latency_s
from tautwave_drivers.can.lengths import arithmetic, frame_s
from tautwave_drivers.mit.options import MitOptions, motors_of

BYTES = 8


def exchange_s(options: MitOptions, bus: BusSpec) -> float:
    """Return the worst-case time of a cycle's frames, through the adapter [s]."""
    rates, extended = (options.bitrate, options.data_bitrate), options.family == "robstride"
    wire = 2 * len(bus.axes) * frame_s(BYTES, *rates, extended=extended)
    return wire + latency_s(options)


def budget(options: MitOptions, bus: BusSpec) -> Budget:
    """Return the bus time of one cycle, the highest rate that fits, and the arithmetic."""
    motors_of(options, bus)
    bitrate, data = options.bitrate, options.data_bitrate
    kind = "classic CAN" if data is None else f"CAN FD, data {data / 1e6:g} Mbit/s"
    exchange = exchange_s(options, bus)
    share = min(READ_SHARE, 1.0 - options.reserve)
    greatest = share / exchange
    extended = options.family == "robstride"
    each = arithmetic(BYTES, bitrate, data)
    if extended:
        each = f"{BYTES} bytes: {frame_s(BYTES, bitrate, extended=True) * 1e6:.5g} us"
    lines = [
        f"{kind}, {bitrate / 1e6:g} Mbit/s, {29 if extended else 11}-bit ids, worst-case stuffing",
        f"command or answer: {each}",
        f"{len(bus.axes)} motors x 2 frames: {exchange * 1e6:.5g} us; a command is the request",
        *latency_lines(options),
        f"all answers are in after {share:.0%} of a period: at most {greatest:.0f} Hz",
        f"at {bus.rate_hz:g} Hz: {exchange * bus.rate_hz:.0%} of the bus",
    ]
    ways = []
    if bitrate < 1_000_000:
        faster = options.model_copy(update={"bitrate": 1_000_000})
        ways.append(f"bitrate 1000000 ({share / exchange_s(faster, bus):.0f} Hz)")
    if data is None and not extended:
        fd = options.model_copy(update={"bitrate": 1_000_000, "data_bitrate": 5_000_000})
        ways.append(f"data_bitrate 5000000, CAN FD ({share / exchange_s(fd, bus):.0f} Hz)")
    if len(bus.axes) > 1:
        half = bus._replace(axes=bus.axes[: (len(bus.axes) + 1) // 2])
        ways.append(f"two buses ({share / exchange_s(options, half):.0f} Hz)")
    ways.append("a lower rate_hz")
    remedy = "more motors or a higher rate, each alone: " + ", ".join(ways)
    return Budget(exchange, greatest, "\n".join(lines), remedy)
