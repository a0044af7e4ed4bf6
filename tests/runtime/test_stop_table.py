"""What every kind of axis is sent after its last good sample: each case of the table, run."""

from __future__ import annotations

import sys
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from tautwave.config import Rig
from tautwave.errors import ConfigError, DriverError
from tautwave.rig import build_rig
from tautwave.simulation import simulate
from tests.rigs.running import rig_of, tree
from tests.runtime import stopping
from tests.runtime.stopping import (
    LATE,
    LIMIT,
    OVERRUN,
    Done,
    bench_tree,
    fail,
    is_served,
    rig_for,
    stop_row,
    wrong,
)
from tests.session.sites import FAR, Half, Pair

sys.path.insert(0, str(Path(__file__).parents[2] / "docs"))
try:
    from _tools import stops
finally:
    sys.path.pop(0)

Group = tuple[str, str, bool, str, str]
GROUPS: dict[Group, list[str]] = defaultdict(list)
for cell in stops.cells():
    if not stops.reason(cell):
        group = (cell.kind, cell.law, cell.account, cell.place, cell.engine)
        GROUPS[group].append(cell.failure)


def named(values: Sequence[Any]) -> str:
    kind, law, account, *rest = values
    return ", ".join((kind, f"{law} in an account" if account else law, *rest))


STATES = ("pd_damping", "position_force", "four_channel")
KERNELS: dict[str, list[Group]] = defaultdict(list)
"""Groups by what they have compiled, once for all: to compile takes most of the time."""
for it in GROUPS:
    if it[4] != "python":
        law = "states" if it[1].startswith(STATES) else it[1].partition(" measured")[0]
        KERNELS[named(("every kind", law, *it[2:]))].append(it)
FEW = [
    ("effort", "position", False, "plain", "python", "silent"),
    ("effort", "pd_damping", True, "plain", "python", "stall"),
    ("effort", "position_force measured", False, "plain", "python", stops.FED),
    ("effort", "wave", False, "operated", "python", "late"),
    ("effort", "four_channel", True, "link", "python", "position"),
    ("effort", "mediated", False, "plain", "python", "fault"),
    ("effort", "wave", False, "slow", "python", "silent"),
    ("velocity", "wave", False, "plain", "python", "silent"),
    ("follower", "wave", False, "plain", "python", "silent"),
    ("scene", stops.ALONE, False, "plain", "python", "late"),
    ("excited", stops.ALONE, False, "plain", "python", "late"),
]
"""Of every kind but the slow tips one, in the default run."""


def rig_in(kind: str, law: str, account: bool, place: str, engine: str) -> Rig:
    return rig_for(kind, law, account=account, place=place, engine=engine)


def failing_axes(rig: Rig, kind: str, law: str, failure: str) -> list[str]:
    """Return the axes of which the failure is tried: of those that take effort, both sides."""
    name = next(iter(rig.master.axes))
    if kind == "scene":
        return [f"master.{name}"]
    sides = ["master", "slave"] if kind in ("effort", "excited") else ["slave"]
    if failure == stops.FED:
        sides = stops.LAWS[law].split(", ")
    return [f"{side}.{name}" for side in sides]


