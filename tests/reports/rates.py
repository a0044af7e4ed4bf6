"""Which PC, which adapter, which rate: `python -m tests.reports.rates --write`.

What a bus allows is the arithmetic of `tautwave check`; what a machine keeps is in the files here.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from typing import NamedTuple

from tautwave.config import load_rig
from tautwave.session.acceptance.shared import read_shared
from tautwave.session.checking import bus_budgets
from tests.reports.table import HERE, reports

PAGE = HERE.parents[1] / "docs" / "which-rate.md"
CONFIGS = HERE.parents[1] / "configs"
HEAD = """# Which PC, which adapter, which rate

Two things limit the rate of a rig: what its buses can carry, and what its computer keeps. `tautwave
check` computes the first for your rig, `tautwave doctor` finds what can be improved, and
[Measure your machine](howto/measure-your-machine.md) has the commands that measure the second.

## What a bus allows

Two devices on one bus, as `check` computes it. The adapter is often the slowest part: a USB adapter
hands an answer on with the next frame of its bus.

| bus | adapter | an exchange takes | greatest rate |
|---|---|---|---|
"""
MACHINES = """
## What a machine kept

Of the files that were handed on ([Tried on](tried-on.md)): how late the loop woke, and how long a
cycle took to compute, in the last stage of each.
"""
COLUMNS = """
| processor | system | bus, rate | late, 99 % and longest | computing, 99 % |
|---|---|---|---|---|
"""
NOBODY = """
Nobody has handed on a file from the real clock yet. Yours would be the first row: `tautwave accept
RIG --share FILE`, or simulated devices on your machine with `tautwave accept RIG --simulate`.
"""


class Case(NamedTuple):
    bus: str
    adapter: str
    rig: str
    keys: tuple[str, ...] = ()


CAN = "buses.can.options.usb_latency_s"
LINE = "buses.servos.options.usb_latency_s"
CASES = (
    Case("CANopen, 1 Mbit/s", "a card, or the board's own", "bench-canopen-virtual", (f"{CAN}=0",)),
    Case("CANopen, 1 Mbit/s", "USB at high speed", "bench-canopen-virtual", (f"{CAN}=0.000125",)),
    Case("CANopen, 1 Mbit/s", "USB at full speed", "bench-canopen-virtual", (f"{CAN}=0.001",)),
    Case("MIT motors, 1 Mbit/s", "a card, or the board's own", "bench-mit-virtual", (f"{CAN}=0",)),
    Case("MIT motors, 1 Mbit/s", "USB at full speed", "bench-mit-virtual", (f"{CAN}=0.001",)),
    Case("Dynamixel, 4 Mbaud", "the board's own UART", "bench-dynamixel-sim", (f"{LINE}=0",)),
    Case("Dynamixel, 4 Mbaud", "FTDI, timer 1 ms", "bench-dynamixel-sim", (f"{LINE}=0.001",)),
    Case("Dynamixel, 4 Mbaud", "FTDI, timer 16 ms", "bench-dynamixel-sim", (f"{LINE}=0.016",)),
)


def bus_rows() -> Iterator[str]:
    for case in CASES:
        rig = load_rig(CONFIGS / f"{case.rig}.yaml", list(case.keys))
        (found,) = bus_budgets(rig).values()
        rate = f"{float(f'{found.greatest_rate_hz:.3g}'):g}"
        yield f"| {case.bus} | {case.adapter} | {found.time_s * 1e3:.3g} ms | {rate} Hz |\n"


def machine_rows() -> Iterator[str]:
    for path in reports():
        one = read_shared(path)
        if one.clock != "real" or not one.stages:
            continue
        times = list(one.stages.values())[-1]["times_us"]
        late, spent = times["lateness_us"], times["compute_us"]
        buses = ", ".join(f"{bus['driver']} {bus['rate_hz']:g} Hz" for bus in one.buses.values())
        yield (
            f"| {one.machine.get('processor', '-')} | {one.machine.get('system', '-')} | {buses} | "
            f"{late['p99']:g} us, {late['max']:g} us | {spent['p99']:g} us |\n"
        )


def page() -> str:
    rows = "".join(machine_rows())
    return HEAD + "".join(bus_rows()) + MACHINES + (COLUMNS + rows if rows else NOBODY)


if __name__ == "__main__":
    if sys.argv[1:] == ["--write"]:
        PAGE.write_text(page())
    else:
        print(page(), end="")
