"""Energy books of whole runs: they close, they hold what theory says, and they can fail."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings

import tautwave.runtime.site as site_module
from tautwave.laws.port import port_close, port_debt
from tautwave.link.memory import DelayLine
from tautwave.rig import Assembly
from tautwave.runtime.site import SiteAxis
from tests.rigs.drawing import rigs
from tests.rigs.running import Books, Run, Tree, books, forgiven, run_rig, tree

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
    for side in ("master", "slave")
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


# -- they close --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("samples", "b", "features"),
    [
        (0, 10.0, ()), (0, 0.3, ALL), (1, 1.0, (WALLS, FRICTION)), (1, 3000.0, (SENSORS, CLIPPED)),
        (7, 100.0, (WALLS, MISHAPS)), (50, 10.0, (CLIPPED, WALLS, FRICTION)),
        (50, 300.0, ALL), (500, 30.0, (MISHAPS, SENSORS, WALLS)),
    ],
)  # fmt: skip
def test_a_minute_of_contact_closes(samples: int, b: float, features: tuple[Tree, ...]) -> None:
    changes = (MOTION, CONTACT, *features, line(samples, 250.0), impedance(b), {"duration_s": 60.0})
    run = run_rig(tree(*changes, {"loop.missing_limit": 1000}))
    assert run.result.cycles + run.result.missed_cycles == 15_000
    environment = run["true.slave.a.environment_effort"]
    assert np.count_nonzero(np.diff(environment != 0.0)) > 10  # contacts and releases
    assert_closed(run)


@pytest.mark.parametrize("samples", [0, 1, 7, 50, 500])
@pytest.mark.parametrize("b", [0.3, 3.0, 30.0, 300.0, 3000.0])
def test_every_delay_and_impedance_closes(samples: int, b: float) -> None:
    features = ALL if (samples + round(b)) % 2 else (WALLS, FRICTION)
    run = run_rig(
        tree(MOTION, CONTACT, *features, line(samples), impedance(b), {"duration_s": 1.0})
    )
    assert_closed(run)


@pytest.mark.slow
@pytest.mark.parametrize("samples", [0, 1, 7, 50, 500])
@pytest.mark.parametrize("b", [0.3, 3.0, 30.0, 300.0, 3000.0])
def test_a_minute_at_one_kilohertz_closes(samples: int, b: float) -> None:
    features = ALL if (samples + round(b)) % 2 else (WALLS, FRICTION)
    run = run_rig(
        tree(MOTION, CONTACT, *features, line(samples), impedance(b), {"duration_s": 60.0})
    )
    assert_closed(run)


@pytest.mark.parametrize("features", [(), ALL], ids=["clean", "everything"])
@pytest.mark.parametrize("periods", [0, 1, 2, 5])
def test_whole_periods_of_command_delay_are_exact_without_gaps(
    periods: int, features: tuple[Tree, ...]
) -> None:
    run = run_rig(tree(MOTION, CONTACT, *features, line(7), delay(periods)))
    found = assert_closed(run)
    if periods == 0 or not features:
        assert found.uncertainty == 0.0
    else:
        # Samples are missing while different commands act: an interval, and it holds the truth.
        assert 0.0 < abs(found.sensing_gap) < found.uncertainty
    if not features:
        # Noise-free, the controller knows exactly what its motors did.
        assert abs(found.sensing_gap) <= EXACT * found.gross_flow


@pytest.mark.parametrize("periods", [0, 1, 3])
@pytest.mark.parametrize("probability", ["missing_probability", "overrun_probability"])
def test_gaps_are_booked_with_the_efforts_that_acted_in_them(
    probability: str, periods: int
) -> None:
    """Over a missing sample the command stays, so even there the books know what acted.

    With a command delay, efforts under way change inside the gap, and a mean effort times the
    whole displacement is no longer exact; the books do not say so yet (`uncertainty` stays 0).
    """
    mishap = {f"simulation.faults.{probability}": 0.05, "simulation.faults.overrun_slots": 4}
    run = run_rig(tree(MOTION, CONTACT, WALLS, line(7), delay(periods), mishap))
    found = assert_closed(run)
    assert run.result.missed_cycles + sum(run.result.lost) > 20
    limit = EXACT if periods == 0 else 1e-2
    assert abs(found.sensing_gap) <= limit * found.gross_flow


@pytest.mark.parametrize("periods", [0.3, 1.5])
def test_a_remainder_of_command_delay_is_an_interval(periods: float) -> None:
    run = run_rig(tree(MOTION, CONTACT, FRICTION, line(7), delay(periods)))
    found = assert_closed(run)
    assert found.uncertainty > 0.0
    assert abs(found.sensing_gap) <= found.uncertainty


@pytest.mark.parametrize("rate", [1000.0, 3000.0, 700.0])
@pytest.mark.parametrize("periods", [1, 2, 3, 7])
def test_a_whole_number_of_periods_has_no_remainder(rate: float, periods: int) -> None:
    options = {"command_delay_s": periods / rate}
    run = run_rig(tree(MOTION, {"rate_hz": rate, "duration_s": 0.05, "buses.arm.options": options}))
    assert run.assembly.buses[1].driver.command_delay == (periods, 0.0)
    assert books(run).uncertainty == 0.0


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(("scale", "force"), [(3.0, None), (0.25, None), (1.0, 4.0), (2.0, 0.1)])
def test_scaling_closes_too(scale: float, force: float | None, sign: int) -> None:
    changes: Tree = {
        "coupling.pairs.a.position_scale": scale,
        "coupling.pairs.a.force_scale": force,
        "coupling.pairs.a.sign": sign,
        "coupling.wave_filter_hz": 80.0,
    }
    run = run_rig(tree(MOTION, CONTACT, WALLS, line(7), changes, {"duration_s": 2.0}))
    assert_closed(run)
    # It does scale: the slave's motion is the master's times scale and sign, free of contact.
    free = run_rig(tree(MOTION, line(1), impedance(50.0), changes, {"duration_s": 2.0}))
    master, slave = free["true.master.a.position"], free["true.slave.a.position"]
    slope = float(np.dot(master, slave) / np.dot(master, master))
    assert slope == pytest.approx(sign * scale, rel=0.3)
    ratio = (force if force is not None else 1.0 / scale) * scale
    assert free.assembly.pairs[0].pair.scale.power == pytest.approx(ratio)


def test_the_line_holds_what_its_books_say() -> None:
    run = run_rig(tree(MOTION, CONTACT, line(50)))
    held = run.assembly.pairs[0].pair.line
    assert held.recount() == pytest.approx(held.stored, rel=1e-9)
    assert run["a.line.stored"][-1] == held.stored


def test_admittance_axes_close_as_intervals() -> None:
    changes: Tree = {
        "slave.axes.a": {
            "bus": "arm", "id": 1, "kind": "linear", "causality": "admittance",
            "effort_limit": 100.0, "velocity_limit": 2.0, "environment_stiffness_upper": 400.0,
        },
        "simulation.environment.a": {"type": "spring", "stiffness": 300.0, "position": 0.0},
    }  # fmt: skip
    run = run_rig(tree(MOTION, line(7), changes))
    found = assert_closed(run)
    assert found.uncertainty > 0.0
    assert abs(found.sensing_gap) <= found.uncertainty


# -- what elements generate --------------------------------------------------------------------


def port_bound(run: Run, side: str, name: str = "a") -> float:
    """Return what a port may have generated [J, pair]: forgiven noise and `port_debt`."""
    pair = next(at.pair for at in run.assembly.pairs if at.pair.name == name)
    site = getattr(pair, side)
    weight = 1.0 if side == "master" else pair.weight
    port = site.params.port
    fastest = np.abs(np.diff(run[f"{side}.{name}.position"])).max(initial=0.0) / port.period
    delay = len(site._pipe) + (1 if site._late else 0)
    owed = port_debt(port, delay, site.params.gain, fastest, site.gross_flow)
    return forgiven(run, side, name) + weight * owed


@pytest.mark.parametrize("samples", [0, 7, 50])
@pytest.mark.parametrize("b", [1.0, 30.0, 1000.0])
def test_a_port_generates_no_more_than_its_bound(samples: int, b: float) -> None:
    for features in ((), (SENSORS,), (CLIPPED, FRICTION), (WALLS, CLIPPED)):
        run = run_rig(tree(MOTION, CONTACT, *features, line(samples), impedance(b)))
        found = assert_closed(run)
        for side in ("master", "slave"):
            assert found.generated[f"port_{side}"] <= port_bound(run, side), (features, side)


def test_saturation_inside_a_wall_is_the_walls() -> None:
    """A wall far stiffer than the motor is strong takes nothing out of the port's account."""
    wall = {"position": 0.01, "stiffness": 2e5}
    run = run_rig(
        tree(MOTION, line(7), CLIPPED, {"coupling.pairs.a.wall_master": wall, "duration_s": 2.0})
    )
    found = assert_closed(run)
    assert run["master.a.wall_effort"].max() <= 3.0
    assert found.generated["port_master"] <= 1e-4 * found.gross_flow


