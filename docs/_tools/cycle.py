"""The page of one cycle's calls, traced while a shipped rig runs: it cannot be out of date."""

from __future__ import annotations

import inspect
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import CodeType, FrameType
from typing import Any, NamedTuple

import tautwave

RIG = Path(__file__).parents[2] / "configs/bench-1dof-loopback.yaml"
AXIS = "slave.lever"
WARM_UP = 400
"""Cycles before the traced one: the pair is engaged and its ramp is over."""

LEFT_OUT = ("tautwave.clock", "tautwave.runtime.timing", "tautwave.simulation", "tautwave_sim")
"""Modules whose calls are not the loop's own: clock, histograms, simulated devices."""


class Call(NamedTuple):
    """One function called in a cycle, and what it called; `times` in a row, with equal calls."""

    module: str
    name: str
    meaning: str
    calls: tuple[Call, ...]
    times: int = 1


class _Open(NamedTuple):
    code: CodeType
    module: str
    owner: Any
    calls: list[Call]


def traced() -> tuple[Call, ...]:
    """Return the calls of one steady cycle of the shipped rig, repeated ones once."""
    rig = tautwave.load_rig(RIG)
    top: list[Call] = []
    stack: list[_Open] = []

    def profile(frame: FrameType, event: str, _: object) -> None:
        module = frame.f_globals.get("__name__", "")
        if not module.startswith("tautwave") or frame.f_code.co_name.startswith("<"):
            return
        if event == "call":
            stack.append(_Open(frame.f_code, module, frame.f_locals.get("self"), []))
        elif event == "return" and stack and stack[-1].code is frame.f_code:
            done = stack.pop()
            calls = stack[-1].calls if stack else top
            if done.module.startswith(LEFT_OUT):
                calls.extend(done.calls if done.module.startswith("tautwave.simulation") else [])
            else:
                calls.append(_call(done, frame))

    with tautwave.Stepper(rig, outside=AXIS, clock="fake") as stepper:
        for _ in range(WARM_UP):
            stepper.step({AXIS: 0.0})
        sys.setprofile(profile)
        try:
            stepper.step({AXIS: 0.0})
        finally:
            sys.setprofile(None)
    return _folded(top)


def _call(done: _Open, frame: FrameType) -> Call:
    name = done.code.co_qualname if hasattr(done.code, "co_qualname") else done.code.co_name
    if done.owner is not None:
        name = f"{type(done.owner).__name__}.{done.code.co_name}"
        function = getattr(type(done.owner), done.code.co_name, None)
    else:
        function = frame.f_globals.get(done.code.co_name)
    text = inspect.getdoc(function.fget if isinstance(function, property) else function) or ""
    return Call(done.module, name, text.split("\n\n")[0].replace("\n", " "), _folded(done.calls))


def _folded(calls: Sequence[Call]) -> tuple[Call, ...]:
    """Return calls with equal ones in a row, alone or in groups, counted instead of repeated."""
    kept = list(calls)
    for size in range(1, len(kept) // 2 + 1):
        at = 0
        while at + 2 * size <= len(kept):
            group = kept[at : at + size]
            if group == kept[at + size : at + 2 * size]:
                del kept[at + size : at + 2 * size]
                kept[at : at + size] = [one._replace(times=one.times + one.times) for one in group]
            else:
                at += 1
    return tuple(kept)


def walked(calls: Sequence[Call], depth: int = 0) -> Iterator[tuple[int, Call]]:
    """Yield every call with its depth, in order."""
    for one in calls:
        yield depth, one
        yield from walked(one.calls, depth + 1)


def cycle_page() -> str:
    """Return the page."""
    lines = []
    for depth, one in walked(traced()):
        module = one.module.removeprefix("tautwave.")
        times = f" ({one.times} times)" if one.times > 1 else ""
        lines.append(f"{'    ' * depth}- `{one.name}`{times}, {module}: {one.meaning}\n")
    return (
        "# The calls of one cycle\n\n"
        f"Traced from one steady cycle of `{RIG.name}`, in order. What is called within a function "
        "is indented below it; calls for both axes in a row are counted. Clock, histograms and "
        "simulated devices are left out. [One control cycle](../../explanation/one-cycle.md) "
        "explains the phases.\n\n"
    ) + "".join(lines)
