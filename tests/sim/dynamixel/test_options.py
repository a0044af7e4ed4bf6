"""Options: what the driver's block may hold, what is refused, and how servos come configured."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from tautwave.clock import FakeClock
from tautwave.contracts import AxisSpec, BusSpec
from tautwave.errors import ConfigError, DriverError
from tautwave_sim.dynamixel import simulator
from tautwave_sim.dynamixel.options import BenchOptions, DynamixelOptions
from tautwave_sim.dynamixel.world import ServoWorld, bench
from tautwave_sim.wire.pty import serve_line
from tautwave_sim.wire.serial import SerialLine
from tests.sim.dynamixel.line import Host
from tests.sim.truths import truth

BLOCK = {"port": "sim", "servos": [{"id": 1, "model": "XM430-W350"}]}


def test_the_plugin_serves_its_port_sim_only() -> None:
    assert simulator.served(DynamixelOptions.model_validate(BLOCK))
    assert not simulator.served(DynamixelOptions.model_validate({**BLOCK, "port": "/dev/ttyUSB0"}))
    assert simulator.options is DynamixelOptions
    assert simulator.bench_options is BenchOptions


def test_what_only_the_driver_needs_passes() -> None:
    more = {**BLOCK, "read": "fast_sync", "watchdog_s": 0.1, "transport": "own"}
    assert DynamixelOptions.model_validate(more).baud == 1_000_000


@pytest.mark.parametrize(
    ("simulated", "message"),
    [
        ({"fault": {}}, "Extra inputs"),
        ({"faults": {"lost": 1.5}}, "less than or equal to 1"),
        ({"faults": {"events": [{"kind": "unplug"}]}}, "give at_s"),
        ({"faults": {"events": [{"kind": "unplug", "at_s": 1.0, "nth": 3}]}}, "and no nth"),
        ({"faults": {"events": [{"kind": "lost"}]}}, "give nth or at_s"),
        ({"faults": {"events": [{"kind": "melt", "at_s": 1.0}]}}, "kind"),
        ({"servos": {1: {"registers": {"Gaol Current": 1}}}}, "no register 'Gaol Current'"),
        ({"servos": {1: {"model": "XM430"}}}, "did you mean XM430-W"),
        ({"servos": {1: {"voltage": -1.0}}}, "greater than 0"),
    ],
)
def test_mistakes_are_refused_in_words(simulated: dict[str, object], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        DynamixelOptions.model_validate({**BLOCK, "simulator": simulated})


def test_ids_may_be_text_as_json_has_them() -> None:
    given = {**BLOCK, "simulator": {"servos": {"1": {"voltage": 11.0}}}}
    assert DynamixelOptions.model_validate(given).simulator.servos[1].voltage == 11.0


def test_an_axis_without_a_servo() -> None:
    bus = BusSpec("b", (AxisSpec("master.wrist", 2, "rotary", "impedance", 1.0),), 1000.0)
    with pytest.raises(ConfigError, match=r"master\.wrist: there is no servo with id 2"):
        ServoWorld(DynamixelOptions.model_validate(BLOCK), bus, [truth()], FakeClock())


def test_a_baud_rate_that_the_model_has_not() -> None:
    with pytest.raises(ConfigError, match="has no 500000 baud; it has 9600"):
        Host((1,), baud=500_000)


def test_servos_come_as_the_rig_wants_them() -> None:
    servos = [{"id": 1, "model": "XM430-W350", "current_limit": 1.0}]
    host = Host((1,), simulator={"factory": False}, return_delay_s=20e-6, servos=servos)
    assert host.read(1, "Return Delay Time") == 10
    assert host.read(1, "Operating Mode") == 0
    assert host.read(1, "Current Limit") == 372
    assert host.read(1, "Baud Rate") == 3
    host = Host((1,), causality="admittance", simulator={"factory": False})
    assert host.read(1, "Operating Mode") == 1
    # without current control there is neither a current limit nor its mode
    servos = [{"id": 1, "model": "XL430-W250", "current_limit": 1.0}]
    assert Host((1,), simulator={"factory": False}, servos=servos).read(1, "Operating Mode") == 1


def test_or_as_they_leave_the_factory() -> None:
    host = Host((7,), simulator={"factory": True})
    assert host.read(7, "Return Delay Time") == 250
    assert host.read(7, "Operating Mode") == 3
    assert host.read(7, "Baud Rate") == 3
    assert host.read(7, "ID") == 7


def test_quirks_win() -> None:
    quirks = {1: {"registers": {"Operating Mode": 4, "Goal Current": 3}, "model": "XM430-W210"}}
    host = Host((1,), simulator={"factory": False, "servos": quirks})
    assert host.read(1, "Operating Mode") == 4
    assert host.read(1, "Goal Current") == 3
    assert host.read(1, "Model Number") == 1030


def test_a_bench_has_free_servos() -> None:
    made = bench(BenchOptions(model="XL330-M288", ids=[3, 4], faults={"lost": 0.5}))
    assert [axis.device_id for axis in made.bus.axes] == [3, 4]
    assert made.options.simulator.faults.lost == 0.5
    assert made.options.simulator.factory
    with pytest.raises(ConfigError, match=r"--faults: lost: .*less than or equal to 1 \(got 2\)"):
        bench(BenchOptions(faults={"lost": 2}))
    with pytest.raises(ConfigError, match="did you mean XL330-M288"):
        bench(BenchOptions(model="XL330-M28"))


@pytest.mark.parametrize(
    ("given", "reported"),
    [
        ({"ids": [1, 1]}, "--ids 1, 1: two servos cannot share an id"),
        ({"ids": [253]}, "--ids 253: a XM430-W350 has ids 0 to 252"),
        ({"baud": 12345}, "has no 12345 baud"),
    ],
)
def test_a_bench_that_cannot_be_is_refused(given: dict[str, Any], reported: str) -> None:
    def build() -> None:
        made = bench(BenchOptions(**given))
        ServoWorld(made.options, made.bus, made.physics, FakeClock())

    with pytest.raises(ConfigError, match=reported):
        build()


def test_the_return_delay_is_whole_in_its_unit() -> None:
    with pytest.raises(ValidationError, match="multiple of 2"):
        BenchOptions(return_delay_us=7)


def test_a_link_replaces_nothing_but_a_link_to_a_line(tmp_path: Path) -> None:
    def serve(link: Path) -> None:
        serve_line(SerialLine(1_000_000), lambda path: None, lambda: True, link)

    kept = tmp_path / "precious"
    kept.write_text("not to be lost")
    other = tmp_path / "elsewhere"
    other.symlink_to(kept)
    for taken in (kept, other, tmp_path):
        with pytest.raises(DriverError, match="already exists and is"):
            serve(taken)
    assert kept.read_text() == "not to be lost"
    assert other.readlink() == kept
    with pytest.raises(DriverError, match="no link can be made there: No such file"):
        serve(tmp_path / "none" / "line")
    stale = tmp_path / "line"
    stale.symlink_to("/dev/pts/4711")  # of a simulator that was killed
    serve(stale)
    assert {one.name for one in tmp_path.iterdir()} == {"precious", "elsewhere"}


def test_a_link_that_another_has_taken_over_is_left_alone(tmp_path: Path) -> None:
    link = tmp_path / "line"

    def take_over(path: str) -> None:
        link.unlink()
        link.symlink_to("/dev/pts/4711")

    serve_line(SerialLine(1_000_000), take_over, lambda: True, link)
    assert str(link.readlink()) == "/dev/pts/4711"


@pytest.mark.parametrize(
    ("simulated", "reported"),
    [
        ({"servos": {9: {"voltage": 5.0}}}, "simulator.servos names servo 9"),
        ({"faults": {"events": [{"kind": "lost", "nth": 3, "id": 9}]}}, "lost is for servo 9"),
    ],
)
def test_what_happens_to_a_servo_that_is_not_there_is_refused(
    simulated: dict[str, Any], reported: str
) -> None:
    """It would do nothing, and a test that relies on it would pass."""
    with pytest.raises(ValidationError, match=reported):
        DynamixelOptions.model_validate({**BLOCK, "simulator": simulated})


def test_served_servos_announce_where_they_are_and_which() -> None:
    assert simulator.serve is not None
    made = bench(BenchOptions(model="XL330-M288", ids=[1, 4]))
    reported: list[Any] = []
    simulator.serve(*made, reported.append, lambda: True)
    [about] = reported
    assert about["endpoint"].startswith("/dev/")
    assert about == {
        "driver": "dynamixel",
        "endpoint": about["endpoint"],
        "models": {1: "XL330-M288", 4: "XL330-M288"},
        "options": {"port": about["endpoint"]},
    }
