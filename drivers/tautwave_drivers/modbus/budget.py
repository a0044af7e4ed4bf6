"""Bus time of one cycle: characters and silences on a serial line, answers over TCP.

Serial: each request and each answer is followed by 3.5 characters of silence (1.75 ms above 19200
baud), after which the other side knows that the frame is over; then the drive takes its turnaround.
TCP: the drive's own answer time, as given; connections are asked at the same time.
Source: MODBUS over Serial Line V1.02, 2.5.1.1.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from tautwave.contracts import READ_SHARE, Budget, BusSpec
from tautwave_drivers.modbus.options import Device, ModbusOptions, match_devices
from tautwave_drivers.modbus.registers import blocks_of

BRIDGE = 16
"""Words read for nothing to save a request of their own: some 20 characters and two silences."""

HOST_S = 1.5e-4
"""What the host and its network add to an exchange over TCP; measured 0.03 to 0.13 ms."""


class Exchange(NamedTuple):
    """One request and its answer: characters of an RTU frame each way, and the function code."""

    sent: int
    answered: int
    function: int

    def time_s(self, char_s: float, gap_s: float, turnaround_s: float) -> float:
        """Return the time on a serial line from the first character to the last silence [s]."""
        return (self.sent + self.answered) * char_s + 2.0 * gap_s + turnaround_s


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
    """Return what a cycle asks of one drive."""
    functions = device.functions if functions is None else functions
    profile = device.profile
    roles = ["position", "status"] + ([] if device.impedance else ["effort"])
    wanted = [
        (name, profile.registers[name].address, profile.registers[name].words)
        for name in (profile.roles[role] for role in roles)  # type: ignore[index]
    ]
    blocks = blocks_of(wanted, profile.readable, profile.gaps == "readable", BRIDGE)
    position = profile.roles["position"]
    blocks.sort(key=lambda block: position not in block.names)
    reads = [read_exchange(block.words) for block in blocks]
    words = device.command.words
    if {3, 16, 23} <= set(functions):
        return [both_exchange(blocks[0].words, words), *reads[1:]]
    return [write_exchange(words, 16 in functions), *reads]


def cycle_s(options: ModbusOptions, drives: Sequence[Sequence[Exchange]], slot_s: float) -> float:
    """Return the time of one cycle [s]: from the request until the last answer is there.

    With a divisor (`slot_s` above 0) the loop looks at the line once a slot: every exchange but
    the last takes whole slots, and so does the silence after it.
    """
    if options.link == "tcp":
        most = 0.0
        for exchanges in drives:
            spent = options.turnaround + HOST_S
            each = math.ceil(spent / slot_s) * slot_s if slot_s > 0.0 else spent
            most = max(most, each * (len(exchanges) - 1) + spent)
        return most
    char, gap = options.bits / options.baud, options.gap
    spent = 0.0
    flat = [one for exchanges in drives for one in exchanges]
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
    drives = [exchanges_of(device) for device in devices]
    spent = needed_s(options, drives, bus)
    told = _remedies(options, devices, bus)
    remedy = f"more axes or a higher rate, each alone: {', '.join(told)}" if told else ""
    greatest = _greatest_hz(options, drives, bus)
    return Budget(spent, greatest, _arithmetic(options, drives, bus), remedy)


def needed_s(options: ModbusOptions, drives: Sequence[Sequence[Exchange]], bus: BusSpec) -> float:
    """Return the least period of the bus [s] that leaves time for the answers."""
    slot = 1.0 / (bus.rate_hz * bus.divisor) if bus.divisor > 1 else 0.0
    spent = cycle_s(options, drives, slot)
    share = (bus.divisor - 1.0 + READ_SHARE) / bus.divisor
    gap = options.gap if options.link == "rtu" else 0.0
    return max(spent / share, spent + gap)


def _greatest_hz(
    options: ModbusOptions, drives: Sequence[Sequence[Exchange]], bus: BusSpec
) -> float:
    if bus.divisor == 1:
        return 1.0 / needed_s(options, drives, bus)
    nth = _fitting_divisor(options, drives, bus)
    return bus.rate_hz * bus.divisor / nth


def _fitting_divisor(
    options: ModbusOptions, drives: Sequence[Sequence[Exchange]], bus: BusSpec
) -> int:
    """Return the least divisor of the rig's rate at which the bus has time enough."""
    rate = bus.rate_hz * bus.divisor
    nth = max(1, math.floor(cycle_s(options, drives, 0.0) * rate))  # no less can be enough
    while needed_s(options, drives, bus._replace(rate_hz=rate / nth, divisor=nth)) > nth / rate:
        nth += 1
    return nth


