"""Which way each bus takes: the table, what is refused, and what is left of a rig's truth."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import pytest

from tautwave.config import Rig, load_rig, resolved_yaml
from tautwave.config.load import parse_rig
from tautwave.contracts import Endpoint
from tautwave.errors import ConfigError
from tautwave.registry import load_driver
from tautwave.rig import Way, as_taken, build_rig, bus_ways, choose_way
from tautwave.rig.ways import endpoint_of
from tautwave.session import check
from tests.commands import tautwave

CONFIGS = Path(__file__).parents[2] / "configs"
SERVOS, MIXED, VCAN = "bench-dynamixel-sim", "bench-mixed-sim", "bench-canopen-vcan"
HARD = "buses.servos.options.port=/dev/ttyNONE"


def rig_of(name: str, *overrides: str) -> Rig:
    return load_rig(CONFIGS / f"{name}.yaml", overrides)


@pytest.mark.parametrize("serves", [False, True])
@pytest.mark.parametrize("attach", [False, True])
def test_hardware_that_is_named_is_opened_unless_it_is_to_be_simulated(
    attach: bool, serves: bool
) -> None:
    real = Endpoint("real", "/dev/ttyUSB0")
    for simulation in (False, True):
        way = choose_way(real, fake=False, simulation=simulation, attach=attach, serves=serves)
        assert way is Way.HARDWARE
    way = choose_way(real, fake=False, simulation=True, simulate=True, attach=attach, serves=serves)
    elsewhere = Way.ELSEWHERE if attach else Way.SERVED
    assert way is (elsewhere if serves else Way.MEMORY)


def test_a_fake_clock_never_opens_anything() -> None:
    kinds = ("real", "virtual", "none")
    for kind, simulate, attach, serves in product(kinds, *[(False, True)] * 3):
        asked = {"simulate": simulate, "attach": attach, "serves": serves}
        place = Endpoint(kind, "somewhere")  # type: ignore[arg-type]
        assert choose_way(place, fake=True, simulation=True, **asked) is Way.MEMORY
        if kind == "real":
            assert choose_way(place, fake=True, simulation=False, **asked) is None


def test_without_a_simulation_a_virtual_endpoint_is_somebody_elses_and_none_is_nobodys() -> None:
    place = Endpoint("virtual", "socketcan:vcan0")
    assert choose_way(place, fake=False, simulation=False) is Way.ELSEWHERE
    assert choose_way(Endpoint("none"), fake=False, simulation=False, attach=True) is None


@pytest.mark.parametrize(
    ("name", "overrides", "reported"),
    [
        (SERVOS, (), ("none", "")),
        (SERVOS, (HARD,), ("real", "/dev/ttyNONE")),
        ("xm430-pair", (), ("real", "/dev/ttyUSB0")),
        ("epos4-pair", (), ("real", "socketcan:can0")),
        ("dm4310-pair", (), ("real", "socketcan:can0")),
        ("dsy-rs-pair", (), ("real", "/dev/ttyUSB0")),
        (VCAN, (), ("virtual", "socketcan:vcan0")),
        ("bench-canopen-virtual", (), ("virtual", "virtual:bench")),
        (
            VCAN,
            ("buses.can.options.interface=udp_multicast", "buses.can.options.channel=239.74.163.2"),
            ("virtual", "udp_multicast:239.74.163.2"),
        ),
        ("bench-1dof-loopback", (), ("none", "")),
    ],
)
def test_drivers_say_where_their_options_lead(
    name: str, overrides: tuple[str, ...], reported: tuple[str, str]
) -> None:
    bus = next(iter(rig_of(name, *overrides).buses.values()))
    assert endpoint_of(load_driver(bus.driver), bus.options) == reported


def test_modbus_drives_with_connections_of_their_own_are_all_named() -> None:
    own = "buses.arm.options.devices=[{unit: 1, endpoint: 'tcp://10.0.0.7:502', rated_torque: 1}]"
    rig = rig_of("bench-modbus-tcp-sim", own)
    assert bus_ways(rig)["arm"].describe() == "hardware at tcp://10.0.0.7:502"
    # One server has one connection for all: these stay in the run's process.
    assert bus_ways(rig, simulate=["arm"])["arm"].way is Way.MEMORY


def test_a_driver_that_does_not_say_is_taken_at_its_hardware() -> None:
    plugin = load_driver("dynamixel")._replace(endpoint=None)
    assert endpoint_of(plugin, {}).kind == "real"
    assert endpoint_of(plugin._replace(hardware=False), {}).kind == "virtual"


def test_only_the_buses_that_are_named_are_simulated() -> None:
    hard = ("buses.hand.options.port=/dev/ttyNONE", "buses.arm.options.interface=socketcan",
            "buses.arm.options.channel=can7")  # fmt: skip
    rig = rig_of(MIXED, *hard)
    ways = bus_ways(rig, simulate=["arm"])
    assert [way.describe() for way in ways.values()] == [
        "hardware at /dev/ttyNONE",
        "simulated here, in memory; socketcan:can7 is not opened",
    ]
    ways = bus_ways(rig, simulate=True)
    assert [way.way for way in ways.values()] == [Way.SERVED, Way.MEMORY]


@pytest.mark.parametrize(
    ("name", "asked", "sentence"),
    [
        (
            MIXED,
            {"simulate": ["cna"]},
            "--simulate cna: there is no such bus; the rig has hand, arm",
        ),
        (MIXED, {"clock": "fake", "attach": True}, "--attach requires the real clock"),
        ("xm430-pair", {"simulate": True}, "nothing to simulate; add a simulation block"),
        ("xm430-pair", {"clock": "fake"}, "fake clock cannot pace /dev/ttyUSB0"),
        ("xm430-pair", {"attach": True}, "no bus has devices that are served elsewhere"),
        ("bench-canopen-virtual", {"attach": True}, "no bus has devices that are served elsewhere"),
    ],
)
def test_what_makes_no_sense_is_refused(name: str, asked: dict[str, object], sentence: str) -> None:
    with pytest.raises(ConfigError, match=sentence):
        bus_ways(rig_of(name), **asked)  # type: ignore[arg-type]


@pytest.mark.parametrize("name", [SERVOS, "bench-1dof-loopback"])
def test_a_bus_that_nothing_answers_on_is_refused_before_anything_is_opened(name: str) -> None:
    rig = rig_of(name).model_copy(update={"simulation": None})
    with pytest.raises(ConfigError, match=r"bus \w+: .*add a simulation block"):
        build_rig(rig)


def test_two_buses_do_not_drive_the_same_devices() -> None:
    at = [f"buses.follower_{arm}.options.interface=socketcan" for arm in ("left", "right")]
    at += [f"buses.follower_{arm}.options.channel=can2" for arm in ("left", "right")]
    name = "arms/openarm-bimanual"
    said = "bus follower_right: it is at socketcan:can2, as bus follower_left is, and both have a"
    with pytest.raises(ConfigError, match=said):
        bus_ways(rig_of(name, *at))
    apart = bus_ways(rig_of(name, *at[:3], "buses.follower_right.options.channel=can3"))
    assert apart["follower_left"].way is apart["follower_right"].way is Way.HARDWARE
    assert bus_ways(rig_of(name, *at), simulate=True)["follower_left"].way is not Way.HARDWARE


def test_hardware_has_no_simulated_truth() -> None:
    rig = rig_of(MIXED, "buses.hand.options.port=/dev/ttyNONE")
    taken = as_taken(rig, bus_ways(rig))
    assert rig.simulation is not None
    assert taken.simulation is not None
    assert set(taken.simulation.axes) == {name for name in rig.axes if name.startswith("slave")}
    assert not taken.simulation.hand
    assert taken.simulation.environment == rig.simulation.environment
    again = parse_rig(resolved_yaml(taken))
    assert again.simulation is not None
    believed = rig.axes["master.lever"].inertia
    assert believed is not None
    assert again.simulation.axes["master.lever"].inertia == believed.value
    everything = rig_of(SERVOS, HARD)
    assert as_taken(everything, bus_ways(everything)).simulation is None
    assert as_taken(everything, bus_ways(everything, simulate=True)) == everything


def test_only_what_is_simulated_records_a_truth() -> None:
    rig = rig_of(MIXED, "buses.hand.options.port=/dev/ttyNONE")
    built = build_rig(rig)
    true = {name.split(".")[1] for name in built.columns if name.startswith("true.")}
    assert true == {"slave"}
    for simulator in built.simulators:
        simulator.close()


@pytest.mark.slow
def test_check_tells_the_ways_and_what_simulate_makes_of_them(tmp_path: Path) -> None:
    rig = rig_of(SERVOS, HARD)
    found = check(rig)
    assert dict(found.facts)["bus servos"] == "hardware at /dev/ttyNONE"
    assert found.as_dict()["buses"]["servos"] == {
        "way": "hardware",
        "where": None,
        "endpoint": "/dev/ttyNONE",
        "named": "/dev/ttyNONE",
        "forced": False,
        "words": "hardware at /dev/ttyNONE",
    }
    reported = tautwave(
        "check", CONFIGS / f"{SERVOS}.yaml", "--set", HARD, "--simulate", cwd=tmp_path
    )
    assert "served by this run on a separate endpoint" in " ".join(reported.stdout.split())


def test_a_rig_file_is_no_name_of_a_bus(tmp_path: Path) -> None:
    reported = tautwave("run", "--simulate", CONFIGS / f"{SERVOS}.yaml", cwd=tmp_path)
    assert reported.exit_code == 2
    assert "put it after the rig file" in reported.stderr


@pytest.mark.slow
def test_a_fake_clock_says_that_it_simulates(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    from tests.commands import keep_in_one_process

    keep_in_one_process(monkeypatch)
    words = ("--clock", "fake", "--duration", "0.1", "--set", HARD, "--out", "out")
    reported = tautwave("run", CONFIGS / f"{SERVOS}.yaml", *words, cwd=tmp_path)
    assert reported.exit_code == 0, reported.output
    first = reported.stdout.splitlines()[0]
    assert first == (
        "bus servos  simulated here, in memory; /dev/ttyNONE is not opened (--clock fake)"
    )
