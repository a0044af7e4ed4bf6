"""Loads carried beside the coupling: what a pair feels, books, limits, verdicts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tautwave import simulate
from tautwave.certificate import certify
from tautwave.certificate.beside.loads import load_element
from tautwave.config import Rig, load_rig
from tautwave.errors import ConfigError
from tautwave.models.load import LoadParams, load_effort, load_energy
from tautwave.rig import command_delays
from tautwave.rig.arms import (
    greatest_load,
    load_reserves,
    load_stiffnesses,
    without_carrying,
)
from tautwave.rig.carrying import side_loads
from tautwave.runtime.carrying.driver import CarryingDriver
from tautwave.runtime.carrying.side import CarriedAxis, SideLoad
from tautwave.simulation.kernel.pack import pack_rig
from tautwave.types import SAFE_COMMAND, AxisCommand, CommandDelay, JointState

CONFIGS = Path(__file__).parents[2] / "configs"
SHIPPED = CONFIGS / "bench-1dof-loopback.yaml"
LOAD = "slave.axes.lever.load={constant: -0.05, cosine: -0.3, sine: 0.1}"
CLEAN = [
    *(f"{side}.axes.lever.encoder_quantum=0" for side in ("master", "slave")),
    "simulation.environment.lever={type: free}",
]


def rows(rig: Rig, seconds: float) -> dict[str, Any]:
    found = simulate(rig, duration_s=seconds, engine="python")
    assert found.error is None
    return dict(zip(found.columns, found.data.T, strict=True))


def error_of(table: dict[str, Any]) -> Any:
    return table["true.master.lever.position"] - table["true.slave.lever.position"]


def test_a_carried_load_is_not_felt_and_another_one_is() -> None:
    bare, carried, borne = (
        error_of(rows(load_rig(SHIPPED, more), 0.5))
        for more in ([], [LOAD], ["simulation.axes.slave.lever.load.constant=-0.05"])
    )
    _, element = load_verdict("slave.axes.lever.load={constant: -0.05, compensate: false}")
    assert element.numbers["greatest_load"] == 0.05
    settled = (borne - bare)[400:]  # the hand waits
    assert settled.mean() == pytest.approx(element.numbers["offset"], rel=0.2)
    # What is carried is seven times as large.
    assert np.abs(carried - bare).max() < 0.05 * settled.mean()


@pytest.mark.sparse(3)
@pytest.mark.parametrize("delay", [0.0, 0.0015, 0.002])
def test_motors_and_books_agree_on_every_joule(delay: float) -> None:
    more = [*CLEAN, LOAD, f"buses.arm.options={{command_delay_s: {delay}}}"]
    if delay == 0.0:
        more += ["simulation.faults.overrun_probability=0.01", "simulation.faults.overrun_slots=2"]
    table = rows(load_rig(SHIPPED, more), 1.5)
    motor = table["plant.slave.lever.motor_work"]
    books = table["slave.lever.port_energy"] + table["load.slave.lever.energy"]
    gap = np.abs(motor + books)
    if delay != 0.0015:  # a remainder leaves an interval
        assert gap.max() < 1e-12
    assert gap.max() < 1e-3
    change = table["load.slave.lever.energy"] + table["load.slave.potential"]
    assert np.allclose(change, table["load.slave.leak"], atol=1e-15)
    p = LoadParams(-0.05, -0.3, 0.1)
    x = table["slave.lever.position"]
    assert table["load.slave.potential"][-1] == pytest.approx(
        load_energy(p, x[-1]) - load_energy(p, x[0]), abs=1e-14
    )
    assert table["load.slave.given"][-1] == pytest.approx(
        max(0.0, -table["load.slave.leak"].min()), abs=1e-15
    )


def test_the_simulated_load_is_in_the_plants_balance() -> None:
    table = rows(load_rig(SHIPPED, [LOAD]), 1.5)
    gains, stores = ("hand_work", "motor_work"), ("kinetic", "grip_stored", "environment_stored")
    losses = ("grip_loss", "viscous_loss", "coulomb_loss", "environment_loss")
    balance = 0.0
    for names, sign in ((gains, 1.0), (stores, -1.0), (losses, -1.0)):
        balance = balance + sign * sum(table[f"plant.slave.lever.{name}"] for name in names)
    assert np.ptp(balance) < 1e-14


class Recorded:
    """A driver that returns given positions and keeps what is written."""

    command_delay = CommandDelay(0, 0.0)
    notes = ("a note",)

    def __init__(self, positions: Sequence[float]) -> None:
        self.positions = iter(positions)
        self.written: list[Sequence[AxisCommand]] = []
        self.open = self.request = self.disable = self.close = lambda: None
        self.enable_step = lambda: True

    def read(self, deadline_ns: int) -> Sequence[JointState]:
        position = next(self.positions)
        return [JointState(position, 0.0, 0.0, position == position, 0)]

    def write(self, commands: Sequence[AxisCommand]) -> None:
        self.written.append(commands)

    def faults(self) -> Sequence[Any]:
        return ()


def carry(
    positions: Sequence[float], p: LoadParams, step: float = np.inf, **more: Any
) -> tuple[Recorded, SideLoad]:
    axis = CarriedAxis(
        "slave.a", **{"reserve": 10.0, "quantum": 0.0, "late": 0.0, **more}, step=step, delay=0
    )
    side = SideLoad("slave", [axis], lambda x: ([-load_effort(p, x[0])], load_energy(p, x[0])))
    inner = Recorded(positions)
    driver: Any = CarryingDriver(inner, [(side, 0)], 1000)  # type: ignore[arg-type]
    for k in range(len(positions)):
        driver.read(1000 * k)
        driver.write([AxisCommand(0.25, 0.0)])
    driver.write([SAFE_COMMAND])
    assert driver.notes == ("a note",)
    return inner, side


def test_the_load_is_held_as_it_will_be_half_way() -> None:
    p = LoadParams(0.0, -2.0, 0.0)
    inner, _ = carry([0.1, 0.14], p)
    assert inner.written[0][0].effort == pytest.approx(0.25 - load_effort(p, 0.1), abs=1e-15)
    assert inner.written[1][0].effort == pytest.approx(0.25 - load_effort(p, 0.16), abs=1e-15)
    assert inner.written[2][0] is SAFE_COMMAND


@pytest.mark.parametrize("late", [0.0, 0.5])
def test_a_weightless_load_books_nothing_however_late_efforts_act(late: float) -> None:
    _, side = carry([0.0, 0.1, 0.3, 0.2], LoadParams(0.0, 0.0, 0.0), late=late)
    row = [1.0] * len(side.columns)
    side.fill(row, 0)
    booked = dict(zip(side.columns, row, strict=True))
    assert booked["load.slave.a.effort"] == booked["load.slave.a.energy"] == 0.0


def test_each_number_of_a_load_is_in_its_own_column_and_no_other_is_written() -> None:
    _, side = carry([0.1, 0.3, 0.2], LoadParams(-3.0, 2.0, 1.0))
    row = [math.nan] * (len(side.columns) + 4)
    side.fill(row, 2)
    assert [math.isnan(one) for one in row] == [True] * 2 + [False] * len(side.columns) + [True] * 2
    books = dict(zip(side.columns, row[2:], strict=False))
    energy, potential = books["load.slave.a.energy"], books["load.slave.potential"]
    assert books["load.slave.leak"] == energy + potential == side.leak
    assert len({energy, potential, side.leak}) == 3


def test_what_moves_while_the_devices_are_reset_is_in_no_book() -> None:
    """Without torque an arm sinks: that gave nothing, and lowers what may leak later by nothing."""
    p = LoadParams(-3.0, 0.0, 0.0)
    axis = CarriedAxis("slave.a", 10.0, np.inf, 0.0, 1, 0.0)
    side = SideLoad("slave", [axis], lambda x: ([-load_effort(p, x[0])], load_energy(p, x[0])))
    inner = Recorded([0.0, 0.1, 0.1, -0.9, -0.9, -0.8, -0.8])
    driver: Any = CarryingDriver(inner, [(side, 0)], 1000)  # type: ignore[arg-type]
    books = []
    for k in range(7):
        if k == 3:
            driver.write([SAFE_COMMAND])
            driver.open()
        driver.read(1000 * k + (90_000 if k >= 3 else 0))
        driver.write([AxisCommand(0.0, 0.0)])
        row = [0.0] * len(side.columns)
        side.fill(row, 0)
        books.append(dict(zip(side.columns, row, strict=True)))
    for what in ("a.energy", "potential", "leak", "given"):
        values = [row[f"load.slave.{what}"] for row in books]
        assert values[3] == pytest.approx(values[2]), what
    assert books[-1]["load.slave.potential"] == pytest.approx(0.6)
    assert books[3]["load.slave.a.effort"] == pytest.approx(3.0)


def test_an_axis_in_fault_gets_nothing_and_what_falls_meanwhile_is_in_no_book() -> None:
    p = LoadParams(-3.0, 0.0, 0.0)
    axes = [CarriedAxis(f"slave.{name}", 10.0, np.inf, 0.0, 0, 0.0) for name in "ab"]
    side = SideLoad(
        "slave",
        axes,
        lambda x: ([-load_effort(p, at) for at in x], sum(load_energy(p, at) for at in x)),
    )
    books = []
    for k, (x, y) in enumerate([(0.0, 0.0), (0.1, 0.1), (0.2, -0.4), (0.2, -0.9), (0.3, -0.8)]):
        for which, at in enumerate((x, y)):
            side.pass_slots(which, 1)
            side.take(which, at)
        if k in (1, 2):
            side.rest(1)
        else:
            side.effort(1)
        assert side.effort(0) == pytest.approx(3.0)
        row = [0.0] * len(side.columns)
        side.fill(row, 0)
        books.append(dict(zip(side.columns, row, strict=True)))
    assert [row["load.slave.b.effort"] for row in books] == pytest.approx([3.0, 0.0, 0.0, 0.0, 3.0])
    # What it got, it got before its fault.
    assert books[-1]["load.slave.b.energy"] == pytest.approx(-0.3)
    assert books[3]["load.slave.leak"] == pytest.approx(0.0, abs=1e-12)
    assert books[-1]["load.slave.given"] == pytest.approx(0.0, abs=1e-12)


def test_it_slews_clips_and_keeps_to_the_drives_steps() -> None:
    p = LoadParams(-3.0, 0.0, 0.0)
    inner, side = carry([0.0] * 4, p, step=1.2, reserve=2.0, quantum=0.5)
    sent = [commands[0].effort - 0.25 for commands in inner.written[:4]]
    assert sent == [1.0, 2.0, 2.0, 2.0]
    inner, _ = carry([float("nan"), 0.0], p)
    assert [commands[0].effort for commands in inner.written[:2]] == [0.25, 3.25]
    row = [0.0] * len(side.columns)
    side.fill(row, 0)
    assert row[0] == 0.0  # the safe command has no load


@pytest.mark.parametrize("seed", range(5))
def test_what_is_given_stays_below_what_the_verdict_takes(seed: int) -> None:
    """Strides as wild as they come: h (1 + 2 d) sum dx**2 bounds it, d = 0 here."""
    rng = np.random.default_rng(seed)
    strides = rng.normal(0.0, 0.05, 400) * np.where(rng.random(400) < 0.5, 1.0, -1.0) ** seed
    x = np.concatenate([[0.0], np.cumsum(strides)])
    p = LoadParams(0.0, 1.5, -0.8)
    _, side = carry(list(x), p)
    bound = np.hypot(1.5, 0.8) * float(np.sum(strides**2))
    assert -side.leak <= bound
    assert abs(side.leak) > 1e-3 * bound


def test_a_load_is_never_sent_beyond_the_axis_limit() -> None:
    rig = load_rig(SHIPPED, [LOAD, "slave.axes.lever.effort_limit=0.5"])
    reserve = load_reserves(rig)["slave.lever"]
    greatest = greatest_load(LoadParams(-0.05, -0.3, 0.1), (-0.5, 0.5))
    assert reserve == pytest.approx(1.1 * greatest)
    table = rows(rig, 2.0)
    assert np.abs(table["slave.lever.commanded"]).max() <= 0.5 - reserve + 1e-12
    assert np.abs(table["load.slave.lever.effort"]).max() <= reserve + 1e-12


def test_a_motor_too_weak_for_its_load_is_refused() -> None:
    rig = load_rig(SHIPPED, [LOAD, "slave.axes.lever.effort_limit=0.4"])
    with pytest.raises(
        ConfigError, match=r"slave\.axes\.lever\.effort_limit: its load takes up to"
    ):
        load_reserves(rig)


LATE, NO_WALL = (
    "buses.arm.options={command_delay_s: 0.0025}",
    "coupling.pairs.lever.wall_slave=null",
)


def load_verdict(*more: str) -> Any:
    rig = load_rig(SHIPPED, list(more))
    return rig, load_element(rig, "slave.lever", command_delays(rig))


def test_carrying_takes_damping_and_the_verdict_says_how_much() -> None:
    rig, element = load_verdict(LOAD, LATE, NO_WALL)
    slope = np.hypot(0.3, 0.1)
    assert load_stiffnesses(rig, "slave")["slave.lever"] == pytest.approx(slope)
    assert element.numbers["needed_damping"] == pytest.approx(slope * 1e-3 * (1 + 2 * 2.5))
    assert command_delays(rig)["slave.lever"].periods == 2
    assert element.passive.passed
    assert not element.passive_quantised.passed  # coulomb.lower is 0
    _, heavy = load_verdict(
        "slave.axes.lever.load.sine=0.9", "slave.axes.lever.damping=0.0008", NO_WALL
    )
    assert not heavy.passive.passed
    assert "raise rate_hz to 1125" in heavy.passive.reason
    _, none = load_verdict("slave.axes.lever.load.sine=0.9", "slave.axes.lever.damping=0")
    assert "none is left" in none.passive.reason


def test_a_wall_leaves_less_for_the_load() -> None:
    _, element = load_verdict("slave.axes.lever.load.sine=0.5")
    assert element.numbers["damping_margin"] == pytest.approx(2e-3 - 1.9e-3 - 5e-4)
    assert "of which a wall uses 0.0019" in element.passive.reason


@pytest.mark.slow
def test_the_certificate_has_the_load_and_counts_what_a_wall_takes() -> None:
    found = certify(load_rig(SHIPPED, ["slave.axes.lever.load.sine=0.5"]))
    (element,) = (e for e in found.elements if e.kind == "load")
    assert element.numbers["damping_margin"] == pytest.approx(2e-3 - 1.9e-3 - 5e-4)
    assert not found.passed
    assert any("the load of slave.lever" in sentence for sentence in found.sentences())


def test_a_borne_load_that_shifts_the_pair_out_of_its_range_is_refused() -> None:
    _, small = load_verdict("slave.axes.lever.load={constant: 0.1, compensate: false}")
    assert small.passive.passed
    _, large = load_verdict("slave.axes.lever.load={constant: 1.0, compensate: false}")
    assert not large.passive.passed
    assert "more than its range of 1; compensate for it" in large.passive.reason
    assert "up to 1 N m, causes an offset of up to" in large.passive.reason
    assert " rad in its pair" in large.passive.reason


def test_the_greatest_load_of_a_range() -> None:
    p = LoadParams(0.1, 0.0, 1.0)
    assert greatest_load(p, (-0.5, 0.5)) == pytest.approx(abs(load_effort(p, 0.5)))
    assert greatest_load(p, (-0.5, 2.0)) == pytest.approx(1.1)
    assert greatest_load(p, (-7.0, 0.0)) == pytest.approx(1.1)
    assert greatest_load(p, None) == pytest.approx(1.1)


def test_a_rig_can_be_asked_to_carry_nothing() -> None:
    arm = "slave.arm={dh: [{a: 0.1, mass: 0.2}], gravity: [0.0, -9.81, 0.0]}"
    rig = load_rig(SHIPPED, [arm, "master.axes.lever.load.constant=0.1"])
    assert set(load_reserves(rig)) == {"master.lever", "slave.lever"}
    assert not load_reserves(without_carrying(rig))


def test_what_is_compiled_refuses_loads_instead_of_leaving_them_out() -> None:
    with pytest.raises(ConfigError, match="arms and loads are not compiled; tautwave run --clock"):
        pack_rig(load_rig(SHIPPED, [LOAD]), 0.1)


def test_a_site_carries_its_own_loads_only() -> None:
    rig = load_rig(SHIPPED, [LOAD, "master.axes.lever.load.constant=0.1"])
    sides, seats = side_loads(rig, {"slave.lever": CommandDelay(0, 0.0)})
    assert list(seats) == ["slave.lever"]
    assert len(sides) == 1


FELT = [LOAD, "slave.axes.lever.load.reflect_load=true", "coupling.pairs.lever.offset=0.0"]
FELT += ["coupling.pairs.lever.engage_tolerance=0.2"]


def test_a_reflected_load_weighs_on_the_hand_at_the_masters_own_place() -> None:
    more = [*FELT, "coupling.pairs.lever.position_scale=0.5", "coupling.pairs.lever.sign=-1"]
    rig = load_rig(SHIPPED, [*more, "master.axes.lever.load.constant=0.02"])
    delays = {name: CommandDelay(0, 0.0) for name in rig.axes}
    sides, _ = side_loads(rig, delays)
    master, _ = sides
    master.take(0, 0.3)
    theirs, own = LoadParams(-0.05, -0.3, 0.1), LoadParams(0.02, 0.0, 0.0)
    felt = load_effort(theirs, -0.5 * 0.3) * -0.5  # on the master, power kept
    assert master.effort(0) == pytest.approx(felt - load_effort(own, 0.3), abs=1e-15)
    # Around a loop nothing is left: it has a potential.
    for x in (0.1, -0.2, 0.3):
        for which in range(100):
            master.pass_slots(0, 1)
            last = 0.3 if x == 0.1 else (0.1 if x == -0.2 else -0.2)
            master.take(0, last + (x - last) * (which + 1) / 100)
            master.effort(0)
    assert abs(master.leak) < 1e-5
    slope = 0.25 * np.hypot(0.3, 0.1)
    assert load_stiffnesses(rig, "master")["master.lever"] == pytest.approx(slope)


def test_the_hand_holds_what_the_slave_weighs() -> None:
    plain, felt = (rows(load_rig(SHIPPED, more), 0.6) for more in ([LOAD, *FELT[2:]], FELT))
    pushed = felt["true.master.lever.hand_effort"] - plain["true.master.lever.hand_effort"]
    x = plain["true.master.lever.position"][500:]
    load = np.array([load_effort(LoadParams(-0.05, -0.3, 0.1), at) for at in x])
    assert np.mean(pushed[500:]) == pytest.approx(-np.mean(load), rel=0.2)  # still swinging
    assert felt["load.master.given"][-1] < 1e-4


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["coupling.pairs.lever.offset=at_engage"], "give the offset as a number"),
        (["slave.axes.lever.load.compensate=false"], "the hand feels it anyway; remove it"),
        (["operate.scales=[0.5]"], "at the rig's own scale"),
        (
            ["master.axes.lever.load={constant: 0.1, reflect_load: true}"],
            "only for slave axes: the hand feels its own device anyway; remove it",
        ),
    ],
)
def test_a_load_that_cannot_be_felt_is_refused(more: list[str], said: str) -> None:
    with pytest.raises(ConfigError) as caught:
        load_rig(SHIPPED, [*FELT, *more])
    assert any(said in problem for problem in caught.value.problems)
