"""Rig files: `load_rig(path)` returns a valid `Rig` or raises a `ConfigError` with all mistakes.

Imports pydantic and PyYAML, and nothing heavier.
"""

from tautwave.config.keys.coupling import Coupling, Loop, Pair, Wall
from tautwave.config.keys.devices import Axis, Bus, Damping, Inertia, Side
from tautwave.config.keys.link import Link
from tautwave.config.keys.load import TrueLoad
from tautwave.config.keys.rig import (
    AxisTruth,
    Rig,
    axis_damper,
    bus_spec,
    calibration_of,
    count_velocity,
    has_loads,
    has_plain_devices,
    imposed_motions,
    simulation_of,
    true_arm,
)
from tautwave.config.keys.simulation import (
    AxisSimulation,
    Environment,
    EnvironmentPart,
    Faults,
    Foam,
    Free,
    Hand,
    HandPart,
    Hold,
    Integrator,
    Intent,
    MinimumJerk,
    Multisine,
    Pointer,
    Policy,
    Recorded,
    Recording,
    Reference,
    Simulation,
    SolidWall,
    Spring,
)
from tautwave.config.load import load_rig, parse_rig
from tautwave.config.schema import rig_schema
from tautwave.config.text.resolved import resolved_yaml
from tautwave.config.walls import local_wall, render_stiffness, replace_wall

__all__ = [
    "Axis",
    "AxisSimulation",
    "AxisTruth",
    "Bus",
    "Coupling",
    "Damping",
    "Environment",
    "EnvironmentPart",
    "Faults",
    "Foam",
    "Free",
    "Hand",
    "HandPart",
    "Hold",
    "Inertia",
    "Integrator",
    "Intent",
    "Link",
    "Loop",
    "MinimumJerk",
    "Multisine",
    "Pair",
    "Pointer",
    "Policy",
    "Recorded",
    "Recording",
    "Reference",
    "Rig",
    "Side",
    "Simulation",
    "SolidWall",
    "Spring",
    "TrueLoad",
    "Wall",
    "axis_damper",
    "bus_spec",
    "calibration_of",
    "count_velocity",
    "has_loads",
    "has_plain_devices",
    "imposed_motions",
    "load_rig",
    "local_wall",
    "parse_rig",
    "render_stiffness",
    "replace_wall",
    "resolved_yaml",
    "rig_schema",
    "simulation_of",
    "true_arm",
]
