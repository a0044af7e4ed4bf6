"""What simulated servos on a serial line have alike, whatever they speak: time, faults, serving."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from tautwave.clock import MonotonicClock
from tautwave.errors import ConfigError
from tautwave.truth import AxisModel
from tautwave_sim.wire.pty import serve_line
from tautwave_sim.wire.serial import SerialLine
from tautwave_sim.wire.serial_faults import FaultPlan

Faults = TypeVar("Faults", bound=BaseModel)
IDLE_PERIOD_NS = 1_000_000
"""Of the slots of a bus without an axis."""


class LineWorld:
    """Simulated servos of one bus, `servos`, and their `line`."""

    line: SerialLine
    servos: Sequence[Any]

    def advance(self, to_ns: int) -> None:
        """Process all events up to `to_ns` [ns]."""
        self.line.advance(to_ns)

    def close(self) -> None:
        """Nothing to release."""


def planned(bus_name: str, faults: Any) -> tuple[FaultPlan, list[Any]]:
    """Return the plan of a bus' faults and its events; equal for equal seed and name."""
    events = [one.event() for one in faults.events]
    seed = (faults.seed, zlib.crc32(bus_name.encode()))
    return FaultPlan(seed, faults.chances(), events), events


def slot_ns(truths: Sequence[AxisModel]) -> int:
    """Return the period of the slots that the axes move on [ns]."""
    return round(truths[0].period * 1e9) if truths else IDLE_PERIOD_NS


def is_served(options: Any) -> bool:
    """Return whether servos live in a process of their own on the real clock."""
    return bool(options.port == "sim")


def serve_world(
    driver: str,
    make: Callable[[MonotonicClock], LineWorld],
    link: str | None,
    announce: Callable[[Mapping[str, Any]], None],
    stopped: Callable[[], bool],
) -> None:
    """Serve servos on a pseudo-terminal until `stopped()`; `link`: a path that leads to it."""
    clock = MonotonicClock()
    world = make(clock)

    def report(path: str) -> None:
        announce(
            {
                "driver": driver,
                "endpoint": path,
                "models": {servo.device_id: servo.model.name for servo in world.servos},
                "options": {"port": path},
            }
        )

    serve_line(world.line, report, stopped, None if link is None else Path(link), clock)


def bench_faults(driver: str, model: type[Faults], seed: int, given: Mapping[str, Any]) -> Faults:
    """Return the faults that a command line gives.

    Raises
    ------
    ConfigError
        There is no such fault, or no such value of it.
    """
    try:
        return model.model_validate({"seed": seed, **given})
    except ValidationError as err:
        problems = []
        for problem in err.errors():
            where = ".".join(str(part) for part in problem["loc"])
            got = f"(got {problem['input']!r})"
            problems.append(f"sim {driver}: --faults: {where}: {problem['msg']} {got}")
        raise ConfigError(problems) from err
