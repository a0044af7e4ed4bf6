"""Build the running objects from a rig: the only package that knows all others.

What runs or is simulated (`assembly`, `truth`) is imported when it is first used: a check and a
certificate need none of it.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from tautwave.rig.allowance.filling import allowances, axis_allowance
from tautwave.rig.allowance.once import once_per_rig
from tautwave.rig.claim_verdict import judge_claim
from tautwave.rig.claims import axis_claim, kinetic_energy, longest_overrun
from tautwave.rig.clips import pair_clip
from tautwave.rig.controller import (
    axis_names,
    axis_params,
    bare_site,
    between,
    check_ends,
    controlled_axis,
    coupled_axis,
    coupling_law,
    end_constants,
    make_control,
    pair_params,
    run_params,
    site_params,
    velocity_gain,
    wall_params,
)
from tautwave.rig.network import LineDelay, line_delay
from tautwave.rig.parts import coupling_part
from tautwave.rig.rates import (
    at_axis_rate,
    at_full_rate,
    damper_reach,
    one_way_delay,
    standing_offset,
    true_delay_s,
)
from tautwave.rig.scales import PairScale, end_energy, pair_scale, slave_offset
from tautwave.rig.ways import (
    BusWay,
    Simulate,
    Way,
    as_taken,
    bus_ways,
    choose_way,
    command_delays,
    overlaid,
    real_buses,
    watchdogs,
    without_truth,
)

if TYPE_CHECKING:
    from tautwave.rig.assembly import Assembly, build_rig, cycles_in, make_clock
    from tautwave.rig.truth import (
        axis_integration,
        axis_model,
        foam_params,
    )

__all__ = [
    "Assembly",
    "BusWay",
    "LineDelay",
    "PairScale",
    "Simulate",
    "Way",
    "allowances",
    "as_taken",
    "at_axis_rate",
    "at_full_rate",
    "axis_allowance",
    "axis_claim",
    "axis_integration",
    "axis_model",
    "axis_names",
    "axis_params",
    "bare_site",
    "between",
    "build_rig",
    "bus_ways",
    "check_ends",
    "choose_way",
    "command_delays",
    "controlled_axis",
    "coupled_axis",
    "coupling_law",
    "coupling_part",
    "cycles_in",
    "damper_reach",
    "end_constants",
    "end_energy",
    "foam_params",
    "judge_claim",
    "kinetic_energy",
    "line_delay",
    "longest_overrun",
    "make_clock",
    "make_control",
    "once_per_rig",
    "one_way_delay",
    "overlaid",
    "pair_clip",
    "pair_params",
    "pair_scale",
    "real_buses",
    "run_params",
    "site_params",
    "slave_offset",
    "standing_offset",
    "true_delay_s",
    "velocity_gain",
    "wall_params",
    "watchdogs",
    "without_truth",
]

_ASSEMBLY = ("Assembly", "build_rig", "cycles_in", "make_clock")
_TRUTH = ("axis_integration", "axis_model", "foam_params")
_HOMES = dict.fromkeys(_ASSEMBLY, "assembly") | dict.fromkeys(_TRUTH, "truth")


def __getattr__(name: str) -> Any:
    home = _HOMES.get(name)
    if home is None:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{home}"), name)
    globals()[name] = value
    return value