def check(done: Done, kind: str, failure: str, axis: str, place: str, silent: str) -> None:
    """Hold every cycle after the last good sample against the table.

    The `silent` axis need not push: that of a law which renders what it has not found yet.
    """
    rig, rows = done.rig, done.rows
    sent = stops.TABLE[kind][failure]
    first = int(np.searchsorted(rows["time_s"], done.slot * rig.period_s - 1e-9))
    if sent.rule == stops.LEAVE:
        assert isinstance(done.error, DriverError)
        assert not any(is_served(rig, rows, axis, k) for k in range(first, len(rows["time_s"])))
        for written in done.written.values():
            last = written[max(written)]
            assert (last.effort, last.velocity) == (0.0, 0.0)
        return
    assert abs(rows[f"{axis}.commanded"][first - 1]) > 0.05 or axis == silent, "it did not push"
    holds = place == "operated"
    if sent.begins and not holds:
        assert done.error is not None
    elif not sent.begins:
        assert done.error is None
    begins = {stops.LIMIT: LIMIT, stops.AT_ONCE: 0, stops.NEVER: None}[sent.begins]
    bus = rig.axes[axis].bus
    of_bus = [name for name in rig.axes if rig.axes[name].bus == bus]
    rule = sent.rule
    if failure == "fault" and "tip" in kind:  # its joints get nothing of it
        for joint in done.joints.values():
            got = [c for slot, c in joint.items() if slot >= done.slot]
            assert got
            assert all((c.effort, c.velocity) == (0.0, 0.0) for c in got)
        rule = stops.DAMP
    found = []
    for name in of_bus:
        found += [
            f"{name}, {it}" for it in wrong(rig, rows, name, first, rule, begins, holds=holds)
        ]
    stops_at = None
    if begins is not None:
        at = first if failure == "stall" else stop_row(rig, rows, axis, first, begins)
        # Skipped slots are found by the axis itself, and the others hear of it a cycle later.
        stops_at = (at, failure == "late")
    for name in set(rig.axes) - set(of_bus):
        found += [
            f"{name}, {it}"
            for it in wrong(rig, rows, name, first, sent.others, None, stops_at, holds=holds)
        ]
    assert not found, "\n".join(found[:5])
    for name, written in done.written.items():
        takes = rig.axes[name].causality == "impedance"
        for k in range(first, len(rows["time_s"])):
            if not is_served(rig, rows, name, k):
                continue
            command = written[round(rows["time_s"][k] * rig.rate_hz)]
            value = command.effort if takes else command.velocity
            assert value == rows[f"{name}.commanded"][k] or (
                last_of(written, command) and not value
            )


def last_of(written: dict[int, Any] | Any, command: Any) -> bool:
    """Whether it is the last command: what a loop leaves with is in the same slot."""
    return bool(command is written[max(written)])


def try_all(group: Group, failures: Sequence[str]) -> None:
    kind, law, _, place, engine = group
    if engine == "simulate":
        simulated(rig_in(*group[:4], "python"))
        return
    for failure in failures:
        rig = rig_in(*group)
        for axis in failing_axes(rig, kind, law, failure):
            done = fail(rig, failure, axis, excited=kind == "excited")
            assert done.control.startswith("Compiled") == (engine == "compiled")
            try:
                silent = axis if law.startswith("mediated") and axis.startswith("master") else ""
                check(done, kind, failure, axis, place, silent)
            except AssertionError as err:
                raise AssertionError(f"{failure} of {axis}: {err}") from err


@pytest.mark.parametrize("values", FEW, ids=named)
def test_an_axis_is_sent_what_the_table_says(values: tuple[Any, ...]) -> None:
    *group, failure = values
    try_all(tuple(group), [failure])


def refusal(data: Any) -> str:
    """Return the sentence by which a rig is refused."""
    with pytest.raises(ConfigError) as refused:
        build_rig(rig_of(data), clock="fake")
    return str(refused.value)


def test_what_cannot_be_is_refused() -> None:
    for law in ("position", "pd_damping", "position_force", "four_channel", "mediated"):
        data = bench_tree("velocity", law, account=False)
        assert "impedance" in refusal(data), law
    assert "keeps its own accounts" in refusal(bench_tree("effort", "wave", account=True))
    operated = tree({"operate": {}, "loop.engine": "compiled"})
    assert "an operated rig runs in plain Python" in refusal(operated)
    for law in stopping.KEYS:
        if law != "wave":
            slow = bench_tree("effort", law, account=False)
            slow["buses"]["arm"]["divisor"] = stopping.SLOW
            assert "needs both sides at the same rate" in refusal(slow), law
    tip = stopping.tip_tree("tip", "position", account=False)
    tip["slave"]["axes"]["x"]["effort_sensor"] = {}
    assert "effort_sensor" in refusal(tip)


def test_every_failure_is_in_the_table_or_cannot_be() -> None:
    """Every kind, law, place and engine is run under some failure, and every failure somewhere."""
    there = [cell for cell in stops.cells() if not stops.reason(cell)]
    for field, known in (
        ("kind", stops.KINDS), ("law", [*stops.LAWS, stops.ALONE]), ("place", stops.PLACES),
        ("engine", stops.ENGINES), ("failure", [*stops.FAILURES, stops.FED]),
    ):  # fmt: skip
        assert {getattr(cell, field) for cell in there} == set(known)
    assert {cell.kind for cell in there if cell.failure == "effort"} == set(stops.KINDS)


