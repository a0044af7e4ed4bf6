"""Rigs whose motors damp by themselves: certified, run, judged; and what befalls them at a wall."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

from tautwave.certificate.verdict import certify
from tautwave.errors import ConfigError
from tautwave.rig import build_rig
from tautwave.runtime.loop import Loop
from tautwave.session.engine import with_engine
from tautwave.session.identification.identifying import axis_to_identify
from tautwave.simulation.run import simulate
from tests.rigs.running import ListSink, Run, Tree, books, rig_of, run_rig
from tests.rigs.test_mit_rows import tree


def damped(
    damping: float = 0.1,
    wall: float = 60.0,
    filter_hz: float = 500.0,
    device: float = 0.05,
    **options: Any,
) -> Tree:
    """Return the shipped rig with a wall at the slave, and dampers in both motors."""
    data = tree(**options)
    for one in data["buses"]["can"]["options"]["motors"]:
        if damping:
            one |= {"damping": damping, "velocity_filter_hz": filter_hz}
    for side in ("master", "slave"):
        data[side]["axes"]["lever"]["damping"] = {
            "value": device, "lower": device, "source": "identified",
        }  # fmt: skip
        data["simulation"]["axes"][f"{side}.lever"]["damping"] = device
    data["coupling"]["pairs"]["lever"]["wall_slave"] = {"position": 0.1, "stiffness": wall}
    data["simulation"]["environment"]["lever"] = {"type": "free"}
    return data


@cache
def verdicts(damping: float, wall: float, filter_hz: float = 500.0) -> dict[str, Any]:
    found = certify(rig_of(damped(damping, wall, filter_hz)), brief=True)
    return {f"{one.kind} {one.axis}": one for one in found.elements}


def test_a_damper_in_the_motor_certifies_a_wall_three_times_as_stiff() -> None:
    bare = verdicts(0.0, 60.0)["wall slave.lever"]
    assert not bare.passive.passed
    assert bare.numbers["passive_stiffness"] == pytest.approx(33.33, abs=0.01)
    wall = verdicts(0.1, 60.0)["wall slave.lever"]
    assert wall.passive.passed
    assert wall.numbers["passive_stiffness"] == pytest.approx(99.9, rel=0.01)


def test_what_is_assumed_of_its_filter_is_a_condition() -> None:
    one = verdicts(0.1, 60.0)["damper slave.lever"]
    assert one.passive.state == "conditional"
    assert "V_BW(32) of motor 2" in one.passive.conditions[0]
    assert one.numbers["bias_w"] == pytest.approx(
        one.numbers["bias"] ** 2 / 4.0 / (one.numbers["wall_damping"] - 0.09), rel=1e-6
    )
    assert "would bear 33.33 N m/rad" in one.sentences[0]
    assert "whatever the hand" in verdicts(0.1, 60.0)["damper master.lever"].sentences[0]


def test_a_damper_that_its_device_cannot_bear_fails_and_says_which_would_do() -> None:
    one = verdicts(0.6, 20.0)["damper slave.lever"]
    assert not one.passive.passed
    assert "takes 0.0948 N m s/rad of the device's damping" in one.passive.reason
    lower = float(one.passive.reason.rpartition(" to ")[2])
    assert verdicts(lower, 20.0)["damper slave.lever"].passive.passed


def test_a_slow_filter_lends_less() -> None:
    slow, quick = (
        verdicts(0.1, 60.0, hz)["wall slave.lever"].numbers["passive_stiffness"]
        for hz in (30.0, 500.0)
    )
    assert 33.33 < slow < 0.7 * quick


def test_derating_stops_at_what_the_damper_allows() -> None:
    data = damped(0.1, 200.0)
    data["coupling"]["pairs"]["lever"]["wall_slave"] |= {"derate": True, "damping": 0.01}
    found = certify(rig_of(data), brief=True)
    assert 50.0 < found.walls["slave.lever"]["rendered_stiffness"] < 120.0
    wall = next(one for one in found.elements if one.kind == "wall")
    assert wall.passive.passed


def test_a_device_is_identified_without_it() -> None:
    data = damped()
    with pytest.raises(ConfigError, match="remove damping from the options of bus 'can'"):
        axis_to_identify(rig_of(data), "slave.lever")
    assert axis_to_identify(rig_of(damped(0.0)), "slave.lever") == "slave.lever"


def test_such_devices_are_not_compiled() -> None:
    rig = rig_of(damped())
    run = simulate(rig, duration_s=0.02)
    assert np.isfinite(run["slave.lever.damper_least"]).all()


@pytest.fixture(scope="module")
def rows() -> Run:
    return run_rig(damped(), duration_s=3.0)


@pytest.mark.slow
def test_the_wall_holds_and_every_book_closes(rows: Run) -> None:
    assert rows["true.slave.lever.position"].max() > 0.1
    found = books(rows, "lever")
    assert found.residual < 1e-9 * found.gross_flow
    assert found.plant_residual < 1e-9 * found.plant_flow
    for side in ("master", "slave"):
        taken, least = (rows[f"{side}.lever.damper_{what}"] for what in ("absorbed", "least"))
        true = 1e-3 * 82 * 5.0 / 4095 * (rows[f"true.{side}.lever.velocity"] ** 2).sum()
        assert 0.6 * true < least[-1] <= true
        # A motor reports its torque truncated: half a step of it over all ways is not known.
        way = np.abs(np.diff(rows[f"{side}.lever.position"])).sum()
        assert abs(taken[-1] - true) <= 0.5 * 20.0 / 4095 * way + 0.02 * true


@pytest.mark.parametrize(
    ("quirk", "words", "state"),
    [
        ({"restarts_at_s": 0.05}, "slave.lever: motor 2: disabled: it was switched off and on", 0),
        ({"error_at_s": 0.05, "error": 9}, "slave.lever: motor 2: under-voltage", 9),
        ({"silent_at_s": 0.05}, "slave.lever on bus 'can': no sample in 3 cycles", 0),
    ],
    ids=["restart", "brown-out", "silent"],
)
def test_what_befalls_a_motor_in_contact_takes_its_damper_too(
    quirk: dict[str, Any], words: str, state: int
) -> None:
    data = damped(simulator={"motors": {"2": quirk}})
    data["coupling"]["pairs"]["lever"]["wall_slave"]["position"] = -0.01  # in contact at once
    run = run_rig(data, raises=False, duration_s=0.1)
    assert words in str(run.result.error)
    motor = run.assembly.simulators[0].world.motors[1]
    assert (motor.state, motor.torque) == (state, 0.0)
    before = motor.axis.physics.motor_work
    motor.axis.physics.v = 1.0
    motor.pass_slot()
    assert motor.axis.physics.motor_work == before  # neither effort nor damper


def test_a_watchdog_that_fires_in_contact_ends_the_run_and_the_motor_pushes_no_more() -> None:
    """The host stalls for longer than the motors wait, while the slave is in its wall."""
    data = damped(watchdog_s=0.003)  # three periods
    data["coupling"]["pairs"]["lever"]["wall_slave"]["position"] = -0.001  # in contact at once
    data["coupling"]["engage_ramp_s"] = 0.02
    data["loop"]["overrun_limit"] = 50
    faults = {"overrun_probability": 0.01, "overrun_slots": 6}
    data["simulation"]["faults"] = faults
    run = run_rig(data, raises=False, duration_s=0.5)
    assert "no command in time" in str(run.result.error)
    assert run["slave.lever.wall_effort"].max() > 0.0  # it was in contact
    for motor in run.assembly.simulators[0].world.motors:
        assert motor.state in (0, 0xD)
        assert motor.torque == 0.0
        before = motor.axis.physics.motor_work
        motor.axis.physics.v = 1.0
        motor.pass_slot()
        assert motor.axis.physics.motor_work == before


def at_wall(wall: float = 60.0, **options: Any) -> Tree:
    data = damped(0.1, wall, **options)
    for one in data["buses"]["can"]["options"]["motors"]:
        one["damped"] = "at_wall"
    return data


def test_what_an_approach_may_give_is_stated() -> None:
    found = certify(rig_of(at_wall()), brief=True)
    (one,) = (e for e in found.elements if (e.kind, e.axis) == ("damper", "slave.lever"))
    assert one.passive.passed
    # 12 rad/s for a sample, a command, and three times 0.32 ms.
    assert one.numbers["reach"] == pytest.approx(12.0 * (2e-3 + 3.0 * 0.3183e-3), rel=1e-3)
    assert one.numbers["approach_j"] == pytest.approx(0.5 * 0.1001 * 0.3183e-3 * 144.0, rel=1e-3)
    assert "each approach may give up to 0.0023 J" in one.sentences[0]
    wall = next(e for e in found.elements if e.kind == "wall")
    assert wall.numbers["passive_stiffness"] == pytest.approx(99.9, rel=0.01)


@pytest.mark.slow
def test_it_damps_near_its_wall_and_is_not_felt_elsewhere() -> None:
    run = run_rig(at_wall(), duration_s=3.6)
    reach = 12.0 * (2e-3 + 3.0 * 0.3183e-3)
    place, wall = run["slave.lever.position"], 0.1
    before = np.diff(run["slave.lever.damper_least"]) > 0.0
    assert (place[:-1][before] > wall - 2.0 * reach - 0.02).all()
    assert run["slave.lever.damper_least"][-1] > 0.0
    # The master has no wall: its damper never acts, and its books stay empty.
    assert run["master.lever.damper_least"][-1] == 0.0
    always = run_rig(damped(), duration_s=3.6)
    depth = [float(r["true.slave.lever.position"].max()) for r in (run, always)]
    assert depth[0] == pytest.approx(depth[1], rel=0.05)
    found = books(run, "lever")
    assert found.plant_residual < 1e-9 * found.plant_flow
    late = slice(200, 1000)  # on the way to the wall
    assert (run["master.lever.commanded"][late] != always["master.lever.commanded"][late]).any()


@pytest.mark.slow
def test_a_wall_never_acts_without_its_damper() -> None:
    """Also with samples missing: effort and damper are of one frame."""
    data = at_wall(simulator={"faults": {"lost": 0.01}})
    seen: list[tuple[float, bool]] = []
    run = run_rig(data, duration_s=0.001, raises=False)
    motor = type(run.assembly.simulators[0].world.motors[1])
    decode = motor.decode_order

    def noting(self: Any, frame: bytes) -> Any:
        order = decode(self, frame)
        if self.keys.id == 2:
            place = -(self.axis.physics.x)
            seen.append((place, order[3] > 0.05))
        return order

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(motor, "decode_order", noting)
        run = run_rig(data, duration_s=2.5, raises=False)
    efforts = run["slave.lever.wall_effort"]
    assert (efforts != 0.0).sum() > 100
    assert any(not damped for _, damped in seen)
    inside = [damped for place, damped in seen if -place > 0.1]
    assert len(inside) > 100
    assert all(inside)


@pytest.mark.slow
def test_a_compiled_controller_sends_the_same_dampers() -> None:
    pytest.importorskip("numba")
    rows = {}
    for engine in ("python", "compiled"):
        data = at_wall()
        data["loop"]["engine"] = engine
        rig = rig_of(data)
        assembly = with_engine(rig, build_rig(rig, clock="fake", duration_s=1.6))
        kept = ListSink(len(assembly.columns))
        Loop(assembly.clock, assembly.buses, assembly.control, assembly.sources, kept).run()
        at = assembly.columns.index("slave.lever.damper_least")
        rows[engine] = [row[at] for row in kept.rows]
    assert rows["python"] == rows["compiled"]
    assert rows["python"][-1] > 0.0
