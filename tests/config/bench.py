"""A small rig that is right, and what is said about it once something in it is not."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from tautwave.config import parse_rig
from tautwave.errors import ConfigError

BENCH = """\
name: bench
rate_hz: 1000
duration_s: 10
buses:
  hand: {driver: loopback}
  arm: {driver: loopback, options: {command_delay_s: 0.001}}
master:
  axes:
    wrist:
      bus: hand
      id: 1
      kind: rotary
      inertia: {value: 1.5e-3, lower: 1.0e-3, source: identified}
      damping: {value: 3.0e-3, lower: 2.0e-3, source: identified}
      effort_limit: 1.1
      encoder_quantum: 2.0e-5
slave:
  axes:
    wrist:
      bus: arm
      id: 1
      kind: rotary
      inertia: {value: 1.5e-3, lower: 1.0e-3, source: identified}
      damping: 2.0e-3
      effort_limit: 1.1
coupling:
  delay_s: 0.02
  pairs:
    wrist:
      wave_impedance: 0.02
      wall_slave: {position: 0.3, stiffness: 3.0}
simulation:
  axes:
    master.wrist: {inertia: 1.584e-3}
  hand:
    wrist:
      lever_arm: 0.075
      reference: {type: minimum_jerk, waypoints: [[0, 0], [1, 0.3]]}
"""


def problems(text: str = BENCH, overrides: Sequence[str] = ()) -> list[str]:
    """Return what is wrong with a rig's text; fail if nothing is."""
    with pytest.raises(ConfigError) as caught:
        parse_rig(text, "rig.yaml", overrides)
    return list(caught.value.problems)
