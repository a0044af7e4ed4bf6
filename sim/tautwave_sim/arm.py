"""Arms behind the `arm` driver: their joints on a loopback bus, hand and task at their tip.

The truth of an axis, a coordinate of the tip, says how the hand leads it and what it touches; its
inertia, friction and encoder are those of the joints, from the bus' options. Hand and task act by
the joints' efforts J^T F, held over a step as they are half-way; what that is wrong by, of third
order, is in the work of the joints' motors.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Sequence
from typing import Any, Self

from pydantic import BaseModel, ConfigDict

from tautwave.columns import names, under
from tautwave.config.inputs.chains import chain_constants
from tautwave.config.keys.arm import Chain, Point
from tautwave.contracts import AxisSpec, BusSpec, Clock, Row, SimulatorPlugin
from tautwave.errors import ConfigError
from tautwave.models.chain.build import roll_pitch_yaw
from tautwave.models.chain.gravity import chain_gravity
from tautwave.models.chain.kinematics import chain_frames
from tautwave.models.chain.task import COORDINATES, TaskParams, at_home, joint_efforts, task_place
from tautwave.models.plant import plant_forces
from tautwave.models.plant_params import PlantParams
from tautwave.models.servo import ServoParams
from tautwave.truth import OF_HAND, OF_PLACE, TRUE, ArmModel, AxisModel
from tautwave_sim.loopback import LoopbackOptions, LoopbackSimulator


class _Shared(BaseModel):
    """The driver's model of the same block is the strict one; here only what is needed is read."""

    model_config = ConfigDict(extra="ignore", strict=True, frozen=True, allow_inf_nan=False)


class _Bus(_Shared):
    driver: str = "loopback"
    options: dict[str, Any] = {}


class _Joint(_Shared):
    id: int
    effort_limit: float
    inertia_lower: float = 0.0
    damping_lower: float = 0.0
    encoder_quantum: float = 0.0
    position_noise: float = 0.0


class _JointTruth(_Shared):
    inertia: float | None = None
    damping: float | None = None
    coulomb: float = 0.0
    start_position: float | None = None


class _Truth(_Shared):
    joints: dict[str, _JointTruth] = {}
    chain: Chain | None = None


class SimulatedArmOptions(_Shared):
    """What a simulated arm needs of its bus' block."""

    bus: _Bus = _Bus()
    joints: dict[str, _Joint]
    chain: Chain
    frame: Point = (0.0, 0.0, 0.0)
    home: tuple[float, ...] | None = None
    truth: _Truth = _Truth()

    @classmethod
    def model_validate(cls, obj: Any, **more: Any) -> Self:
        """Read options as they are in a rig, which has lists for tuples."""
        return obj if isinstance(obj, cls) else cls.model_validate_json(json.dumps(obj), **more)


