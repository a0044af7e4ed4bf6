"""A laboratory's controller: a spring between positions, a damper between filtered velocities.

Position-position with a derivative filter, as the recordings of the bench were made with.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

from pydantic import Field

from tautwave.config import Coupling, Pair
from tautwave.contracts import CoupledAxis, CouplingPlugin
from tautwave.controller.records import AxisParams, AxisState
from tautwave.controller.seen import SeenEnd, seen_law


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
class DerivativeEnd(SeenEnd):
    """What one side sees of the other, and its own filtered velocity [rad/s or m/s]."""

    velocity: float = 0.0


def end_constants(pair: DerivativePair, side: str, axis: CoupledAxis) -> DerivativeParams:
    """Return the constants of one end."""
    gain = axis.period / (axis.period + pair.derivative_filter_s)
    return DerivativeParams(
        pair.in_device_units(side, pair.stiffness), pair.in_device_units(side, pair.damping), gain
    )


def begin(s: AxisState) -> None:
    """Begin at rest."""
    s.end.velocity = 0.0


def keep(
    s: AxisState, p: AxisParams, displacement: float, count: float, span: float, port: float
) -> None:
    """Filter the velocity; show the effort of a damper to ground, for the far one takes its own."""
    e = s.end
    e.velocity += p.end.gain * (displacement / span - e.velocity)
    e.effort = p.end.damping * e.velocity


def effort(s: AxisState, p: AxisParams, free_velocity: float) -> float:
    """Return the resisting effort of spring and damper."""
    e = s.end
    push: float = p.end.stiffness * (s.position - e.far_position) + e.effort - e.far_effort
    return push


law = seen_law("derivative", effort, end=DerivativeEnd, begin=begin, keep=keep)
plugin = CouplingPlugin("spring and filtered damper", DerivativeCoupling, law, end_constants)