def in_python(group: Group) -> Any:
    """Return it as a parameter; tips and operated rigs take long."""
    slow = "tip" in group[0] or group[3] == "operated"
    marks = [pytest.mark.slow, pytest.mark.nightly] if slow else [pytest.mark.slow]
    return pytest.param(group, marks=marks, id=named(group))


@pytest.mark.parametrize(
    "group", [in_python(it) for it in GROUPS if it[3] not in stops.SITES and it[4] == "python"]
)
def test_every_case_in_plain_python(group: Group) -> None:
    try_all(group, GROUPS[group])


@pytest.mark.slow
@pytest.mark.nightly
@pytest.mark.timeout(600)
@pytest.mark.parametrize("kernel", KERNELS)
def test_every_case_compiled(kernel: str) -> None:
    pytest.importorskip("numba")
    for group in KERNELS[kernel]:
        try_all(group, GROUPS[group])


def simulated(rig: Rig) -> None:
    """Lose samples and skip slots at random until an axis stops; check every row of both."""
    assert rig.simulation is not None
    faults = rig.simulation.faults.model_copy(
        update={"missing_probability": 0.25, "overrun_probability": 0.04, "overrun_slots": 1}
    )
    stopped = 0
    for seed in range(16):
        given = rig.simulation.model_copy(update={"faults": faults})
        done = simulate(rig.model_copy(update={"seed": seed, "simulation": given}))
        rows = {name: done[name] for name in done.columns}
        alone = [lone(rig, rows, name) for name in rig.axes]
        stop = min(alone)
        if stop < PUSHING or done.error is None:
            continue
        stopped += 1
        in_a_row = max(misses(rig, rows, name, stop) for name in rig.axes)
        found = []
        for name, own in zip(rig.axes, alone, strict=True):
            sent = stops.TABLE["effort"]["silent"]
            begins = LIMIT if own == stop else None
            at = None if own == stop else (stop, in_a_row < LIMIT)
            found += [f"{name}, {it}" for it in
                      wrong(rig, rows, name, PUSHING, sent.others, begins, at)]  # fmt: skip
        assert not found, f"seed {seed}: " + "\n".join(found[:5])
    assert stopped >= 2


PUSHING = 120
"""Row from which both sides push."""


def lone(rig: Rig, rows: dict[str, Any], name: str) -> int:
    """Return the row in which an axis has had no sample for too many periods of its bus."""
    unseen = served = 0
    for k, valid in enumerate(rows[f"{name}.valid"]):
        if not is_served(rig, rows, name, k):
            continue
        now = round(rows["time_s"][k] * rig.rate_hz + 1) // rig.axis_divisor(name)
        unseen = 0 if valid > 0.5 else unseen + now - served
        served = now
        if unseen >= LIMIT:
            return k
    return len(rows["time_s"])


def misses(rig: Rig, rows: dict[str, Any], name: str, row: int) -> int:
    """Return how many exchanges in a row, up to this row's, an axis has had no sample."""
    own = [rows[f"{name}.valid"][k] > 0.5 for k in range(row + 1) if is_served(rig, rows, name, k)]
    return own[::-1].index(True)


GAINS = "stiffness: 8.0, damping: 0.05"
LEVER = {
    "wave": "wave_impedance: 0.05, wave_filter_hz: 100",
    "pd_damping": f"{GAINS}, injection: 0.05",
    "position_force": f"{GAINS}, master_damping: 0.05",
    "mediated": f"{GAINS}, touch: 0.02, stiffest: 20",
}
PUSHES = 450
"""Slot by which both sites push; operated ones engage first, and push later."""
HEARS = 3
"""Slots in which the other site hears of a stop."""
STEP = 10.0
"""[N m/s] `effort_rate_limit`: an effort takes some slots to go."""


class Both(NamedTuple):
    """What the site did whose device failed, what the other one did, and when that one stopped."""

    failed: Done
    other: Done
    stopped: int