def bounce(b_device: float, controlled: bool = False, phase: float = 0.5) -> Run:
    """A free slave flies into its own wall, with next to no coupling."""
    data = tree(
        impedance(1e-9),
        {
            "slave.axes.a.inertia": {"value": 0.1, "lower": 0.1, "source": "x"},
            "simulation.axes": {"slave.a": {"damping": b_device, "start_position": -1e-3 * phase}},
            "coupling.pairs.a.wall_slave": {
                "position": 0.0, "stiffness": 1000.0, "passivity_control": controlled,
            },
            "duration_s": 0.06,
        },
    )  # fmt: skip

    def throw(built: Assembly) -> None:
        built.simulators[1].axes[0].physics.v = 1.0

    return run_rig(data, change=throw)


def test_a_bare_wall_generates_what_theory_says_and_a_controlled_one_nothing() -> None:
    start = 0.5 * 0.1
    phases = [(k + 0.5) / 8 for k in range(8)]
    runs = [bounce(0.0, phase=phase) for phase in phases]
    generated = np.mean([books(run).generated["wall_slave"] for run in runs])
    predicted = math.expm1(0.5 * math.pi * math.sqrt(1000.0 / 0.1) * 1e-3) * start
    assert generated == pytest.approx(predicted, rel=0.01)
    gained = np.mean([run["true.slave.a.velocity"][-1] ** 2 for run in runs])
    assert gained == pytest.approx(1.1698, abs=3e-4)
    for phase in phases:
        run = bounce(0.0, controlled=True, phase=phase)
        assert books(run).generated["wall_slave"] <= 1e-12
        assert run["true.slave.a.velocity"][-1] == pytest.approx(-1.0, abs=1e-8)


