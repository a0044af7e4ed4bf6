"""Bus time of one cycle: characters and silences on a serial line, responses over TCP.

Serial: each request and each response is followed by 3.5 characters of silence (1.75 ms above 19200
baud), after which the other side knows that the frame is over; then the drive takes its turnaround.
TCP: the drive's own response time, as given; connections run in parallel, drives behind
one connection as many at once as its server takes (`outstanding` of the profile).
Source: MODBUS over Serial Line V1.02, 2.5.1.1.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from tautwave.contracts import READ_SHARE, Budget, BusSpec
from tautwave_drivers.modbus.options import Device, ModbusOptions, match_devices
from tautwave_drivers.modbus.profile import BITS, READERS

HOST_S = 1.5e-4
"""What the host and its network add to an exchange over TCP; measured 0.03 to 0.13 ms."""


class Exchange(NamedTuple):
    """One request and its response: characters of an RTU frame each way, and the function code."""

    sent: int
    answered: int
    function: int

    def time_s(self, char_s: float, gap_s: float, turnaround_s: float) -> float:
        """Return the time on a serial line from the first character to the last silence [s]."""
        return (self.sent + self.answered) * char_s + 2.0 * gap_s + turnaround_s


class Load(NamedTuple):
    """The requests of a cycle to one drive, its connection, and how many may be outstanding."""

    exchanges: list[Exchange]
    endpoint: str
    outstanding: int


def load_of(device: Device, functions: Sequence[int] | None = None) -> Load:
    """Return the requests of a cycle to one drive."""
    return Load(exchanges_of(device, functions), device.endpoint, device.profile.outstanding)


def rounds(counts: Sequence[int], outstanding: int) -> int:
    """Return how many exchanges follow each other on a connection, drive by drive in its places."""
    places = [0] * outstanding
    for count in counts:
        places[places.index(min(places))] += count
    return max(places)


def _greatest_rounds(drives: Sequence[Load]) -> int:
    behind: dict[str, list[Load]] = {}
    for one in drives:
        behind.setdefault(one.endpoint, []).append(one)
    return max(
        (
            rounds([len(one.exchanges) for one in group], min(one.outstanding for one in group))
            for group in behind.values()
        ),
        default=0,
    )


def read_exchange(words: int) -> Exchange:
    """Return function code 3: address, code, first register, count, CRC; and the words."""
    return Exchange(8, 5 + 2 * words, 3)


def write_exchange(words: int, several: bool = True) -> Exchange:
    """Return function code 16, or 6."""
    return Exchange(9 + 2 * words, 8, 16) if several else Exchange(8, 8, 6)


def both_exchange(read: int, written: int) -> Exchange:
    """Return function code 23."""
    return Exchange(13 + 2 * written, 5 + 2 * read, 23)


def exchanges_of(device: Device, functions: Sequence[int] | None = None) -> list[Exchange]:
    """Return the requests of a cycle to one drive."""
    functions = device.functions if functions is None else functions
    profile = device.profile
    blocks = profile.blocks(device.read_names)
    reads = [
        Exchange(8, 6, READERS[block.table])
        if block.table in BITS
        else read_exchange(block.words)._replace(function=READERS[block.table])
        for block in blocks
    ]
    words = device.command.words
    after = [
        write_exchange(profile.registers[step.register_name].words, 16 in functions)
        for step in profile.after_command
    ]
    if {3, 16, 23} <= set(functions) and blocks[0].table == "holding" and not after:
        return [both_exchange(blocks[0].words, words), *reads[1:]]
    return [write_exchange(words, 16 in functions), *after, *reads]


def cycle_s(options: ModbusOptions, drives: Sequence[Load], slot_s: float) -> float:
    """Return the time of one cycle [s]: from the request until the last response is in.

    With a divisor (`slot_s` above 0) the loop looks at the line once a slot: every exchange but
    the last takes whole slots, and so does the silence after it.
    """
    if options.link == "tcp":
        count = _greatest_rounds(drives)
        spent = options.turnaround + HOST_S
        each = math.ceil(spent / slot_s) * slot_s if slot_s > 0.0 else spent
        return each * (count - 1) + spent if count else 0.0
    char, gap = options.bits / options.baud, options.gap
    spent = 0.0
    flat = [one for drive in drives for one in drive.exchanges]
    for number, one in enumerate(flat):
        spent += one.time_s(char, gap, options.turnaround) - gap + options.latency_s
        if number == len(flat) - 1:
            break
        if slot_s > 0.0:
            spent = math.ceil(spent / slot_s - 1e-9) * slot_s
            spent = math.ceil((spent + gap) / slot_s - 1e-9) * slot_s
        else:
            spent += gap
    return spent


def budget(options: ModbusOptions, bus: BusSpec) -> Budget:
    """Return the bus time of one cycle, and what would shorten it.

    Raises
    ------
    ConfigError
        The axes do not go with the devices.
    """
    devices = match_devices(options, bus)
    drives = [load_of(device) for device in devices]
    spent = needed_s(options, drives, bus)
    remedies = _remedies(options, devices, bus)
    remedy = f"more axes or a higher rate, each alone: {', '.join(remedies)}" if remedies else ""
    greatest = _greatest_hz(options, drives, bus)
    return Budget(spent, greatest, _arithmetic(options, drives, bus), remedy)


def needed_s(options: ModbusOptions, drives: Sequence[Load], bus: BusSpec) -> float:
    """Return the least period of the bus [s] that leaves time for the responses."""
    slot = 1.0 / (bus.rate_hz * bus.divisor) if bus.divisor > 1 else 0.0
    spent = cycle_s(options, drives, slot)
    share = (bus.divisor - 1.0 + READ_SHARE) / bus.divisor
    gap = options.gap if options.link == "rtu" else 0.0
    return max(spent / share, spent + gap)


def _greatest_hz(options: ModbusOptions, drives: Sequence[Load], bus: BusSpec) -> float:
    if bus.divisor == 1:
        return 1.0 / needed_s(options, drives, bus)
    nth = _fitting_divisor(options, drives, bus)
    return bus.rate_hz * bus.divisor / nth


def _fitting_divisor(options: ModbusOptions, drives: Sequence[Load], bus: BusSpec) -> int:
    """Return the least divisor of the rig's rate at which the bus has time enough."""
    rate = bus.rate_hz * bus.divisor
    nth = max(1, math.floor(cycle_s(options, drives, 0.0) * rate))  # no less can be enough
    while needed_s(options, drives, bus._replace(rate_hz=rate / nth, divisor=nth)) > nth / rate:
        nth += 1
    return nth


