"""The arms of a rig as its rows have them: chains, and columns of joints, forces and walls."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from tautwave.config import Rig
from tautwave.config.inputs.chains import chain_constants
from tautwave.models.chain.kinematics import chain_frames, tip_pose
from tautwave.models.chain.params import ChainParams
from tautwave.registry import load_driver

Point = tuple[float, float, float]
BASE = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


class Component(NamedTuple):
    """A column [N], its place among x, y and z of a frame, and the factor that makes it a force."""

    column: str
    axis: int
    factor: float


class ArmParts(NamedTuple):
    """One arm.

    Attributes
    ----------
    name : str
        `master`, `slave`, of several arms the full name, or the bus of a tip.
    side : str
        `master` or `slave`.
    chain : ChainParams
        Of its joints.
    joints : sequence of str
        Columns of their positions.
    forces : mapping of str to sequence of Component
        On the tip by what exerts it, along the axes of `frame`.
    walls : mapping of str to Any
        Keys of walls in space, along the same axes.
    frame : (3, 3)
        Its rows are the axes of the task, in those of the base.
    """

    name: str
    side: str
    chain: ChainParams
    joints: Sequence[str]
    forces: Mapping[str, Sequence[Component]]
    walls: Mapping[str, Any]
    frame: Sequence[Point] = BASE


def arm_parts(rig: Rig) -> Iterator[ArmParts]:
    """Yield the arms whose joints are the axes of a side, then those behind tips."""
    for side in ("master", "slave"):
        for arm in rig.arms(side):
            joints = [f"{name}.position" for name in arm.axes]
            yield ArmParts(arm.name, side, chain_constants(arm.keys), joints, {}, {})
    for name, bus in rig.buses.items():
        if bus.driver != "arm":
            continue
        options: Any = load_driver("arm").options.model_validate(bus.options)
        axes = {full: axis for full, axis in rig.axes.items() if axis.bus == name}
        side = next(iter(axes)).partition(".")[0]
        flat = options.task().frame
        yield ArmParts(
            name=name,
            side=side,
            chain=options.believed(),
            joints=[f"joints.{side}.{joint}.position" for joint in options.joints],
            forces={
                "coupling": [
                    Component(f"{full}.port_effort", axis.id - 1, -1.0)  # a port's resists
                    for full, axis in axes.items()
                    if axis.id <= 3
                ],
                **{
                    wall: [
                        Component(f"space.{name}.{wall}.f{c}", k, 1.0) for k, c in enumerate("xyz")
                    ]
                    for wall in options.walls
                },
            },
            walls=options.walls,
            frame=(tuple(flat[0:3]), tuple(flat[3:6]), tuple(flat[6:9])),
        )


def arm_points(chain: ChainParams, posture: Sequence[float]) -> list[Point]:
    """Return base, origins of the joints' frames, and tip at a posture [m]."""
    frames = chain_frames(chain, posture)
    x, y, z = tip_pose(chain, frames)[:3]
    return [(0.0, 0.0, 0.0), *(tuple(frame[11:14]) for frame in frames), (x, y, z)]