def test_wall_and_damped_device_together_generate_nothing() -> None:
    """b = K T / 2: what the wall gives, the device's own damping takes, by the plant's books."""
    for phase in (0.1, 0.4, 0.7, 0.95):
        run = bounce(0.5, phase=phase)
        into = -run["plant.slave.a.motor_work"] + run["plant.slave.a.viscous_loss"]
        assert into.min() >= -1e-12
        assert books(run).generated["wall_slave"] > 1e-3  # the wall alone does leak


# -- they can fail -----------------------------------------------------------------------------

LOSSLESS = tree(MOTION, line(2), {"duration_s": 2.0})


def fails(run: Run) -> bool:
    """Return whether the books say that something is wrong."""
    found = books(run)
    line_made = found.generated.get("line", 0.0)
    return (
        found.residual > CLOSED * found.gross_flow
        or line_made > EXACT * found.gross_flow
        or abs(found.sensing_gap) > CLOSED * found.gross_flow
        or any(found.generated[f"port_{s}"] > port_bound(run, s) for s in ("master", "slave"))
    )


def test_the_sound_run_passes() -> None:
    assert not fails(run_rig(LOSSLESS))


def test_defect_a_wave_from_the_estimated_velocity(monkeypatch: pytest.MonkeyPatch) -> None:
    def defect(p: Any, account: float, gap: float, moved: float, *rest: float) -> Any:
        _, account, gap, absorbed, burnt, forgave = port_close(p, account, gap, moved, *rest)
        _, velocity, _, wave_sum, _ = rest
        estimated = 1.02 * velocity  # and no account in front of it
        leaving = p.root * estimated - wave_sum
        return leaving, account, gap, absorbed, burnt, forgave

    monkeypatch.setattr(site_module, "port_close", defect)
    assert fails(run_rig(LOSSLESS))


def test_defect_a_wave_duplicated_on_the_line(monkeypatch: pytest.MonkeyPatch) -> None:
    exchange = DelayLine.exchange
    last = [0.0]

    def defect(self: DelayLine, one: float, other: float) -> tuple[float, float]:
        at_master, at_slave = exchange(self, one, other)
        last.append(at_slave)
        return at_master, last[-2] if len(last) % 50 == 0 else at_slave

    monkeypatch.setattr(DelayLine, "exchange", defect)
    assert fails(run_rig(LOSSLESS))


