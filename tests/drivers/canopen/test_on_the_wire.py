"""What people meet on the wire: slow servers, two nodes with one id, full queues, odd displays."""

from __future__ import annotations

import itertools
import re
from typing import Any

import can
import pytest

from tautwave.clock import FakeClock, MonotonicClock
from tautwave.errors import BusTimeout, DeviceFault, DriverError
from tautwave_drivers.can.full_queue import queue_remedy
from tautwave_drivers.can.opening import open_port
from tautwave_drivers.canopen.scan import ScanOptions, look
from tests.drivers.canopen.benches import block, driver_options, make, node
from tests.drivers.canopen.foreign import Foreign, foreign
from tests.foreign.can_bus import ForeignBus
from tests.foreign.cia402 import ENCODER, ForeignDrive

WRAP = 1 << 31


# -- SDO ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("takes_ms", "given", "slow"),
    [(5, 0.02, False), (15, 0.02, False), (25, 0.02, True), (75, 0.02, True), (170, 0.02, None),
     (90, 0.1, False)],
)  # fmt: skip
def test_a_slow_server_gets_more_time_within_bounds_or_is_told_of(
    takes_ms: int, given: float, slow: bool | None
) -> None:
    rig = foreign(options={"sdo_timeout_s": given})
    rig.bus.response_ns = takes_ms * 1_000_000
    if slow is None:
        with pytest.raises(BusTimeout, match=r"or raise sdo_timeout_s \(now 0\.02\) for a drive"):
            rig.driver.open()
        rig.driver.close()
        return
    rig.driver.open()
    said = [note for note in rig.driver.notes if "responds slowly" in note]
    assert len(said) == slow, said
    if slow:
        (stated,) = re.findall(r"state sdo_timeout_s: ([\d.]+)", said[0])
        rig = foreign(options={"sdo_timeout_s": float(stated)})
        rig.bus.response_ns = takes_ms * 1_000_000
        rig.driver.open()
        assert not [note for note in rig.driver.notes if "responds slowly" in note]
    rig.driver.close()


def doubled() -> Foreign:
    """Node 1 twice: the second one is a little slower."""
    rig = foreign()
    rig.bus.drives.append(ForeignDrive(1, rig.bus.late_from_drive))
    return rig


def test_two_nodes_with_one_id_are_refused() -> None:
    rig = doubled()
    assert "two responses to one request: two nodes have the id 1" in rig.refused()


def test_two_nodes_with_one_id_are_seen_by_a_scan() -> None:
    for drives, loud in ((1, False), (2, True)):
        clock = FakeClock()
        bus = ForeignBus(clock, (1, 2))
        if drives == 2:
            bus.drives.append(ForeignDrive(1, bus.late_from_drive))
        rows = look(bus, clock, ScanOptions(listen_s=0.1))
        said = {row["node"]: "two nodes have this id" in row["errors"] for row in rows}
        assert said == {1: loud, 2: False}


def test_a_drive_without_what_is_commanded_is_refused_though_it_takes_the_mapping() -> None:
    assert "has no 6071:00 target torque, which CST" in foreign(lacks=frozenset({0x6071})).refused()
    rig = foreign(lacks=frozenset({0x6077}), causality="admittance")
    assert "has no 6077:00 torque actual value, which CSV" in rig.refused()


@pytest.mark.parametrize(
    ("watched", "killed"),
    [(0, False), (127 << 16 | 60, True), (126 << 16 | 60, False), (127 << 16, False)],
)
def test_a_limit_is_said_to_be_a_killed_runs_only_where_one_left_it(
    watched: int, killed: bool
) -> None:
    said = foreign({(0x6072, 0): 100, (0x1016, 1): watched}).refused()
    assert "6072:00 max torque is 100" in said
    assert ("a run that was killed lowered it" in said) == killed


def test_a_start_that_is_refused_leaves_every_drive_as_it_was() -> None:
    rig = foreign(numbers=(1, 2))
    second = rig.bus.drives[1]
    second.mute_of = 10**9  # it never sends a sample: the last thing that is looked at
    assert "sends no TPDO1" in rig.refused()
    rig.bus.advance(rig.clock.now_ns() + 1_000_000)  # the last frame arrives
    lent = ((0x6072, 0), (0x1016, 1), (0x1400, 5))
    for drive in rig.bus.drives:
        assert [drive.values[key] for key in lent] == [3000, 0, 0]
        assert drive.node.nmt.state == "PRE-OPERATIONAL"


# -- modes, positions, emergencies ----------------------------------------------------------------


