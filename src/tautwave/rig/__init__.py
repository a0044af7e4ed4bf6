"""From a rig to what runs: the only package that knows everybody."""

from tautwave.rig.assembly import (
    Assembly,
    build_rig,
    command_delays,
    loop_settings,
    make_clock,
    served_buses,
)
from tautwave.rig.controller import (
    NO_WALL,
    device_impedance,
    limit_params,
    make_loop_pair,
    make_pair,
    make_site,
    pair_scale,
    site_params,
    slave_offset,
    velocity_gain,
    wall_params,
    wave_gain,
)
from tautwave.rig.rates import at_axis_rate, at_full_rate, held_share, one_way_delay
from tautwave.rig.truth import (
    SEED_WORD,
    axis_integration,
    axis_model,
    foam_params,
    simulated_axes,
    true_delay_s,
)

__all__ = [
    "NO_WALL",
    "SEED_WORD",
    "Assembly",
    "at_axis_rate",
    "at_full_rate",
    "axis_integration",
    "axis_model",
    "build_rig",
    "command_delays",
    "device_impedance",
    "foam_params",
    "held_share",
    "limit_params",
    "loop_settings",
    "make_clock",
    "make_loop_pair",
    "make_pair",
    "make_site",
    "one_way_delay",
    "pair_scale",
    "served_buses",
    "simulated_axes",
    "site_params",
    "slave_offset",
    "true_delay_s",
    "velocity_gain",
    "wall_params",
    "wave_gain",
]