def test_defect_another_effort_than_was_booked() -> None:
    def tamper(built: Assembly) -> None:
        axis = built.simulators[0].axes[0]
        take = axis.command
        axis.command = lambda value: take(1.001 * value)

    assert fails(run_rig(LOSSLESS, change=tamper))


def test_defect_a_command_that_acts_later_than_declared() -> None:
    late = {"simulation.axes": {"master.a": {"command_delay_s": 0.001}}}
    assert fails(run_rig(tree(late, base=LOSSLESS)))


def test_defect_a_forgotten_wall(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(SiteAxis, "wall_stored", lambda self: 0.0)
    assert fails(run_rig(tree(WALLS, {"duration_s": 1.3}, base=LOSSLESS)))


def test_the_naive_port_fails_the_same_books(monkeypatch: pytest.MonkeyPatch) -> None:
    """F = b vhat - root w, u = root vhat - w: its own identity holds, and the run blows up."""

    def naive_effort(p: Any, account: float, coast: float, arriving: float) -> tuple[float, float]:
        return p.impedance * coast - p.root * arriving, coast

    def naive_close(
        p: Any, account: float, gap: float, moved: float, periods: float, velocity: float,
        effort: float, wave_sum: float, wave_energy: float,
    ) -> tuple[float, ...]:  # fmt: skip
        # The estimate that the effort was made of, not the velocity it met; kept in `gap`.
        leaving = p.root * gap - wave_sum
        sent = 0.5 * p.period * leaving * leaving
        income = effort * moved + wave_energy
        return leaving, account + income - sent, velocity, income - sent, 0.0, 0.0

    def believe_infinite_mass(built: Assembly) -> None:
        for at in built.pairs:
            for site in (at.pair.master, at.pair.slave):
                port = site.params.port._replace(half_mobility=0.0)
                site.__init__(site.params._replace(port=port))

    quiet = tree(
        line(2),
        {
            "coupling.pairs.a.wave_impedance": 10.0,
            "slave.axes.a.inertia": {"value": 1e6, "lower": 1e6, "source": "x"},
            "duration_s": 4.0,
        },
    )

    def push(built: Assembly) -> None:
        believe_infinite_mass(built)
        built.simulators[0].axes[0].physics.v = 0.1

    def only_push(built: Assembly) -> None:
        built.simulators[0].axes[0].physics.v = 0.1

    start = 0.5 * 0.5 * 0.1**2
    sound = run_rig(quiet, change=only_push)
    assert not fails(sound)
    assert sound["plant.master.a.kinetic"].max() <= start * (1.0 + 1e-9)
    import tautwave.laws.site as law_module

    monkeypatch.setattr(law_module, "port_effort", naive_effort)
    monkeypatch.setattr(site_module, "port_close", naive_close)
    naive = run_rig(quiet, change=push)
    assert fails(naive)
    assert naive["plant.master.a.kinetic"].max() > 10.0 * start
    assert books(naive).generated["port_master"] > 10.0 * start


# -- any rig -----------------------------------------------------------------------------------


def check_any(data: Tree) -> None:
    run = run_rig(data)
    for name in data["coupling"]["pairs"]:
        found = books(run, name)
        if found.gross_flow < 1e-12:
            continue  # nothing moved
        assert_closed(run, name)
        faults = data["simulation"]["faults"]
        held = faults["missing_probability"] > 0.0 or faults["overrun_probability"] > 0.0
        for side in ("master", "slave"):
            slow = "effort_rate_limit" in data[side]["axes"][name]
            if not held and not slow:  # else efforts act on that nobody planned
                made = found.generated[f"port_{side}"]
                assert made <= port_bound(run, side, name) * (1.0 + 1e-9) + 1e-15


@settings(max_examples=25, suppress_health_check=list(HealthCheck))
@given(rigs(cycles=250))
def test_the_books_of_any_rig_close(data: Tree) -> None:
    check_any(data)


@pytest.mark.slow
@pytest.mark.timeout(900)  # shrinking a counterexample takes its time
@settings(max_examples=300, suppress_health_check=list(HealthCheck))
@given(rigs(cycles=600))
def test_the_books_of_many_rigs_close(data: Tree) -> None:
    check_any(data)
