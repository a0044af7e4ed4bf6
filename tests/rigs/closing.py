"""One linear pair that moves, touches and errs, and what its books have to say of it."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from tautwave.laws.tracked_port import port_debt
from tests.rigs.running import Books, Run, Tree, books, forgiven, pair_of, run_rig

SIDES = ("master", "slave")
CLOSED = 1e-9  # of gross flow
EXACT = 1e-12
MOTION = {
    "simulation.hand.a": {
        "reference": {
            "type": "multisine",
            "ramp_s": 0.1,
            "components": [[0.5, 0.04, 0.0], [2.3, 0.02, 1.0], [11.0, 0.002, 0.3]],
        }
    }
}
CONTACT = {
    "simulation.environment.a": {
        "type": "wall", "stiffness": 3000.0, "damping": 5.0, "position": 0.02,
    }
}  # fmt: skip
WALLS = {
    "coupling.pairs.a.wall_master": {
        "position": -0.03, "stiffness": 2000.0, "damping": 1.0, "side": "below",
    },
    "coupling.pairs.a.wall_slave": {
        "position": 0.01, "stiffness": 2000.0, "damping": 1.0, "passivity_control": True,
    },
}  # fmt: skip
CLIPPED = {"master.axes.a.effort_limit": 3.0, "slave.axes.a.effort_limit": 3.0}
FRICTION = {
    "simulation.axes": {
        "master.a": {"coulomb": 0.3, "damping": 1.0, "inertia": 0.7},
        "slave.a": {"coulomb": 0.5, "inertia": 0.9},
    }
}
SENSORS = {
    f"{side}.axes.a.{key}": value
    for side in SIDES
    for key, value in (("encoder_quantum", 2e-5), ("position_noise", 1e-5))
}
MISHAPS = {
    "simulation.faults": {
        "missing_probability": 0.05, "overrun_probability": 0.01, "overrun_slots": 4,
    }
}  # fmt: skip
ALL = (WALLS, CLIPPED, FRICTION, SENSORS, MISHAPS)


def delay(periods: float) -> Tree:
    """Both buses act this many periods (of 1 ms) after a command was written."""
    options = {"command_delay_s": round(periods * 1e-3, 9)}
    return {"buses.hand.options": options, "buses.arm.options": options}


def line(samples: int, rate: float = 1000.0) -> Tree:
    return {"rate_hz": rate, "coupling.delay_s": samples / rate}


def impedance(b: float) -> Tree:
    return {"coupling.pairs.a.wave_impedance": b}


def slow(master: int, slave: int) -> Tree:
    return {"buses.hand.divisor": master, "buses.arm.divisor": slave}


def assert_closed(run: Run, name: str = "a") -> Books:
    """Residuals vanish, and what cannot generate does not."""
    found = books(run, name)
    assert found.gross_flow > 0.0
    assert found.residual <= CLOSED * found.gross_flow
    assert found.element_residual <= CLOSED * found.gross_flow
    assert found.plant_residual <= CLOSED * found.plant_flow
    for element, energy in found.generated.items():
        if element.startswith(("line", "filter", "damper")):
            assert energy <= EXACT * found.gross_flow, element
    return found


def port_bound(run: Run, side: str, name: str = "a") -> float:
    """Return what a port may have generated [J, pair]: forgiven noise, `port_debt`, the last step.

    An account that owes too much lets go in the next period; commands on their way still act.
    """
    params, state = pair_of(run.assembly, name).axes[side]
    weight = params.weight
    port = params.end.port
    fastest = np.abs(np.diff(run[f"{side}.{name}.position"])).max(initial=0.0) / port.period
    delay = params.delay + (1 if params.late else 0)
    owed = port_debt(port, delay, params.site.gain, fastest, state.gross_flow)
    step = np.abs(np.diff(run[f"{name}.port_{side}.absorbed"])).max(initial=0.0)
    return forgiven(run, side, name) + weight * owed + (1 + delay) * step


def assert_passive(run: Run, name: str = "a", bounded: Collection[str] = SIDES) -> None:
    """The books close; converters generate nothing; the pair no more than ports and walls may.

    `bounded` are the sides whose port is held to its bound; the others' may give what they gave.
    """
    found = assert_closed(run, name)
    allowed = 0.0
    for element, energy in found.generated.items():
        if element.startswith("converter"):
            assert energy <= EXACT * found.gross_flow
            lost = run[f"{name}.{element}.dissipated"]
            assert np.all(np.diff(lost) >= 0.0)
        if element.startswith("port"):
            side = element.removeprefix("port_")
            bound = port_bound(run, side, name) * (1.0 + 1e-9) + 1e-15
            if side in bounded:
                assert energy <= bound
            allowed += max(bound, energy)
        if element.startswith("wall"):
            allowed += energy  # a sampled wall leaks what the device's damping has to cover
    taken = sum(run[f"{side}.{name}.port_energy"] for side in SIDES)
    assert taken.min() >= -allowed - CLOSED * found.gross_flow


def check_any(data: Tree) -> None:
    """Run a random rig of `drawing.rigs`, slow buses or not, and hold its books to all of it."""
    run = run_rig(data)
    faults = data["simulation"]["faults"]
    held = faults["missing_probability"] > 0.0 or faults["overrun_probability"] > 0.0
    for name in data["coupling"]["pairs"]:
        if books(run, name).gross_flow < 1e-12:
            continue  # nothing moved
        quick = [side for side in SIDES if "effort_rate_limit" not in data[side]["axes"][name]]
        # Else efforts act on that nobody planned.
        assert_passive(run, name, bounded=() if held else quick)
