"""Hands on served devices, moved by typed lines."""

from __future__ import annotations

import os

import pytest

from tautwave.contracts import AxisSpec, Bench, BusSpec
from tautwave.errors import ConfigError
from tautwave.models.servo import ServoParams
from tautwave.session.guided.hands import Hand, TypedHands
from tautwave_sim.axis import SimulatedAxis
from tautwave_sim.bench import free_axis

PERIOD = 1e-3


def bench(*ids: int) -> Bench:
    axes = tuple(AxisSpec(f"x.{one}", one, "rotary", "impedance", 1.0) for one in ids)
    models = [free_axis(PERIOD, 1e-3, 1e-3, seed=(one,), coulomb=5e-3) for one in ids]
    return Bench(None, BusSpec("bus", axes, 1.0 / PERIOD), models)


def typed(*ids: int) -> tuple[TypedHands, list[SimulatedAxis], int, list[str]]:
    reading, writing = os.pipe()
    said: list[str] = []
    hands = TypedHands(reading, said.append)
    axes = [SimulatedAxis("x", model) for model in hands.on(bench(*ids)).physics]
    return hands, axes, writing, said


def moved(axis: SimulatedAxis, seconds: float) -> float:
    for _ in range(round(seconds / PERIOD)):
        axis.pass_slot()
    return axis.physics.x


@pytest.mark.parametrize(("share", "way"), [(0.25, 0.103515625), (0.5, 0.5), (0.75, 0.896484375)])
def test_a_hand_moves_by_the_least_jerk(share: float, way: float) -> None:
    """Its effort on a device that does not move is its grip's stiffness times the way."""
    efforts = []
    for at in (share, 1.0):
        hand = Hand(free_axis(PERIOD, 1e-3, 1e-3, seed=(1,)))
        hand.move(0.4, 1.0)
        for _ in range(round(40 * at)):
            effort = hand(0.0, 0.0, 0.025)
        efforts.append(effort)
    assert efforts[0] == pytest.approx(way * efforts[1])


def test_a_typed_hand_brings_a_device_there_in_its_time_and_lets_go_of_it() -> None:
    hands, (one, two), writing, _ = typed(3, 4)
    assert moved(one, 0.1) == 0.0
    os.write(writing, b"3-4 0.5 0.4\n4 fr")
    hands.look()
    assert 0.1 < moved(one, 0.2) < 0.4
    assert moved(one, 0.6) == pytest.approx(0.5, abs=0.003)
    os.write(writing, b"ee\n")
    hands.look()
    two.command(0.05)
    assert moved(two, 0.3) > 0.5  # nobody holds it


@pytest.mark.parametrize("line", ["9 0.5", "3", "3 up", "a 1", "3 0.5 now"])
def test_lines_that_are_not_understood_are_reported_and_change_nothing(line: str) -> None:
    hands, (axis,), writing, said = typed(3)
    os.write(writing, f"{line}\n\n3 nan\n".encode())
    hands.look()
    assert len(said) == 1
    assert "such as `1-2 0.5`; devices are 3" in said[0]
    assert moved(axis, 0.05) == 0.0
    os.close(writing)
    hands.look()
    hands.look()


def test_a_device_that_takes_velocities_is_refused() -> None:
    one = bench(3)
    servo = ServoParams(0.01, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    wrong = one._replace(physics=[one.physics[0]._replace(servo=servo)])
    with pytest.raises(ConfigError, match="device 3 takes velocities"):
        TypedHands(0, print).on(wrong)