@pytest.mark.parametrize("mapping", ["full", "lean"])
@pytest.mark.parametrize("shows", ["when enabled", "never"])
@pytest.mark.parametrize("option", ["always", "when_enabled"])
def test_a_mode_that_shows_only_when_enabled_is_one_option(
    option: str, shows: str, mapping: str
) -> None:
    rig = foreign(first={"mode_display": option, "mapping": mapping})
    rig.drive.shows_mode = shows
    if option == "when_enabled" and shows == "when enabled":
        rig.enable()
        for _ in range(5):
            rig.cycle(0.1)
        assert rig.drive.torque == pytest.approx(0.1, abs=1e-3)
    else:
        with pytest.raises(DeviceFault) as said:
            rig.enable(1200)
        sentence = str(said.value)
        assert ("mode_display: when_enabled" in sentence) == (option == "always"), sentence
        assert rig.drive.angle == 0.0
    rig.driver.close()
    assert rig.drive.state == "disabled"


@pytest.mark.parametrize("way", [1, -1])
def test_a_position_goes_on_past_the_end_of_its_32_bits(way: int) -> None:
    rig = foreign()
    turns = way * (WRAP - 400) / ENCODER
    rig.drive.angle = turns * 2.0 * 3.141592653589793
    rig.enable()
    (before,) = rig.cycle()
    seen = [before.position]
    for _ in range(200):
        (state,) = rig.cycle(way * 0.1)
        seen.append(state.position)
    steps = [way * (after - one) for one, after in itertools.pairwise(seen)]
    assert min(steps) >= 0.0
    assert max(steps) < 0.1
    assert abs(rig.drive.counts() - way * WRAP) > WRAP  # it has wrapped
    rig.driver.close()


@pytest.mark.parametrize(("code", "named"), [(0xFF01, True), (0x2310, False), (0x8130, False)])
def test_a_manufacturers_emergency_names_the_key_that_tolerates_it(code: int, named: bool) -> None:
    for given in ((), (code,)):
        rig = foreign(options={"tolerated_emergencies": list(given)})
        rig.enable()
        rig.cycle()
        rig.drive.emergency(code)
        said = []
        for _ in range(3):
            rig.cycle()
            said += rig.driver.faults()
        (one,) = said
        assert one.fatal == (not given)
        hint = f"add 0x{code:X} to tolerated_emergencies of the bus"
        assert (hint in one.text) == (named and not given)
        rig.driver.close()


# -- the queue ------------------------------------------------------------------------------------


def test_a_full_queue_is_named_with_the_line_that_mends_it() -> None:
    options = driver_options(block(node(1)) | {"interface": "socketcan", "channel": "can3"})
    said = queue_remedy(options)
    assert "ip link set can3 txqueuelen 100" in said
    assert "ip link set can3 type can bitrate 1000000" in said
    soft = driver_options(block(node(1)) | {"interface": "socketcan", "channel": "vcan0"})
    assert "txqueuelen" not in queue_remedy(soft)


def test_what_keeps_samples_away_is_told_of_for_the_last_line() -> None:
    rig = make()
    rig.open_and_enable()
    rig.run(5)
    assert rig.driver.misses == {}
    rig.port.full = True
    for _ in range(3):
        rig.cycle()
    assert list(rig.driver.misses) == ["master.a1", "master.a2"]
    for why in rig.driver.misses.values():
        assert re.match(r"the CAN transmit queue was full for \d+ cycles; check", why)
    rig.port.full = False
    rig.run(20)
    assert rig.driver.misses == {}
    rig.driver.close()


def test_a_queue_that_is_full_at_the_start_is_one_sentence() -> None:
    rig = make()
    rig.port.full = True
    with pytest.raises(DriverError, match=r"transmit queue stays full.*bit rate \(here 1000000\)"):
        rig.driver.open()
    rig.driver.close()


# -- two buses on one host ------------------------------------------------------------------------


def multicast_works() -> bool:
    try:
        bus = can.Bus(interface="udp_multicast", channel="239.74.163.211")
    except (OSError, can.CanError):
        return False
    bus.shutdown()
    return True


@pytest.mark.skipif(not multicast_works(), reason="no multicast here")
def test_two_multicast_channels_of_one_host_do_not_hear_each_other() -> None:
    clock = MonotonicClock()

    def opened(channel: str) -> Any:
        options = driver_options(
            block(node(1)) | {"interface": "udp_multicast", "channel": channel}
        )
        return open_port(options, clock)

    mine, other, same = (opened(f"239.74.163.{number}") for number in (211, 212, 211))
    try:
        assert other.send(0x181, b"other")
        assert mine.send(0x182, b"mine")
        heard: list[bytes] = []
        for _ in range(100):
            while (frame := same.receive()) is not None:
                heard.append(frame[1])
            if heard:
                break
            clock.sleep_until(clock.now_ns() + 5_000_000)
        assert heard == [b"mine"]
        assert mine.receive() is None
        assert other.receive() is None
    finally:
        for port in (mine, other, same):
            port.close()