def at_sites(law: str, account: bool, failure: str, side: str, operated: bool) -> Both:
    """Run two sites; the device of one fails once both push."""
    name, _, measured = law.partition(" ")
    keys = LEVER.get(name, GAINS) + (", effort: measured" if measured else "")
    books = "account: {}, " if account else ""
    at = PUSHES + (500 if operated else 0)
    until = at / 1000.0
    two = Pair(
        f"coupling={{law: {name}, {books}release_ramp_s: 0.05, pairs: {{lever: {{{keys}}}}}}}",
        f"loop={{missing_limit: {LIMIT}, overrun_limit: {OVERRUN}}}",
        *(f"{it}.axes.lever.effort_rate_limit={STEP}" for it in ("master", "slave")),
        *(f"{it}.axes.lever.effort_sensor={{}}" for it in ("master", "slave") if measured),
        "simulation.environment.lever={type: spring, stiffness: 4.0, position: 0.0}",
        "simulation.hand.lever.reference={type: minimum_jerk, "
        f"waypoints: [[{until - 0.25}, 0], [{until}, 0.25]]}}",
        *(("operate={start: engaged}",) if operated else ()),
    )
    try:
        half, other = two.sites[side], two.sites["slave" if side == "master" else "master"]
        (bus,) = half.built.buses
        stopping.Failing(bus.driver, failure, lambda: half.slot - at, f"{side}.lever")
        slots: dict[str, list[int]] = {"master": [], "slave": []}
        skipped, stopped = [], -1
        while half.slot < min(half.control.end, at + 150):
            skip = 0
            if half.slot >= at:
                skip = LATE if failure == "late" else 0
                if failure == "stall" and half.slot == at:
                    skip = OVERRUN
            for _ in range(skip):
                two.run(1, other)
                slots[other.side].append(other.slot - 1)
                stopped = two.slot if stopped < 0 and has_stopped(other) else stopped
            if skip >= OVERRUN:
                half.control.overrun(two.slot, skip)
            two.run(1)
            stopped = two.slot - 1 if stopped < 0 and has_stopped(other) else stopped
            slots[side].append(half.slot - 1)
            slots[other.side].append(other.slot - 1)
            skipped.append(skip)
        found = []
        for it in (half, other):
            rows = {column: it[column] for column in it.control.columns}
            rows["time_s"] = np.array(slots[it.side]) * it.rig.period_s
            none = np.zeros(len(rows["time_s"]))
            rows["skipped_slots"] = np.array(skipped, float) if it is half else none
            kind = type(it.control).__name__
            found.append(Done(it.rig, at, rows, {}, {}, it.control.error(), kind))
        return Both(*found, stopped)
    finally:
        two.close()


def has_stopped(half: Half) -> bool:
    """Whether the axis of a site is in a stop or a hold."""
    (own,) = half.control._own
    return bool(half.control.axes[own].stopping) or (
        half.rig.operate is not None and half.state == "holding"
    )


@pytest.mark.slow
@pytest.mark.nightly
@pytest.mark.parametrize("group", [it for it in GROUPS if it[3] in stops.SITES], ids=named)
def test_every_case_at_two_sites(group: Group) -> None:
    """The other site holds once it hears of it, and its axis is sent what is seen as it is."""
    kind, law, account, place, _ = group
    operated = place != "sites"
    for failure in GROUPS[group]:
        sides = stops.LAWS[law].split(", ") if failure == stops.FED else ("master", "slave")
        for side in sides:
            done, far, stopped = at_sites(law, account, failure, side, operated)
            sent = stops.TABLE[kind][failure]
            first = int(np.searchsorted(done.rows["time_s"], done.slot * done.rig.period_s - 1e-9))
            begins = {stops.LIMIT: LIMIT, stops.AT_ONCE: 0, stops.NEVER: None}[sent.begins]
            name, other = f"{side}.lever", f"{FAR[side]}.lever"
            pushed = [abs(it.rows[f"{which}.commanded"][first - 1]) / (1e-3 * STEP)
                      for it, which in ((done, name), (far, other))]  # fmt: skip
            assert min(pushed) > 3.0, f"{failure} of {name}: they push {pushed} steps"
            assert (done.error is None) == (begins is None or operated)
            assert far.error is None
            assert (stopped < 0) == (begins is None)
            found = list(wrong(done.rig, done.rows, name, first, sent.rule, begins, holds=operated))
            stops_at = None
            if begins is not None:
                row = first if failure == "stall" else (
                    stop_row(done.rig, done.rows, name, first, begins)
                )  # fmt: skip
                slot = round(1e3 * done.rows["time_s"][row])
                assert 0 <= stopped - slot <= HEARS, f"{failure} of {name}: {slot}, {stopped}"
                stops_at = (stopped, False)
            found += wrong(
                far.rig, far.rows, other, done.slot, sent.others, None, stops_at, holds=True
            )
            assert not found, f"{failure} of {name}: " + "\n".join(found[:5])
