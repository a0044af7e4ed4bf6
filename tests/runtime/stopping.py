"""Runs in which an axis fails while it pushes, and what it should have been sent; SI.

`rig_for` makes the rig of a cell of `docs/_tools/stops.py`, `fail` has its device fail, and `wrong`
says from rows and keys alone what an axis should have been sent after its last good sample.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml

from tautwave.clock import FakeClock
from tautwave.config import Rig
from tautwave.errors import DriverError
from tautwave.rig import build_rig
from tautwave.runtime.loop import Loop
from tautwave.runtime.operate.commands import Script, read_script
from tautwave.session.engine import with_engine
from tautwave.session.identification.exciting import Excitation, excite, plan_excitation
from tautwave.session.operating import with_operation
from tautwave.types import AxisCommand, Fault, JointState
from tautwave_scenes.session.pace import choose_engine, use_engine
from tests.arms.motions import FOLLOWING, PLANAR
from tests.rigs.running import ListSink, Tree, rig_of, tree

CONFIGS = Path(__file__).parents[2] / "configs"
GRIPPER = CONFIGS / "bench-gripper-loopback.yaml"
WALL = Path(__file__).parents[1] / "scene" / "wall.yaml"

LIMIT, OVERRUN, LATE = 5, 20, 2
"""`missing_limit`, `overrun_limit`, and the slots that a late host skips before each cycle."""

MOVED: Tree = {
    "duration_s": 0.36,
    "coupling.engage_ramp_s": 0.02,
    "coupling.release_ramp_s": 0.05,
    "simulation.hand.a": {
        "reference": {"type": "minimum_jerk", "waypoints": [[0.1, 0.0], [0.26, 0.08]]}
    },
    "simulation.environment.a": {"type": "spring", "stiffness": 200.0, "position": 0.0},
}
SIDE: Tree = {
    "effort_limit": 60.0,
    "effort_rate_limit": 800.0,
    "damping": {"value": 2.0, "lower": 1.5, "source": "test"},
}
FAILS = 0.18
"""When something fails [s]: the hand moves, and both sides push."""

SLOW = 4
"""`divisor` of a slow bus."""

LATER = 0.25
"""[s] By how much an operated rig is later: it engages first."""

STIFF = {"stiffness": 300.0, "damping": 5.0}
KEYS: Mapping[str, Tree] = {
    "wave": {"wave_impedance": 15.0, "wave_filter_hz": 100.0},
    "position": STIFF,
    "pd_damping": {**STIFF, "injection": 2.0},
    "position_force": {**STIFF, "master_damping": 8.0},
    "four_channel": STIFF,
    "mediated": {"stiffness": 300.0, "damping": 5.0, "stiffest": 300.0},
}
ADMITTANCE: Tree = {
    "bus": "arm", "id": 1, "kind": "linear", "causality": "admittance", "effort_limit": 60.0,
    "velocity_limit": 5.0, "environment_stiffness_upper": 300.0,
}  # fmt: skip
LINK: Tree = {"delay_s": 0.003, "jitter_s": 0.002, "loss": 0.1}


def coupling_of(law: str, *, account: bool) -> Tree:
    """Return the block of a coupling with one pair, `a`."""
    name, _, measured = law.partition(" ")
    name = "wave" if name not in KEYS else name
    keys = {**KEYS[name], **({"effort": "measured"} if measured == "measured" else {})}
    return {"law": name, "account": {} if account else None, "pairs": {"a": keys}}


def bench_tree(kind: str, law: str, *, account: bool) -> Tree:
    """Return two masses of half a kilogram, or one and an axis that takes velocity."""
    data = tree(MOVED)
    for side in ("master", "slave"):
        data[side]["axes"]["a"].update(SIDE)
        if law.endswith("measured"):
            data[side]["axes"]["a"]["effort_sensor"] = {}
    data["coupling"].update(coupling_of(law, account=account))
    if kind == "velocity":
        data["slave"]["axes"]["a"] = ADMITTANCE
    return data


def gripper_tree() -> Tree:
    """Return the gripper's finger, closing on its object."""
    data: Tree = yaml.safe_load(GRIPPER.read_text())
    for at in (data["master"]["axes"], data["slave"]["axes"], data["coupling"]["pairs"],
               data["simulation"]["hand"]):  # fmt: skip
        del at["elbow"]
    for side in ("master", "slave"):
        del data["simulation"]["axes"][f"{side}.elbow"]
    return tree(
        {
            "rate_hz": 1000,
            "duration_s": 0.36,
            "coupling.release_ramp_s": 0.05,
            "coupling.engage_ramp_s": 0.02,
            "simulation.hand.gripper.reference.waypoints": [[0.05, 0.0], [0.4, 0.7]],
        },
        base=data,
    )