def _arithmetic(options: ModbusOptions, drives: Sequence[Load], bus: BusSpec) -> str:
    flat = [one for drive in drives for one in drive.exchanges]
    drive_count = _counted(len(drives), "drive")
    codes = " + ".join(f"FC {one.function}" for one in drives[0].exchanges) if drives else "nothing"
    if options.link == "tcp":
        most = _greatest_rounds(drives)
        spent = cycle_s(options, drives, 0.0)
        return (
            f"TCP: {drive_count}{_together(drives)} ({codes}), "
            f"{_counted(most, 'exchange')}{' one after the other' if most > 1 else ''}, "
            f"{options.turnaround * 1e3:g} ms each (turnaround_s, as "
            f"{'given' if options.turnaround_s is not None else 'assumed; measured when run'}) + "
            f"{HOST_S * 1e3:g} ms of host and network = {spent * 1e3:.3f} ms"
            + _in_time(options, drives, bus)
        )
    chars = sum(one.sent + one.answered for one in flat)
    wire = chars * options.bits / options.baud
    gaps = 2 * len(flat) * options.gap
    text = (
        f"RTU: {drive_count} ({codes}), {chars} characters x {options.bits} bits at "
        f"{options.baud} baud = {wire * 1e3:.3f} ms + {2 * len(flat)} silences of "
        f"{options.gap * 1e3:.3f} ms"
    )
    if options.turnaround > 0.0:
        text += f" + {len(flat)} x {options.turnaround * 1e3:g} ms turnaround"
    if options.latency_s > 0.0:
        text += f" + {len(flat)} x {options.latency_s * 1e3:g} ms USB latency timer"
    total = wire + gaps + len(flat) * (options.turnaround + options.latency_s)
    text += f" = {total * 1e3:.3f} ms"
    if bus.divisor > 1:
        slots = cycle_s(options, drives, 1.0 / (bus.rate_hz * bus.divisor))
        text += f"; polled once per cycle of the rig, all are in after {slots * 1e3:.3f} ms"
    return text + _in_time(options, drives, bus)