class TipWorld:
    """What acts on an arm's tip: a hand, a spring, a wall for each coordinate.

    Parameters
    ----------
    task : TaskParams
        Of the true arm.
    which : sequence of int
        The coordinate of each model, from 0.
    models : sequence of AxisModel
        Their truth.
    """

    def __init__(self, task: TaskParams, which: Sequence[int], models: Sequence[AxisModel]) -> None:
        self._task = task
        self._parts = list(zip(which, models, strict=True))
        self._period = models[0].period
        self.time = 0.0
        self._jacobian: list[float] = []
        self.place = [0.0] * COORDINATES
        self.speed = [0.0] * COORDINATES
        self.hand = [0.0] * COORDINATES
        self.outside = [0.0] * COORDINATES

    def reference(self, model: AxisModel, time: float) -> tuple[float, float]:
        """Return where a hand leads a coordinate at a time [m or rad], and its rate."""
        path = model.reference
        at = time / self._period
        slot = int(at + 1e-9)
        if slot >= len(path) - 1:
            return (path[-1] if len(path) else 0.0), 0.0
        step = path[slot + 1] - path[slot]
        return path[slot] + (at - slot) * step, step / self._period

    def efforts(self, x: Sequence[float], v: Sequence[float], h: float) -> list[float]:
        """Return the joints' efforts over a step of `h` [s] from the positions `x`."""
        soon = [a + 0.5 * h * b for a, b in zip(x, v, strict=True)]
        self._look(soon, v, self.time + 0.5 * h)
        self.time += h
        total = [a + b for a, b in zip(self.hand, self.outside, strict=True)]
        efforts = [0.0] * len(x)
        joint_efforts(self._jacobian, total, efforts)
        return efforts

    def efforts_at(self, x: Sequence[float], v: Sequence[float]) -> list[float]:
        """Return the joints' efforts for an arm that is led, at `x` with the speeds `v`."""
        self._look(x, v, self.time)
        total = [a + b for a, b in zip(self.hand, self.outside, strict=True)]
        efforts = [0.0] * len(x)
        joint_efforts(self._jacobian, total, efforts)
        return efforts

    def _look(self, x: Sequence[float], v: Sequence[float], time: float) -> None:
        self._jacobian = [0.0] * (COORDINATES * len(x))
        self.place = list(task_place(self._task, x, self._jacobian))
        for k, model in self._parts:
            at = self.place[k]
            speed = sum(self._jacobian[COORDINATES * j + k] * v[j] for j in range(len(x)))
            self.speed[k] = speed
            ahead, rate = self.reference(model, time)
            hand, self.outside[k] = plant_forces(model.plant, at, speed, ahead, rate)
            if len(model.reference):
                self.hand[k] = hand

    def show(self, x: Sequence[float], v: Sequence[float]) -> None:
        """Look at an arm without moving it."""
        self._look(x, v, self.time)


class FollowingJoints(LoopbackSimulator):
    """Joints that follow velocities and feel what acts on the tip, and the weight of their links.

    What the links' inertia asks of the drives is not felt.
    """

    def __init__(
        self, axes: Sequence[AxisSpec], truths: Sequence[AxisModel], world: TipWorld, chain: Any
    ) -> None:
        super().__init__(axes, truths)
        self._world = world
        self._chain = chain
        self._begun = False
        self.settle()

    def settle(self) -> None:
        """Show every joint what acts on it."""
        world = self._world
        if self._begun:
            world.time += self._period_ns * 1e-9
        self._begun = True
        x = [axis.physics.x for axis in self.axes]
        pushes = world.efforts_at(x, [axis.physics.v for axis in self.axes])
        held = [0.0] * len(x)
        chain_gravity(self._chain, chain_frames(self._chain, x), held)
        for axis, push, weight in zip(self.axes, pushes, held, strict=True):
            axis.push(push - weight)


class TipAxis:
    """A row source: the truth of one coordinate."""

    def __init__(self, name: str, k: int, model: AxisModel, world: TipWorld) -> None:
        self._k = k
        self._model = model
        self._world = world
        self._led = len(model.reference) > 0
        kinds = (*TRUE, *(OF_HAND if self._led else ()), *OF_PLACE)
        self.columns = names(under(f"true.{name}", kinds))

    def fill(self, row: Row, at: int) -> None:
        """Write the truth at this slot into `row` from index `at` on."""
        world, k = self._world, self._k
        row[at] = world.place[k]
        row[at + 1] = world.speed[k]
        at += 2
        if self._led:
            row[at] = world.reference(self._model, world.time)[0]
            row[at + 1] = world.hand[k]
            at += 2
        row[at] = world.outside[k]


