"""Bus time of one cycle, from worst-case stuffed frame lengths of the mapping in use."""

from __future__ import annotations

from tautwave.contracts import Budget, BusSpec
from tautwave_drivers.can.latency import latency_lines, latency_s
from tautwave_drivers.can.lengths import arithmetic, frame_s
from tautwave_drivers.canopen.mapping import mapping_of
from tautwave_drivers.canopen.options import CanopenOptions, nodes_of
from tautwave_drivers.cia402.objects import interpolation_period


def cycle_sizes(options: CanopenOptions, bus: BusSpec) -> tuple[list[int], list[int]]:
    """Return the lengths [bytes] of all RPDOs and all TPDOs of a cycle, in axis order."""
    maps = [
        mapping_of(axis.causality, node)
        for axis, node in zip(bus.axes, nodes_of(options, bus), strict=True)
    ]
    return [each.rpdo.size for each in maps], [each.tpdo.size for each in maps]


def exchange_s(options: CanopenOptions, bus: BusSpec) -> float:
    """Return the worst-case time of SYNC, all TPDOs and all RPDOs, through the adapter [s]."""
    rates = options.bitrate, options.data_bitrate
    rpdos, tpdos = cycle_sizes(options, bus)
    first = frame_s(0, *rates) if options.sync else 0.0
    wire = first + sum(frame_s(size, *rates) for size in (*tpdos, *rpdos))
    return wire + latency_s(options)


def budget(options: CanopenOptions, bus: BusSpec) -> Budget:
    """Return the bus time of one cycle, the highest rate that fits, and the arithmetic."""
    bitrate, data = options.bitrate, options.data_bitrate
    rpdos, tpdos = cycle_sizes(options, bus)
    kind = "classic CAN" if data is None else f"CAN FD, data {data / 1e6:g} Mbit/s"
    lines = [f"{kind}, {bitrate / 1e6:g} Mbit/s, 11-bit ids, worst-case stuffing"]
    parts = [("SYNC", 0)] if options.sync else []
    for axis, rpdo, tpdo in zip(bus.axes, rpdos, tpdos, strict=True):
        parts += [(f"{axis.name} TPDO", tpdo), (f"{axis.name} RPDO", rpdo)]
    for name, size in parts:
        lines.append(f"{name}: {arithmetic(size, bitrate, data)}")
    exchange = exchange_s(options, bus)
    lines += latency_lines(options)
    lines.append(f"process data of one cycle: {_us(exchange)}")
    beats = len(bus.axes) + 1
    beat_share = beats * frame_s(1, bitrate, data) / (options.heartbeat_ms * 1e-3)
    lines.append(
        f"heartbeats: {beats} x {_us(frame_s(1, bitrate, data))} every "
        f"{options.heartbeat_ms} ms = {beat_share:.2%} of the bus"
    )
    lines.append(f"EMCY and SDO: {options.reserve:.0%} of the bus kept free")
    shares = beat_share + options.reserve
    time_s = exchange + shares / bus.rate_hz
    greatest = max(0.0, 1.0 - shares) / exchange
    lines.append(
        f"sum at {bus.rate_hz:g} Hz: {_us(time_s)} of {_us(1.0 / bus.rate_hz)} "
        f"({time_s * bus.rate_hz:.0%}); highest rate that fits: {greatest:.0f} Hz "
        f"({1.0 / exchange:.0f} Hz by process data alone)"
    )
    if interpolation_period(bus.period_ns) is None:
        lines.append(
            f"60C2h cannot represent {bus.period_ns / 1000:g} us, so a drive that has it will "
            "reject this rate: use a rate such as 1000, 500 or 250 Hz"
        )
    remedy = _advice(options, bus, shares)
    return Budget(time_s, greatest, "\n".join(lines), remedy)


def _advice(options: CanopenOptions, bus: BusSpec, shares: float) -> str:
    """Say what would fit more axes, or a higher rate, with the numbers of each option."""
    ways = []
    room = max(0.0, 1.0 - shares)
    if any(node.mapping == "full" for node in nodes_of(options, bus)):
        nodes = tuple(node.model_copy(update={"mapping": "lean"}) for node in options.nodes)
        lean = options.model_copy(update={"nodes": nodes})
        ways.append(f"mapping: lean ({room / exchange_s(lean, bus):.0f} Hz)")
    if options.bitrate < 1_000_000:
        fast = options.model_copy(update={"bitrate": 1_000_000})
        ways.append(f"bitrate 1000000 ({room / exchange_s(fast, bus):.0f} Hz)")
    if len(bus.axes) > 1:
        half = bus._replace(axes=bus.axes[: (len(bus.axes) + 1) // 2])
        ids = {axis.device_id for axis in half.axes}
        nodes = tuple(node for node in options.nodes if node.id in ids)
        two = options.model_copy(update={"nodes": nodes})
        ways.append(f"two buses ({room / exchange_s(two, half):.0f} Hz)")
    if options.data_bitrate is None:
        fd = options.model_copy(update={"data_bitrate": 5_000_000})
        ways.append(f"CAN FD at 5 Mbit/s ({room / exchange_s(fd, bus):.0f} Hz), not supported yet")
    ways.append("a lower rate_hz")
    return "more axes or a higher rate, each alone: " + ", ".join(ways)


def _us(seconds: float) -> str:
    return f"{seconds * 1e6:.5g} us"