def rig_for(kind: str, law: str, *, account: bool, place: str, engine: str) -> Rig:
    """Return the rig of a cell."""
    loop: Tree = {"missing_limit": LIMIT, "overrun_limit": OVERRUN}
    if kind == "scene":
        data = tree(
            {
                "duration_s": 0.36,
                "scene.release_ramp_s": 0.05,
                "master.axes.stick.effort_rate_limit": 800.0,
                "scene.links.wall.stiffness": 500.0,
                "simulation.hand.stick.reference.waypoints": [[0.05, 0.0], [0.25, -0.03]],
            },
            base=yaml.safe_load(WALL.read_text()),
        )
    elif kind in ("tip", "velocity tip"):
        data = tip_tree(kind, law, account=account)
    else:
        data = gripper_tree() if kind == "follower" else bench_tree(kind, law, account=account)
    if kind == "excited":
        for side in ("master", "slave"):
            data[side]["axes"]["a"] |= {"position_range": [-0.5, 0.5], "effort_rate_limit": 50.0}
    if place == "link":
        data["link"] = LINK
        data["coupling"].pop("delay_s", None)
    if place == "slow":
        data["buses"]["arm"]["divisor"] = SLOW
    if place == "operated":
        data["operate"] = {"start": "engaged"}
        data["duration_s"] += LATER
        for hand in data["simulation"]["hand"].values():
            for point in hand["reference"]["waypoints"]:
                point[0] += LATER
    data["loop"] = loop
    if engine == "compiled":
        (data["scene"] if kind == "scene" else loop)["engine"] = engine
    return rig_of(data)


def tip_tree(kind: str, law: str, *, account: bool) -> Tree:
    """Return two planar arms coupled at their tips, in x and y."""
    changes: Tree = {"duration_s": 0.28, "coupling.release_ramp_s": 0.05}
    changes["slave.defaults.effort_rate_limit"] = 200.0
    for c in "xy":
        way = [[0.08, 0.0], [0.28, 0.04]]
        changes[f"simulation.hand.{c}.reference"] = {"type": "minimum_jerk", "waypoints": way}
    more = FOLLOWING if kind == "velocity tip" else ()
    changes |= {at: yaml.safe_load(value) for at, _, value in (it.partition("=") for it in more)}
    data = tree(changes, base=yaml.safe_load(PLANAR.read_text()))
    if kind == "velocity tip":
        data["slave"]["axes"] = {"x": {"id": 1}, "y": {"id": 2}}
    if law != "wave":
        keys = coupling_of(law, account=account)
        pair = keys["pairs"]["a"]
        data["coupling"] = {**keys, "delay_s": 0.02, "pairs": dict.fromkeys("xy", pair)}
        data["coupling"]["release_ramp_s"] = 0.05
    return data


class Failing:
    """Has a driver fail, as `failure` of `docs/_tools/stops.py` says, `since()` periods ago."""

    def __init__(self, driver: Any, failure: str, since: Callable[[], int], axis: str) -> None:
        self.failure = failure
        self._since = since
        self._axis = axis
        self._said = False
        self._read, self._faults = driver.read, driver.faults
        driver.read, driver.faults = self.read, self.faults

    def read(self, deadline_ns: int) -> Sequence[JointState]:
        """Return the samples, or what is left of them."""
        states = self._read(deadline_ns)
        since = self._since()
        if since < 0:
            return states
        what = self.failure
        if what == "lost":
            raise DriverError("the bus is lost")
        if what in ("silent", "late") or (what == "gap" and since < LIMIT - 1):
            return [state._replace(valid=False) for state in states]
        field = what.removesuffix(", fed")
        if field in JointState._fields:
            return [state._replace(**{field: math.nan}) for state in states]
        return states

    def faults(self) -> Sequence[Fault]:
        """Return the driver's faults, and the one that it is to have."""
        found = list(self._faults())
        if self.failure in ("fault", "bus fault") and self._since() >= 0 and not self._said:
            self._said = True
            name = self._axis if self.failure == "fault" else ""
            found.append(Fault(name, "over temperature", fatal=True))
        return found


