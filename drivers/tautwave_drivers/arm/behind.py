"""What a tip has in common, whatever its joints take: the driver behind it, samples, limits."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from tautwave.contracts import BusSpec, Clock
from tautwave.models.chain.gravity import chain_gravity
from tautwave.models.chain.kinematics import chain_frames
from tautwave.models.chain.task import COORDINATES
from tautwave.registry import load_driver
from tautwave.types import Fault, JointState
from tautwave.wrapper import DriverWrapper, SlotCount
from tautwave_drivers.arm.options import ArmOptions, coordinates, joint_bus


class JointsBehind(DriverWrapper):
    """The joints of an arm on a bus of their own driver, and where they are.

    Parameters
    ----------
    options : ArmOptions
        The arm.
    bus : BusSpec
        Its axes are coordinates of the tip.
    clock, transport
        For the driver of the joints.
    """

    def __init__(self, options: ArmOptions, bus: BusSpec, clock: Clock, transport: Any) -> None:
        plugin = load_driver(options.bus.driver)
        joints = joint_bus(options, bus)
        own = plugin.options.model_validate(options.bus.options)
        super().__init__(plugin.make(own, joints, clock, transport))
        self._which = coordinates(bus)
        self._names = [axis.name for axis in bus.axes]
        self._joints = joints.axes
        self._task = options.task()
        self._period = 1.0 / bus.rate_hz
        count = self._count = len(joints.axes)
        self._known = False
        self._beyond = False
        self._q = [0.0] * count
        self._stride = [0.0] * count  # per period
        self._place = [0.0] * COORDINATES
        self._jacobian = [0.0] * (COORDINATES * count)
        self._since = SlotCount(bus.period_ns)
        self._faults: list[Fault] = []
        self._dead: set[str] = set()
        """Joints in fault: the tip gets nothing, for the others alone are no tip."""
        self._sent = [0.0] * count

    @property
    def watchdog_s(self) -> Mapping[str, float]:
        """Return after what silence all joints act by themselves [s]; empty if one never does."""
        joints = self._driver.watchdog_s
        if any(joint.name not in joints for joint in self._joints):
            return {}
        return dict.fromkeys(self._names, max(joints.values()))

    def open(self) -> None:
        """Open the joints' bus, at the start or for a reset: forget what was known and sent."""
        self._known = self._beyond = False
        self._dead.clear()
        self._stride = [0.0] * self._count
        super().open()

    def faults(self) -> Sequence[Fault]:
        """Return the joints' faults since the last call, and what a joint did beyond its limits."""
        reported, self._faults = self._faults, []
        own = self._driver.faults()
        self._dead.update(fault.axis for fault in own if fault.fatal and fault.axis)
        return [*own, *reported]

    def _sampled(self, deadline_ns: int) -> tuple[Sequence[JointState], int]:
        """Return the joints' samples, and how many slots passed since they were last read."""
        return self._driver.read(deadline_ns), self._since.passed(deadline_ns)

    def _missed(self, states: Sequence[JointState]) -> Sequence[JointState]:
        """Return what a tip reports of which a joint is missing."""
        age = max(state.age_ns for state in states)
        return [JointState(math.nan, math.nan, math.nan, False, age)] * len(self._which)

    def _weighs(self, q: Sequence[float]) -> tuple[list[float], float]:
        """Return what holds the believed weight at `q`, and its potential [J]."""
        held = [0.0] * self._count
        return held, chain_gravity(self._task.chain, chain_frames(self._task.chain, q), held)

    def _watch(self, q: Sequence[float]) -> None:
        """Note the first joint that is beyond its limits, once."""
        if self._beyond:
            return
        for joint, at, stride in zip(self._joints, q, self._stride, strict=True):
            low, high = joint.position_range
            speed = abs(stride) / self._period
            if not low <= at <= high:
                what = f"is at {at:.4g}, outside its position_range [{low:g}, {high:g}]"
            elif speed > joint.velocity_limit:
                what = f"moves at {speed:.4g}, beyond its velocity_limit {joint.velocity_limit:g}"
            else:
                continue
            self._fail(f"joint {joint.name} {what}")
            return

    def _fail(self, sentence: str) -> None:
        """End the run, once."""
        if not self._beyond:
            self._beyond = True
            self._faults.append(Fault("", sentence, fatal=True))