def _together(drives: Sequence[Load]) -> str:
    """Say which drives wait for others."""
    if len(drives) < 2:
        return ""
    if _greatest_rounds(drives) == max(len(one.exchanges) for one in drives):
        return " in parallel"
    least = min(one.outstanding for one in drives)
    return (
        f" in turn, {_counted(least, 'request')} outstanding per connection (outstanding in the "
        "profile)"
    )


def _in_time(options: ModbusOptions, drives: Sequence[Load], bus: BusSpec) -> str:
    """Say when the responses have to be in, so that the loop has its share of the cycle."""
    share = (bus.divisor - 1.0 + READ_SHARE) / bus.divisor
    what = "responses" if options.link == "tcp" else "responses, without the last silence,"
    return (
        f"; {what} have to be in by {share:.0%} of a period of the bus: "
        f"{needed_s(options, drives, bus) * 1e3:.3f} ms"
    )


def _counted(count: int, what: str) -> str:
    return f"{count} {what}" if count == 1 else f"{count} {what}s"


def _remedies(options: ModbusOptions, devices: Sequence[Device], bus: BusSpec) -> list[str]:
    """Return what each single change would bring, and the divisor that needs none."""
    drives = [load_of(device) for device in devices]

    def rate(changed: ModbusOptions, load: Sequence[Load]) -> str:
        return f"{_greatest_hz(changed, load, bus):.0f} Hz"

    remedies = []
    if options.link == "rtu":
        for baud in (115_200, 1_000_000):
            if options.baud < baud:
                changed = options.model_copy(update={"baud": baud})
                remedies.append(f"baud: {baud} gives {rate(changed, drives)}")
        scaled = 3.5 * options.bits / options.baud
        if options.gap > 1.01 * scaled:
            changed = options.model_copy(update={"gap_s": scaled})
            remedies.append(
                f"gap_s: {scaled:.3g} (3.5 characters, if the drives take it) gives "
                f"{rate(changed, drives)}"
            )
        if len(devices) > 1:
            remedies.append(f"one drive fewer on this line gives {rate(options, drives[:-1])}")
    both = [load_of(device, (3, 16, 23)) for device in devices]
    if both != drives:
        remedies.append(f"drives that accept function code 23 give {rate(options, both)}")
    at_once = [one._replace(outstanding=len(drives)) for one in drives]
    if options.link == "tcp" and _greatest_rounds(at_once) < _greatest_rounds(drives):
        remedies.append(
            f"outstanding: {len(drives)} in the profile, if the server takes that many requests at "
            f"once, gives {rate(options, at_once)}"
        )
    if options.turnaround > 0.0:
        changed = options.model_copy(update={"turnaround_s": 0.0})
        remedies.append(f"drives without turnaround give {rate(changed, drives)}")
    nth = _fitting_divisor(options, drives, bus)
    master = bus.rate_hz * bus.divisor
    if nth != bus.divisor:
        remedies.append(
            f"divisor: {nth} on this bus ({master / nth:.3g} Hz) fits without other changes"
        )
    return remedies
