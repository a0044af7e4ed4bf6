"""The watchdogs, armed at zero effort and tripped on purpose: this host says nothing."""

from __future__ import annotations

from collections.abc import Generator, Sequence

from tautwave.config import Rig
from tautwave.registry import load_driver
from tautwave.session.acceptance.document import Check
from tautwave.session.guided.control import GuidedControl

ARMED_S, LONGER, LISTEN_S = 0.2, 3.0, 1.0
"""Cycles before the silence, its length in time-outs of the slowest device, and cycles after it."""


def silences(
    rig: Rig, axes: Sequence[str], control: GuidedControl
) -> Generator[None, None, list[Check]]:
    """Send nothing for longer than any watchdog waits; each device has to let go by itself."""
    yield from control.ask(
        "the drives are enabled with zero effort, and their watchdogs armed; press Enter, and this "
        "host is silent until each of them has let go by itself"
    )
    bound = control.watchdogs()
    yield from _cycles(ARMED_S, control)
    seconds = LONGER * max([one for one in bound.values() if one is not None], default=0.0)
    control.fall_silent(seconds)
    yield from _cycles(LISTEN_S, control)
    checks = []
    for name in axes:
        if not load_driver(rig.buses[rig.axes[name].bus].driver).hardware:
            continue  # nothing that could go on by itself
        limit = bound.get(name)
        if limit is None:
            allowed: dict[str, float | str] = {"watchdog": "none, allowed by --allow-unwatched"}
            checks.append(Check("silence", name, allowed, "a hand on its power", True))
            continue
        heard = control.faults.get(name, "")
        numbers: dict[str, float | str] = {
            "watchdog_s": limit, "silent_s": seconds, "said": heard or "nothing"
        }  # fmt: skip
        checks.append(
            Check("silence", name, numbers, "lets go by itself, and says so", bool(heard))
        )
    return checks


def _cycles(seconds: float, control: GuidedControl) -> Generator[None, None, None]:
    until = control.now_ns + 1e9 * seconds
    while control.now_ns < until:
        yield
