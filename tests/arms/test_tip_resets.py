"""The tip of an arm whose devices are reset within a run, or act late: watched, booked, limited."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tautwave.types import SAFE_COMMAND, AxisCommand, CommandDelay
from tests.arms.motions import FOLLOWING
from tests.arms.test_tip import PLANAR, Joints, made, options_of, place_of
from tests.arms.test_tip_following import columns, following


@pytest.mark.parametrize("more", [(), FOLLOWING])
def test_its_joints_are_watched_again(
    monkeypatch: pytest.MonkeyPatch, more: tuple[str, ...]
) -> None:
    driver, joints = made(monkeypatch, PLANAR, "arm", *more)
    joints.efforts = (0.0, 0.0)
    opened = []
    joints.open = lambda: opened.append(True)
    for start in (1.6, 1.4):  # moved by hand meanwhile
        driver.open()
        driver.write([AxisCommand(1.0, 1.0)] * 2)
        assert joints.written[-1][0] is SAFE_COMMAND  # where it is is not known
        for k in range(3):
            joints.positions = (-0.3, start + 0.03 * k)
            driver.read(int(1e9 / start) + 1_000_000 * k)
        (fault,) = driver.faults()
        assert "elbow moves at 30, beyond its velocity_limit 20" in fault.text
    assert len(opened) == 2


def test_what_moved_before_it_foretells_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    driver, joints = made(monkeypatch, PLANAR, "hand")
    for k in range(3):
        joints.positions = (0.6 + 0.01 * k, 1.2)
        if k == 2:
            driver.open()
        driver.read(1_000_000 * k)
        driver.write([AxisCommand(1.0, 0.0)] * 2)
    fresh, others = made(monkeypatch, PLANAR, "hand")
    others.positions = joints.positions
    fresh.read(0)
    fresh.write([AxisCommand(1.0, 0.0)] * 2)
    assert list(joints.written[-1]) == list(others.written[-1])


def test_neither_what_was_sent_before_it_is_booked_nor_what_moved_in_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(Joints, "command_delay", CommandDelay(2, 0.5e-3))
    driver, joints = made(monkeypatch, PLANAR, "hand")
    given = []
    for at in (1.2, 1.201, 1.25):
        if at == 1.25:
            driver.open()
        for k in range(4):
            joints.positions = (0.6, at + 1e-3 * k)
            driver.read(1_000_000 * k)
            given.append(columns(driver)["tip.hand.mapped"])
            driver.write([AxisCommand(3.0 if at < 1.25 else 0.0, 0.0)] * 2)
    assert given[3] != 0.0
    assert given[8:] == [given[7]] * 4


def test_an_arm_that_sinks_in_it_leaked_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    weight = "buses.hand.options.chain.gravity=[0, -9.81, 0]"
    driver, joints = made(monkeypatch, PLANAR, "hand", weight)
    books = []
    for at in (1.2, -0.4):
        driver.open()
        for k in range(3):
            joints.positions = (0.6, at + 1e-3 * k)
            driver.read(1_000_000 * k)
            books.append(columns(driver))
            driver.write([AxisCommand(0.0, 0.0)] * 2)
    assert books[2]["tip.hand.potential"] != 0.0
    for what in ("potential", "leak", "given"):
        assert books[3][f"tip.hand.{what}"] == pytest.approx(books[2][f"tip.hand.{what}"])


def test_a_reset_begins_with_the_whole_reserve(monkeypatch: pytest.MonkeyPatch) -> None:
    """Bent against its drives, as above, until it stops; reset, moved by hand; bent again."""
    driver, joints = following(
        monkeypatch, "buses.arm.options.home=[0, 0]", "buses.arm.options.reserve=1e-3"
    )
    joints.efforts = (1.0, -2.2)
    given = []
    for _ in range(3):
        driver.open()
        faults: list[Any] = []
        for k in range(6):
            joints.positions = (-0.25e-3 * k, 0.55e-3 * k)
            driver.read(1_000_000 * k)
            faults += driver.faults()
            if faults:
                break
        given.append(columns(driver)["tip.arm.mapped"])
        assert "reserve is 0.001" in faults[0].text
    assert np.diff([0.0, *given]) == pytest.approx([2.92e-3] * 3, rel=1e-2)


def test_an_effort_is_mapped_where_the_arm_will_be_while_it_acts(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Half-way through its period, which begins a whole and a quarter period from now."""
    monkeypatch.setattr(Joints, "command_delay", CommandDelay(1, 0.25e-3))
    driver, joints = made(monkeypatch, PLANAR, "hand", "buses.hand.options.walls={}")
    before, now = np.array([0.6, 1.2]), np.array([0.63, 1.16])
    for k, q in enumerate((before, now)):
        joints.positions = list(q)
        driver.read(1_000_000 * k)
    driver.write([AxisCommand(0.4, 0.0), AxisCommand(-0.3, 0.0)])
    soon = now + (0.5 + 1.0 + 0.25) * (now - before)
    _, jacobian = place_of(options_of(PLANAR, "hand").task(), list(soon))
    expected = jacobian.T @ [0.4, -0.3, 0.0, 0.0, 0.0, 0.0]
    sent = [command.effort for command in joints.written[-1]]
    assert sent == pytest.approx(expected, rel=1e-12)


def test_a_joint_s_last_sample_again_is_no_sample(monkeypatch: pytest.MonkeyPatch) -> None:
    driver, joints = made(monkeypatch, PLANAR, "hand")
    joints.positions = (0.6, 1.2)
    assert all(state.valid for state in driver.read(0))
    first, second = joints.read(0)
    monkeypatch.setattr(joints, "read", lambda _: [first, second._replace(valid=False)])
    assert not any(state.valid for state in driver.read(1_000_000))
