"""A laboratory's controller: a spring between positions, a damper between filtered velocities.

Position-position with a derivative filter, as the recordings of the bench were made with.
"""

from __future__ import annotations

from collections.abc import Mapping, MutableSequence
from dataclasses import dataclass
from typing import NamedTuple

from pydantic import Field

from tautwave.config import Coupling, Pair
from tautwave.contracts import CoupledAxis, CouplingPlugin
from tautwave.controller.records import AxisParams, AxisState, PairParams, PairState
from tautwave.controller.steps import Law, Steps


class DerivativePair(Pair):
    """Keys of one pair."""

    stiffness: float = Field(gt=0, description="[N m/rad | N/m] Of the spring.")
    damping: float = Field(ge=0, description="[N m s/rad | N s/m] Of the damper.")
    derivative_filter_s: float = Field(gt=0, description="[s] Low-pass on both velocities.")


class DerivativeCoupling(Coupling):
    """Keys of `coupling`."""

    pairs: Mapping[str, DerivativePair] = Field(description="The pairs by name.")


class DerivativeParams(NamedTuple):
    """Spring, damper, step of the filter [1]."""

    stiffness: float
    damping: float
    gain: float


@dataclass(slots=True)
class DerivativeEnd:
    """Filtered velocity here, and position and velocity there."""

    velocity: float = 0.0
    far: float = 0.0
    far_velocity: float = 0.0


def end_constants(pair: DerivativePair, side: str, axis: CoupledAxis) -> DerivativeParams:
    """Return the constants of one end."""
    gain = axis.period / (axis.period + pair.derivative_filter_s)
    return DerivativeParams(
        pair.in_device_units(side, pair.stiffness), pair.in_device_units(side, pair.damping), gain
    )


def close(
    s: AxisState, p: AxisParams, displacement: float, count: float, span: float, port: float
) -> None:
    """Filter the velocity."""
    s.end.velocity += p.end.gain * (displacement / span - s.end.velocity)


def exchange(
    c: PairState,
    q: PairParams,
    one: AxisState,
    two: AxisState,
    p1: AxisParams,
    p2: AxisParams,
    table: MutableSequence[float],
    here: bool,
    due_one: bool,
    due_two: bool,
) -> None:
    """Let both see where the other is."""
    one.end.far = q.to_master * (two.position - c.offset)
    one.end.far_velocity = q.to_master * two.end.velocity
    two.end.far = q.ratio * one.position + c.offset
    two.end.far_velocity = q.ratio * one.end.velocity


def think(s: AxisState, p: AxisParams, coast: float) -> float:
    """Return the resisting effort of spring and damper."""
    k = p.end
    push: float = k.stiffness * (s.position - s.end.far)
    push += k.damping * (s.end.velocity - s.end.far_velocity)
    return push


law = Law(
    name="derivative",
    steps=Steps(close=close, exchange=exchange, think=think),
    end=DerivativeEnd,
)
plugin = CouplingPlugin("spring and filtered damper", DerivativeCoupling, law, end_constants)
