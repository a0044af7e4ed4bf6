"""Random rigs for property tests: everything a rig file may say, within what can be simulated."""

from __future__ import annotations

from hypothesis import strategies as st

from tests.rigs.running import Tree, tree


def magnitudes(low: float, high: float) -> st.SearchStrategy[float]:
    """Numbers between `low` and `high`, their logarithms evenly spread."""
    import math

    return st.floats(math.log(low), math.log(high)).map(lambda x: float(f"{math.exp(x):.6g}"))


def parts(high: float) -> st.SearchStrategy[float]:
    """Numbers between 0 and `high`, in whole millionths of it: zero or of a size that keys take."""
    return st.integers(0, 10**6).map(lambda n: n * high / 1e6)


def maybe(value: st.SearchStrategy[object], otherwise: object = None) -> st.SearchStrategy[object]:
    return st.one_of(st.just(otherwise), value)


@st.composite
def walls(draw: st.DrawFn, inertia: float) -> Tree:
    return {
        "position": draw(st.floats(0.005, 0.03)),
        # Up to the edge of stability of a sampled wall on the free mass: K T**2 / m = 0.6
        "stiffness": inertia * draw(magnitudes(1e2, 6e5)),
        "damping": inertia * draw(parts(300.0)),
        "side": "above",
        "passivity_control": draw(st.booleans()),
    }


POLES = st.sampled_from([0.5, 0.3, "plain"])


@st.composite
def axes(draw: st.DrawFn, bus: str, number: int) -> tuple[Tree, Tree, float]:
    """Return (belief, truth, inertia) of an impedance axis."""
    inertia = draw(magnitudes(0.05, 5.0))
    belief: Tree = {
        "bus": bus,
        "id": number,
        "kind": "linear",
        "inertia": {"value": inertia, "lower": inertia * draw(st.floats(0.5, 1.0)), "source": "x"},
        "damping": draw(st.sampled_from([0.0, 0.5, 5.0])),
        "effort_limit": draw(st.sampled_from([2.0, 20.0, 1000.0])),
        "encoder_quantum": draw(st.sampled_from([0.0, 1e-6, 1e-4])),
        "position_noise": draw(st.sampled_from([0.0, 0.0, 1e-5])),
        "velocity_limit": draw(st.sampled_from([2.0, 20.0])),
        "effort_quantum": draw(st.sampled_from([0.0, 0.0, 0.01])),
    }
    if draw(st.booleans()):
        belief["effort_rate_limit"] = draw(magnitudes(100.0, 1e5))
    truth: Tree = {
        # The true inertia is not below the lower bound; damping and friction are anything.
        "inertia": inertia * draw(st.floats(1.0, 2.0)),
        "damping": draw(st.sampled_from([0.0, 0.2, 4.0])),
        "coulomb": draw(st.sampled_from([0.0, 0.0, 0.3])),
        "position_noise_autocorrelation": draw(st.sampled_from([[], [], [0.5]])),
    }
    return belief, truth, inertia


@st.composite
def rigs(draw: st.DrawFn, cycles: int = 500) -> Tree:
    """Return a one-axis or two-axis rig of the wave law, with impedance axes."""
    names = draw(st.sampled_from([["a"], ["a"], ["a", "c"]]))
    data = tree(
        {
            "duration_s": cycles * 1e-3,
            "seed": draw(st.integers(0, 1000)),
            "master.axes": {},
            "slave.axes": {},
            "coupling.pairs": {},
            "coupling.delay_s": 1e-3 * draw(st.sampled_from([0, 1, 2, 7, 50])),
            "coupling.engage_ramp_s": draw(st.sampled_from([0.0, 0.05])),
            "coupling.release_ramp_s": draw(st.sampled_from([0.0, 0.05])),
            "loop.missing_limit": 1000,
            "loop.overrun_limit": 1000,
        }
    )
    for bus in ("hand", "arm"):
        delay = draw(st.sampled_from([0.0, 0.0, 1e-3, 2e-3, 1.3e-3]))
        data["buses"][bus] = {"driver": "loopback", "options": {"command_delay_s": delay}}
    simulation: Tree = {"axes": {}, "hand": {}, "environment": {}}
    for number, name in enumerate(names):
        inertias = {}
        for side, bus in (("master", "hand"), ("slave", "arm")):
            belief, truth, inertias[side] = draw(axes(bus, number))
            data[side]["axes"][name] = belief
            simulation["axes"][f"{side}.{name}"] = truth
        pair: Tree = {
            "wave_impedance": draw(magnitudes(0.3, 3e3)),
            "position_scale": draw(st.sampled_from([1.0, 1.0, 0.5, 3.0])),
            "sign": draw(st.sampled_from([1, -1])),
            "matched_master": draw(st.booleans()),
            "matched_slave": draw(st.booleans()),
            "wave_filter_hz": draw(maybe(st.floats(5.0, 500.0))),
            "pole_master": draw(POLES),
            "pole_slave": draw(POLES),
        }
        if draw(st.booleans()):
            pair["force_scale"] = draw(magnitudes(0.2, 5.0))
        for side in ("master", "slave"):
            if draw(st.booleans()):
                wall = pair[f"wall_{side}"] = draw(walls(inertias[side]))
                if wall["damping"] > 0.0 or wall["passivity_control"]:
                    filtered = draw(st.sampled_from([0.0, 2e-3]))
                    data[side]["axes"][name]["velocity_filter_s"] = filtered
        data["coupling"]["pairs"][name] = pair
        simulation["hand"][name] = {
            "mass": draw(parts(0.3)),
            "damping": draw(parts(10.0)),
            "stiffness": draw(magnitudes(50.0, 2000.0)),
            "reference": {
                "type": "multisine",
                "ramp_s": 0.05,
                "components": [
                    [draw(st.floats(0.5, 15.0)), draw(parts(0.1)) - 0.05, 0.3],
                    [draw(st.floats(0.5, 40.0)), draw(parts(0.02)) - 0.01, 1.0],
                ],
            },
        }
        simulation["environment"][name] = draw(
            st.sampled_from(
                [
                    {"type": "free"},
                    {"type": "spring", "stiffness": 300.0, "position": 0.0},
                    {"type": "wall", "stiffness": 2e4, "damping": 3.0, "position": 0.003},
                    {"type": "wall", "stiffness": 1e6, "position": 0.001, "side": "below"},
                    {"type": "foam", "stiffness": 1e5, "loss": 0.3, "position": 0.002},
                ]
            )
        )
    simulation["faults"] = {
        "missing_probability": draw(st.sampled_from([0.0, 0.02, 0.3])),
        "overrun_probability": draw(st.sampled_from([0.0, 0.02])),
        "overrun_slots": draw(st.integers(1, 8)),
    }
    data["simulation"] = simulation
    return data
