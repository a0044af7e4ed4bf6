"""A rig over simulated Feetech servos against one on loopback, and what ends such a run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from tests.rigs.running import Run, Tree, books, rig_of, run_rig

CONFIG = Path(__file__).parents[2] / "configs" / "bench-feetech-sim.yaml"
LEVERS = ({"gear": 147.0}, {"gear": 147.0, "direction": -1})


def tree(**options: Any) -> Tree:
    data: Tree = yaml.safe_load(CONFIG.read_text(encoding="utf-8"))
    data["buses"]["servos"]["options"].update(options)
    return data


def by_voltage(**options: Any) -> Tree:
    """The same levers on STS3215 with an SO-101 leader's gear, driven by a voltage."""
    servos = [{"id": at, "model": "STS3215", **more} for at, more in enumerate(LEVERS, 1)]
    data = tree(servos=servos, supply_v=7.4, **options)
    for side in ("master", "slave"):
        axis = data[side]["axes"]["lever"]
        axis["damping"] = {"value": 0.12, "lower": 0.1, "source": "with its back-EMF"}
        data["simulation"]["axes"][f"{side}.lever"]["damping"] = 0.12
    return data


def loopback(data: Tree) -> Tree:
    """Return the same rig on a loopback bus, with the steps and the command delay of the servos."""
    rig = rig_of(data)
    out: Tree = yaml.safe_load(yaml.safe_dump(data))
    period = 1.0 / rig.rate_hz
    out["buses"] = {"servos": {"driver": "loopback", "options": {"command_delay_s": period}}}
    for side in ("master", "slave"):
        for key in ("encoder_quantum", "effort_quantum"):
            out[side]["axes"]["lever"][key] = getattr(rig.axes[f"{side}.lever"], key)
    return out


@pytest.fixture(scope="module")
def rows() -> Run:
    return run_rig(tree(), duration_s=2.0)


@pytest.mark.slow
@pytest.mark.parametrize("data", [tree(), by_voltage()], ids=["current", "voltage"])
def test_it_moves_to_the_bit_as_on_loopback(data: Tree) -> None:
    run, other = run_rig(data, duration_s=2.0), run_rig(loopback(data), duration_s=2.0)
    for side in ("master", "slave"):
        for column in (f"{side}.lever.position", f"true.{side}.lever.position"):
            assert np.array_equal(run[column], other[column])
        assert np.abs(run[f"true.{side}.lever.position"]).max() > 0.1
    closed = books(run, "lever")
    assert closed.residual < 1e-9 * closed.gross_flow


@pytest.mark.slow
@pytest.mark.parametrize(
    "options",
    [{"baud": 500_000}, {"return_delay_s": 2e-4}, {"simulator": {"echo": True}}],
    ids=["slower", "return delay", "echo"],
)
def test_the_wire_changes_no_row(rows: Run, options: dict[str, Any]) -> None:
    other = run_rig(tree(**options), duration_s=2.0)
    for column in ("master.lever.position", "slave.lever.position"):
        assert np.array_equal(rows[column], other[column])


@pytest.mark.slow
def test_what_the_servos_report_is_recorded(rows: Run) -> None:
    """A command is sent one period later, and reported with the sample that is asked with it."""
    step = 6.5e-3 * 0.814
    told, acted = rows["slave.lever.commanded"], rows["slave.lever.motor_effort"]
    assert np.abs(told).max() > 5.0 * step
    assert np.abs(acted[1:] - told[:-1]).max() <= 0.51 * step
    assert (rows["slave.lever.supply_voltage"] == 12.0).all()
    assert rows["slave.lever.motor_temperature"][-1] == pytest.approx(30.0, abs=1.0)


@pytest.mark.slow
def test_a_supply_that_sags_is_followed_by_the_duty() -> None:
    """By voltage an effort goes with the supply: the servo's own reading corrects the next goal."""
    sag = {"1": {"supply_ohm": 1.0}, "2": {"supply_ohm": 1.0}}
    run = run_rig(by_voltage(simulator={"servos": sag}), duration_s=2.0)
    volts, told = run["master.lever.supply_voltage"], run["master.lever.commanded"]
    acted = run["master.lever.motor_effort"]
    assert volts.min() < 6.9
    hard = np.abs(told[:-1]) > 0.5 * np.abs(told).max()
    share = acted[1:][hard] / told[:-1][hard]
    assert np.median(share) == pytest.approx(1.0, abs=0.03)


EVENTS = [
    ("power_cycle", "servo 2: torque(40) reads 0 instead of 1: it was switched off and on"),
    ("overheat", "servo 2: overheated (status 0x04)"),
    ("over_current", "servo 2: over-current (status 0x08)"),
    ("overload", "servo 2: overloaded: its torque has fallen to what it holds with"),
    ("remove", "slave.lever on bus 'servos': no sample in 3 cycles"),
]


@pytest.mark.parametrize(("kind", "words"), EVENTS, ids=[kind for kind, _ in EVENTS])
def test_what_befalls_a_servo_ends_the_run_in_words(kind: str, words: str) -> None:
    faults = {"events": [{"kind": kind, "at_s": 0.05, "id": 2}]}
    quirks = {"2": {"boot_s": 0.004}}  # back within two cycles: no sample is missed in a row of 3
    data = tree(simulator={"faults": faults, "servos": quirks})
    run = run_rig(data, raises=False, duration_s=0.2)
    assert words in str(run.result.error)
    simulator = run.assembly.simulators[0]
    assert not any(servo.torque_on for servo in simulator.servos if servo.present)