def _arithmetic(options: ModbusOptions, drives: Sequence[Sequence[Exchange]], bus: BusSpec) -> str:
    flat = [one for exchanges in drives for one in exchanges]
    drives_told = _counted(len(drives), "drive")
    codes = " + ".join(f"FC {one.function}" for one in drives[0]) if drives else "nothing"
    if options.link == "tcp":
        most = max((len(one) for one in drives), default=0)
        spent = cycle_s(options, drives, 0.0)
        return (
            f"TCP: {drives_told}{' asked at the same time' if len(drives) > 1 else ''} ({codes}), "
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
        f"RTU: {drives_told} ({codes}), {chars} characters x {options.bits} bits at "
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
        text += (
            f"; looked at once a cycle of the rig, all answers are there after {slots * 1e3:.3f} ms"
        )
    return text + _in_time(options, drives, bus)


def _in_time(options: ModbusOptions, drives: Sequence[Sequence[Exchange]], bus: BusSpec) -> str:
    """Say what the loop needs besides: its share of a cycle of the rig, after the answers."""
    share = (bus.divisor - 1.0 + READ_SHARE) / bus.divisor
    what = "answers" if options.link == "tcp" else "answers, not the last silence,"
    return (
        f"; {what} have to be in by {share:.0%} of a period of the bus: "
        f"{needed_s(options, drives, bus) * 1e3:.3f} ms"
    )


def _counted(count: int, what: str) -> str:
    return f"{count} {what}" if count == 1 else f"{count} {what}s"


def _remedies(options: ModbusOptions, devices: Sequence[Device], bus: BusSpec) -> list[str]:
    """Return what each single change would bring, and the divisor that needs none."""
    drives = [exchanges_of(device) for device in devices]

    def rate(changed: ModbusOptions, load: Sequence[Sequence[Exchange]]) -> str:
        return f"{_greatest_hz(changed, load, bus):.0f} Hz"

    told = []
    if options.link == "rtu":
        for baud in (115_200, 1_000_000):
            if options.baud < baud:
                changed = options.model_copy(update={"baud": baud})
                told.append(f"baud: {baud} gives {rate(changed, drives)}")
        scaled = 3.5 * options.bits / options.baud
        if options.gap > 1.01 * scaled:
            changed = options.model_copy(update={"gap_s": scaled})
            told.append(
                f"gap_s: {scaled:.3g} (3.5 characters, if the drives take it) gives "
                f"{rate(changed, drives)}"
            )
        if len(devices) > 1:
            told.append(f"one drive less on this line gives {rate(options, drives[:-1])}")
    both = [exchanges_of(device, (3, 16, 23)) for device in devices]
    if both != drives:
        told.append(f"drives that accept function code 23 give {rate(options, both)}")
    if options.turnaround > 0.0:
        changed = options.model_copy(update={"turnaround_s": 0.0})
        told.append(f"drives that answer at once give {rate(changed, drives)}")
    nth = _fitting_divisor(options, drives, bus)
    master = bus.rate_hz * bus.divisor
    if nth != bus.divisor:
        told.append(f"divisor: {nth} on this bus ({master / nth:.3g} Hz) fits as it is")
    return told