class ArmSimulator:
    """The other end of an `arm` driver: a loopback bus with the joints."""

    def __init__(
        self, options: SimulatedArmOptions, bus: BusSpec, models: Sequence[AxisModel]
    ) -> None:
        if options.bus.driver != "loopback":
            raise ConfigError(
                f"bus {bus.name}: an arm is simulated on a loopback bus only; write bus: "
                f"{{driver: loopback}} (got {options.bus.driver})"
            )
        for axis, model in zip(bus.axes, models, strict=True):
            _refuse_what_no_tip_has(axis.name, model)
        causality = bus.axes[0].causality
        if causality == "admittance":
            _refuse_what_no_drive_has(bus.name, options.truth)
        believed = options.home or (0.0,) * len(options.joints)
        turn = roll_pitch_yaw(*options.frame)
        axes = tuple(row[column] for column in range(3) for row in turn)
        chain = chain_constants(options.truth.chain or options.chain)
        task = at_home(chain, axes, believed)
        which = [axis.device_id - 1 for axis in bus.axes]
        world = TipWorld(task, which, models)
        inner = LoopbackOptions.model_validate(options.bus.options)
        delay = inner.command_delay_s / models[0].period
        specs, joints = [], []
        for number, (name, joint) in enumerate(options.joints.items()):
            truth = options.truth.joints.get(name, _JointTruth())
            full = f"{bus.name}.{name}"
            start = believed[number] if truth.start_position is None else truth.start_position
            specs.append(AxisSpec(full, joint.id, "rotary", causality, joint.effort_limit))
            joints.append(
                models[0]._replace(
                    plant=_motor(joint, truth),
                    reference=(),
                    start_position=start,
                    encoder_quantum=joint.encoder_quantum,
                    position_noise=joint.position_noise,
                    colour=(),
                    effort_quantum=0.0,
                    effort_limit=joint.effort_limit,
                    command_delay=delay,
                    seed=(models[0].seed[0], zlib.crc32(full.encode())),
                    foam=None,
                    load=None,
                    part=None,
                    **_moved_by(models[0], ArmModel(bus.name, chain)),
                )
            )
        if causality == "admittance":
            self._joints: LoopbackSimulator = FollowingJoints(specs, joints, world, chain)
        else:
            self._joints = LoopbackSimulator(specs, joints)
            (arm,) = self._joints.arms
            arm.outside = world
            arm.show()
        self.transport = self._joints
        self.arms = self._joints.arms
        self.axes = [
            TipAxis(axis.name, k, model, world)
            for axis, k, model in zip(bus.axes, which, models, strict=True)
        ]

    def advance(self, to_ns: int) -> None:
        """Move the joints over the slots that have passed at `to_ns`."""
        self._joints.advance(to_ns)

    def close(self) -> None:
        """Nothing to release."""


def _refuse_what_no_tip_has(axis: str, model: AxisModel) -> None:
    name = axis.partition(".")[2]
    refused = {
        f"simulation.environment.{name}: the tip of a simulated arm touches free, spring or wall "
        "environments only": model.foam or model.part or len(model.push),
        f"simulation.hand.{name}: the tip of a simulated arm is led by a hand with a reference "
        "only": model.grasp or model.lead or model.imposed,
        f"{axis}.effort_sensor: a simulated arm has none at its tip; remove it": model.sensor,
    }
    for text, is_set in refused.items():
        if is_set:
            raise ConfigError(text)


def _refuse_what_no_drive_has(bus: str, truth: _Truth) -> None:
    for name, joint in truth.joints.items():
        for key in ("inertia", "damping", "coulomb"):
            if getattr(joint, key):
                raise ConfigError(
                    f"buses.{bus}.options.truth.joints.{name}.{key}: a simulated joint that "
                    "follows velocities has none; remove it"
                )


def _moved_by(model: AxisModel, arm: ArmModel) -> dict[str, Any]:
    """Return what moves a joint: the arm that it is of, or its own drive."""
    if model.servo is None:
        return {"arm": arm}
    alone = ServoParams(model.servo.time_constant, *(0.0,) * 8, 1.0)
    return {"servo": alone, "push": (0.0,)}


def _motor(joint: _Joint, truth: _JointTruth) -> PlantParams:
    inertia = joint.inertia_lower if truth.inertia is None else truth.inertia
    damping = joint.damping_lower if truth.damping is None else truth.damping
    return PlantParams(
        mass=inertia,
        viscous=damping,
        coulomb=truth.coulomb,
        grip_stiffness=0.0,
        grip_damping=0.0,
        spring_stiffness=0.0,
        spring_position=0.0,
        wall_stiffness=0.0,
        wall_damping=0.0,
        wall_position=0.0,
        wall_side=1.0,
    )


def _simulate(
    options: SimulatedArmOptions, bus: BusSpec, physics: Sequence[AxisModel], clock: Clock
) -> ArmSimulator:
    return ArmSimulator(options, bus, physics)


simulator = SimulatorPlugin(
    options=SimulatedArmOptions, make=_simulate, summary="an arm; what leads and stops its tip"
)