def innermost(driver: Any) -> Any:
    """Return the device behind what follows, carries or maps a tip."""
    while hasattr(driver, "_driver"):
        driver = driver._driver
    return driver


class Done(NamedTuple):
    """A finished run: rows by column, what was written to each axis and the joints of its tip.

    `control` is the class of its controller.
    """

    rig: Rig
    slot: int
    rows: Mapping[str, np.ndarray[Any, np.dtype[np.float64]]]
    written: Mapping[str, Mapping[int, AxisCommand]]
    joints: Mapping[str, Mapping[int, AxisCommand]]
    error: BaseException | None
    control: str


def fail(rig: Rig, failure: str, axis: str, *, excited: bool = False) -> Done:
    """Run a rig whose axis fails."""
    built = with_engine(rig, build_rig(rig, clock="fake"))
    if rig.scene is not None:
        built = use_engine(built, choose_engine(rig, "fake").name)
    if rig.operate is not None:
        built = with_operation(rig, built, [Script(read_script("", "script"))], [])
    if excited:
        cycles = round(rig.duration_s * rig.rate_hz)
        plan = plan_excitation(rig, axis, cycles, share=0.3, reach=None)
        built = excite(rig, built, {axis: Excitation(plan)})
    period, clock = rig.period_ns, built.clock
    slot = round((FAILS + (LATER if rig.operate is not None else 0.0)) * rig.rate_hz)
    assert isinstance(clock, FakeClock)
    if failure == "stall":
        clock._oversleep = lambda at: OVERRUN * period if at == slot * period else 0
    if failure == "late":
        clock._oversleep = lambda at: LATE * period if at >= slot * period else 0
    written: dict[str, dict[int, AxisCommand]] = {}
    joints: dict[str, dict[int, AxisCommand]] = {}
    for bus in built.buses:
        log_writes(bus.driver, bus.axes, clock, period, written)
        if axis not in bus.axes:
            continue
        inner = innermost(bus.driver)
        who = axis
        if rig.buses[bus.name].driver == "arm":
            names = [joint.name for joint in bus.driver._joints]  # type: ignore[attr-defined]
            log_writes(inner, names, clock, period, joints)
            who = names[0]
        own = period * bus.divisor
        Failing(inner, failure, lambda at=own: (clock.now_ns() - slot * period) // at, who)
    sink = ListSink(len(built.columns))
    result = Loop(built.clock, built.buses, built.control, built.sources, sink).run()
    rows = dict(zip(built.columns, np.array(sink.rows).T, strict=True))
    kind = type(built.control).__name__
    return Done(rig, slot, rows, written, joints, result.error, kind)


def log_writes(
    driver: Any,
    axes: Sequence[str],
    clock: Any,
    period: int,
    written: dict[str, dict[int, AxisCommand]],
) -> None:
    """Keep what is written to a driver, by axis and slot."""
    write = driver.write

    def logged(commands: Sequence[AxisCommand]) -> None:
        for name, command in zip(axes, commands, strict=True):
            written.setdefault(name, {})[int(clock.now_ns() // period)] = command
        write(commands)

    driver.write = logged


class Axis(NamedTuple):
    """What is stated of an axis: whether it takes effort, limit, step of a period, damping."""

    effort: bool
    limit: float
    step: float
    damping: float


def axis_of(rig: Rig, name: str) -> Axis:
    """Return it from the keys of the rig."""
    axis = rig.axes[name]
    step = (axis.effort_rate_limit or math.inf) * rig.period_s * rig.axis_divisor(name)
    return Axis(axis.causality == "impedance", axis.effort_limit, step, axis.damping.lower)


def is_served(
    rig: Rig, rows: Mapping[str, np.ndarray[Any, np.dtype[np.float64]]], name: str, row: int
) -> bool:
    """Return whether an axis is read and written in a row: in the last slot of its bus' period."""
    return round(rows["time_s"][row] * rig.rate_hz + 1) % rig.axis_divisor(name) == 0


def stop_row(
    rig: Rig,
    rows: Mapping[str, np.ndarray[Any, np.dtype[np.float64]]],
    name: str,
    first: int,
    begins: int,
) -> int:
    """Return the row in which an axis has been without a sample for so many of its periods."""
    n = rig.axis_divisor(name)
    slots = np.rint(rows["time_s"] * rig.rate_hz).astype(int)
    before = (int(slots[first - 1]) + 1) // n
    return next(
        k
        for k in range(first, len(slots))
        if is_served(rig, rows, name, k) and (int(slots[k]) + 1) // n - before >= begins
    )


def should_be(
    axis: Axis, rule: str, last: float, velocity: float, slots: int, share: float
) -> float:
    """Return the resisting effort, or the velocity, that a rule sends after the `last` one."""
    if not axis.effort or rule == "nothing":
        return 0.0
    most = min(share, 1.0) * axis.limit
    target = min(max(axis.damping * velocity, -most), most) if rule == "damp" else 0.0
    reach = axis.step * slots
    return last + min(max(target - last, -reach), reach)


def wrong(
    rig: Rig,
    rows: Mapping[str, np.ndarray[Any, np.dtype[np.float64]]],
    name: str,
    first: int,
    rule: str,
    begins: int | None,
    stops: tuple[int, int] | None = None,
    *,
    holds: bool = False,
) -> Iterator[str]:
    """Yield what an axis was sent in the rows from `first` on and should not have been.

    `rule` holds where it is seen in a stop; unseen, an effort goes. It begins at the `begins`-th
    missing period, or, of another axis, in the row and with the guard that `stops` says. Without
    either nothing stops. `holds`: the ceiling stays, and damping ends with its joules.
    """
    axis = axis_of(rig, name)
    sign = -1.0 if axis.effort else 1.0
    sent = sign * rows[f"{name}.commanded"]
    valid = rows[f"{name}.valid"] > 0.5
    velocity = rows[f"{name}.velocity"]
    slots = np.rint(rows["time_s"] * rig.rate_hz).astype(int)
    release = round((rig.coupling if rig.scene is None else rig.scene).release_ramp_s * rig.rate_hz)
    over = round(rig.duration_s * rig.rate_hz)
    last, unseen, waited, end = float(sent[first - 1]), 0, 0, -1
    n = rig.axis_divisor(name)
    served = (int(slots[first - 1]) + 1) // n
    for k in range(first, len(sent)):
        if not is_served(rig, rows, name, k):
            if sent[k] != sent[k - 1]:
                yield f"row {k}: {sent[k]} where its bus is not served"
            continue
        passed = (int(slots[k]) + 1) // n - served
        served += passed
        waited += passed
        unseen = 0 if valid[k] else unseen + passed
        stopped = end >= 0
        if not stopped and stops is not None and k >= stops[0]:
            stopped = k > stops[0] or not stops[1]
        if not stopped and begins is not None and (begins == 0 or unseen >= begins):
            stopped = True
        if stopped and end < 0:
            end = min(int(slots[k if stops is None else stops[0]]) + 1 + release, over)
        if not stopped:
            if not valid[k] and sent[k] != last:
                yield f"row {k}: {sent[k]} instead of the last command, {last}"
            if valid[k]:
                last, waited = float(sent[k]), 0
            continue
        share = 1.0 if holds else (end - slots[k]) / release
        seen = rule if valid[k] or rule == "nothing" else "let go"
        may = [seen, "let go"] if holds and seen == "damp" else [seen]
        expected = [should_be(axis, it, last, float(velocity[k]), waited, share) for it in may]
        if not any(math.isclose(sent[k], it, rel_tol=1e-9, abs_tol=1e-12) for it in expected):
            yield f"row {k}: {sent[k]} instead of {expected} ({seen}, {waited} slots after {last})"
        last, waited = float(sent[k]), 0
    if begins is not None and end < 0:
        yield "it never stopped"
