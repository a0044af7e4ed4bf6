"""Random rigs of every kind: those of the books' tests, and what they leave out."""

from __future__ import annotations

from hypothesis import strategies as st

from tests.rigs.drawing import magnitudes, rigs
from tests.rigs.running import Tree


@st.composite
def any_rigs(draw: st.DrawFn, cycles: int = 300) -> Tree:
    """Return a rig: either law and causality, limits that are met, stops of every kind."""
    data = draw(rigs(cycles))
    position_law = draw(st.booleans())
    if position_law:
        data["coupling"]["law"] = "position"
    names = list(data["coupling"]["pairs"])
    for name in names:
        pair = data["coupling"]["pairs"][name]
        if position_law:
            for key in ("wave_impedance", "matched_master", "matched_slave"):
                pair.pop(key)
            for key in ("wave_filter_hz", "pole_master", "pole_slave"):
                pair.pop(key)
            pair["stiffness"] = draw(magnitudes(1.0, 3e4))
            pair["damping"] = draw(magnitudes(0.1, 30.0))
        if draw(st.booleans()):
            pair["offset"] = draw(st.sampled_from([0.0, 1e-3, -2e-3]))
            pair["engage_tolerance"] = 0.01
        for side in ("master", "slave"):
            vary_axis(draw, data, side, name, position_law)
        if draw(st.booleans()):
            data["simulation"]["hand"].pop(name)
    data["loop"] = {
        "missing_limit": draw(st.sampled_from([2, 1000])),
        "overrun_limit": draw(st.sampled_from([4, 1000])),
    }
    for bus in ("hand", "arm"):
        # What the driver declares need not be true, nor what the device does be whole.
        for name in names:
            side = "master" if bus == "hand" else "slave"
            if draw(st.integers(0, 3)) == 0:
                truth = data["simulation"]["axes"][f"{side}.{name}"]
                truth["command_delay_s"] = draw(st.sampled_from([0.0, 5e-4, 1e-3, 2.7e-3]))
    return data


def vary_axis(draw: st.DrawFn, data: Tree, side: str, name: str, position_law: bool) -> None:
    """Give an axis limits that it meets, another start, or the other causality."""
    belief = data[side]["axes"][name]
    truth = data["simulation"]["axes"][f"{side}.{name}"]
    truth["start_position"] = draw(st.sampled_from([0.0, 0.0, 1e-3, 0.02]))
    if draw(st.booleans()):
        belief["velocity_limit"] = draw(st.sampled_from([0.2, 1.0, 50.0]))
    if draw(st.booleans()):
        belief["position_range"] = [-0.05, draw(st.sampled_from([0.04, 0.5]))]
    foam = data["simulation"]["environment"][name]["type"] == "foam"
    if not position_law and draw(st.integers(0, 2)) == 0 and not (side == "slave" and foam):
        for key in ("inertia", "damping", "velocity_filter_s", "effort_rate_limit"):
            belief.pop(key, None)
        belief["causality"] = "admittance"
        belief["velocity_limit"] = draw(st.sampled_from([1.0, 50.0]))
        belief["velocity_quantum"] = draw(st.sampled_from([0.0, 1e-4]))
        belief["environment_stiffness_upper"] = draw(st.sampled_from([0.0, 500.0]))
        for key in ("inertia", "damping", "coulomb"):
            truth.pop(key)
        truth["velocity_time_constant_s"] = draw(st.sampled_from([5e-4, 2e-3]))
