"""One linear pair that moves, touches and errs, and what its books have to say of it."""

from __future__ import annotations

import numpy as np

from tautwave.analysis.claim import Claim
from tests.rigs.running import Books, Run, Tree, books, pair_of, run_rig

SIDES = ("master", "slave")
CLOSED = 1e-9  # of gross flow
EXACT = 1e-12
ROUNDING = 1e-12  # of what the tanks hold: each step of a book may round it
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
    closed = CLOSED * found.gross_flow + ROUNDING * tanks(run, name)
    assert found.residual <= closed
    assert found.element_residual <= closed
    assert found.plant_residual <= CLOSED * found.plant_flow
    for element, energy in found.generated.items():
        if element.startswith(("line", "damper")):
            assert energy <= EXACT * found.gross_flow, element
    return found


def tanks(run: Run, name: str = "a") -> float:
    """Return the reserves of both ports [J, pair]."""
    return sum(p.weight * p.end.port.reserve for p, _ in pair_of(run.assembly, name).axes.values())


def port_bound(run: Run, side: str, name: str = "a") -> float:
    """Return what a port claims [J, pair]: its reserve, what is under way, its leak."""
    pair = pair_of(run.assembly, name)
    p, _ = pair.axes[side]
    port, limit, whole = p.end.port, p.site.limit, pair.control.run
    claim = Claim(
        reserve=port.reserve,
        leak=port.leak / port.period,
        feigned=0.0,
        effort=limit.effort,
        rate=limit.effort_step / port.period,
        velocity=limit.velocity,
        period=port.period,
        blind=p.delay + p.late + whole.missing_limit + whole.overrun_limit,
        mass=port.period / (2.0 * max(p.site.half_mobility, 1e-300)),
        deviation=1e-5,
        peak=1.0,
        quantum=1e-4,
        nonlinearity=0.0,
        stop_damping=0.0,
        release=0.0,
        kinetic=0.0,
    )
    # Against a wall on the axis the port alone may give what the wall takes as well.
    beside = claim.under_way if p.site.has_wall else 0.0
    return p.weight * (claim.seen(len(run.table) * pair.params.period) + beside)


def assert_passive(run: Run, name: str = "a") -> None:
    """The books close; converters generate nothing; the pair no more than ports and walls may."""
    found = assert_closed(run, name)
    allowed = 0.0
    for element, energy in found.generated.items():
        if element.startswith("converter"):
            assert energy <= EXACT * found.gross_flow
            lost = run[f"{name}.{element}.dissipated"]
            assert np.all(np.diff(lost) >= 0.0)
        if element.startswith("port"):
            side = element.removeprefix("port_")
            bound = port_bound(run, side, name)
            assert energy <= bound
            allowed += bound
        if element.startswith("wall"):
            allowed += energy  # a sampled wall leaks what the device's damping has to cover
    taken = sum(run[f"{side}.{name}.port_energy"] for side in SIDES)
    assert taken.min() >= -allowed - CLOSED * found.gross_flow


def assert_within_reserves(run: Run, name: str = "a") -> None:
    """In a run that went to its end no port gave more than 2 E0 + P t: no command was unseen."""
    assert run.result.error is None
    seconds = len(run.table) * pair_of(run.assembly, name).params.period
    found = books(run, name).generated
    for side, (p, _) in pair_of(run.assembly, name).axes.items():
        port = p.end.port
        claimed = p.weight * (2.0 * port.reserve + port.leak / port.period * seconds)
        assert found[f"port_{side}"] <= claimed, side


def check_any(data: Tree) -> None:
    """Run a random rig of `drawing.rigs`, slow buses or not, and hold its books to all of it."""
    run = run_rig(data, raises=False)
    for name in data["coupling"]["pairs"]:
        if books(run, name).gross_flow < 1e-12:
            continue  # nothing moved
        assert_passive(run, name)
