"""The ledger of settings, with devices that ignore a write, take something else, refuse or fail."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave.contracts import AxisSpec, BusSpec
from tautwave.device_settings import (
    DeviceSetting,
    DeviceSettings,
    Lasts,
    SettingRefusedError,
    Settled,
    refuse_differences,
)
from tautwave.errors import DriverError, SettingsDifferError

PLACES = tuple("abcdef")


class Device:
    """Values by place; `ways` says how a place takes a write; it fails in its `fails_at`-th act."""

    def __init__(self, values: dict[str, int], ways: dict[str, str]) -> None:
        self.values = dict(values)
        self.ways = ways
        self.acts = 0
        self.fails_at = -1
        self.error: BaseException = DriverError("gone")
        self.written: list[str] = []

    def _act(self) -> None:
        self.acts += 1
        if self.acts == self.fails_at:
            raise self.error

    def read(self, place: str) -> int:
        self._act()
        if self.ways[place] == "absent":
            raise SettingRefusedError(f"no {place}")
        return self.values[place]

    def write(self, place: str, value: int) -> None:
        way = self.ways[place]
        if way == "refuses":
            self._act()
            raise SettingRefusedError(f"{place} stays")
        self.written.append(place)
        if way == "takes":
            self.values[place] = value
        elif way == "other":
            self.values[place] = value + 1
        self._act()  # after it: whether it arrived is not known


class Case(NamedTuple):
    device: Device
    settings: Sequence[DeviceSetting]
    before: dict[str, int]

    def ledger(self, *, configure: bool) -> DeviceSettings:
        return DeviceSettings("it", self.device.read, self.device.write, configure=configure)

    def of(self, lasts: Lasts) -> list[DeviceSetting]:
        return [one for one in self.settings if one.lasts is lasts]


@st.composite
def cases(draw: st.DrawFn, ways: Sequence[str]) -> Case:
    values = {place: draw(st.integers(0, 3)) for place in PLACES}
    chosen = {place: draw(st.sampled_from(ways)) for place in PLACES}
    settings = [
        DeviceSetting(
            place, place, draw(st.integers(0, 3)), draw(st.sampled_from(Lasts)),
            mask=draw(st.sampled_from((-1, 1, 2))),
        )
        for place in draw(st.permutations(PLACES))
    ]  # fmt: skip
    return Case(Device(values, chosen), settings, dict(values))


ANY = cases(("takes", "takes", "ignores", "other", "refuses", "absent"))
TAKES = cases(("takes",))


def wanted(one: DeviceSetting, before: int) -> int:
    return before & ~one.mask | one.wanted & one.mask


@given(case=ANY, configure=st.booleans())
def test_what_comes_of_a_setting_is_what_the_device_then_holds(case: Case, configure: bool) -> None:
    ledger = case.ledger(configure=configure)
    for one in case.settings:
        found = ledger.settle(one)
        place = str(one.place)
        if case.device.ways[place] == "absent":
            assert found[:2] == (None, None)
            continue
        assert (found.before, found.after) == (case.before[place], case.device.values[place])
        assert (found.refusal is not None) == (
            case.device.ways[place] == "refuses"
            and wanted(one, case.before[place]) != case.before[place]
            and (configure or one.lasts is not Lasts.WRITTEN)
        )


@given(case=ANY, configure=st.booleans())
def test_nothing_lasting_is_written_without_permission_and_all_that_differs_is_listed(
    case: Case, configure: bool
) -> None:
    ledger = case.ledger(configure=configure)
    for one in case.settings:
        ledger.settle(one)
    differ = [
        str(one.place)
        for one in case.of(Lasts.WRITTEN)
        if case.device.ways[str(one.place)] != "absent"
        and wanted(one, case.before[str(one.place)]) != case.before[str(one.place)]
    ]
    if not configure:
        assert not {str(one.place) for one in case.of(Lasts.WRITTEN)} & set(case.device.written)
        assert [text.split()[1] for text in ledger.differences] == differ
    else:
        assert not ledger.differences
    lasting = [
        str(one.place) for one in case.settings if one.lasts in (Lasts.STORED, Lasts.WRITTEN)
    ]
    really = [place for place in lasting if case.device.values[place] != case.before[place]]
    assert ledger.changed == really


@given(
    case=ANY,
    configure=st.booleans(),
    fails_at=st.integers(1, 20),
    error=st.sampled_from((DriverError("gone"), KeyboardInterrupt())),
)
def test_what_fails_in_the_middle_gives_back_its_loans_and_names_what_lasts(
    case: Case, configure: bool, fails_at: int, error: BaseException
) -> None:
    device, ledger = case.device, case.ledger(configure=configure)
    device.fails_at, device.error = fails_at, error
    try:
        for one in case.settings:
            ledger.settle(one)
    except type(error):
        pass
    device.fails_at = -1  # it responds again
    ledger.give_back()
    for one in case.of(Lasts.LOAN):
        place = str(one.place)
        if device.ways[place] != "other":  # that one takes nothing as it is said
            assert device.values[place] == case.before[place]
    lasting = {
        str(one.place) for one in case.settings if one.lasts in (Lasts.STORED, Lasts.WRITTEN)
    }
    really = {place for place in lasting if device.values[place] != case.before[place]}
    assert really <= set(ledger.changed) <= set(device.written) | really | {ledger_last(ledger)}


def ledger_last(ledger: DeviceSettings) -> str:
    """Return the one setting whose write may not have been sent."""
    return str(ledger.changed[-1]) if ledger.changed else ""


@given(case=TAKES, fails_at=st.integers(1, 20))
def test_a_device_that_was_away_is_given_back_its_loans_by_the_next_start(
    case: Case, fails_at: int
) -> None:
    """It does not respond to the giving back either; the driver keeps what it owes."""
    device = case.device
    loans: dict[str, int] = {}
    for number in range(2):
        ledger = DeviceSettings("it", device.read, device.write, configure=True, loans=loans)
        device.acts, device.fails_at = 0, fails_at if number == 0 else -1
        try:
            for one in case.settings:
                ledger.settle(one)
        except DriverError:
            continue  # and nothing was given back
        ledger.give_back()
    assert all(device.values[str(one.place)] == case.before[str(one.place)]
               for one in case.of(Lasts.LOAN))  # fmt: skip
    assert not loans


@given(held=st.integers(0, 3), idle=st.integers(0, 3))
def test_what_a_killed_run_left_is_given_back_as_idle(held: int, idle: int) -> None:
    device = Device({"a": held}, {"a": "takes"})
    ledger = DeviceSettings("it", device.read, device.write)
    ledger.settle(DeviceSetting("a", "a", 2, Lasts.LOAN, idle=idle))
    assert device.values["a"] == 2
    ledger.give_back()
    assert device.values["a"] == (idle if held == 2 else held)


@given(case=TAKES)
def test_no_loan_is_stored_and_all_are_there_again(case: Case) -> None:
    device, ledger = case.device, case.ledger(configure=True)
    for one in case.settings:
        ledger.settle(one)
    before = dict(device.values)
    stored: dict[str, int] = {}
    ledger.without_loans(lambda: stored.update(device.values))
    assert device.values == before
    for one in case.of(Lasts.LOAN):
        assert stored[str(one.place)] == case.before[str(one.place)]
    ledger.give_back()
    for one in case.of(Lasts.LOAN):
        assert device.values[str(one.place)] == case.before[str(one.place)]


Make = Callable[[DeviceSettings, DeviceSetting], None]


@pytest.mark.parametrize("make", [DeviceSettings.keep, DeviceSettings.put])
@pytest.mark.parametrize(
    ("way", "sentence"),
    [
        ("ignores", "it: mode reads 1 after 2 was written; is another program on the line?"),
        ("other", "it: mode reads 3 after 2 was written; is another program on the line?"),
        ("refuses", "mode stays"),
    ],
)
def test_a_device_that_does_not_take_a_setting_is_refused(
    make: Make, way: str, sentence: str
) -> None:
    device = Device({"mode": 1}, {"mode": way})
    ledger = DeviceSettings("it", device.read, device.write)
    with pytest.raises(DriverError) as caught:
        make(ledger, DeviceSetting("mode", "mode", 2))
    assert str(caught.value) == sentence
    assert not ledger.held


def test_what_is_forgotten_is_found_and_what_lasts_is_not_asked_again() -> None:
    device = Device({"a": 1, "b": 1, "c": 1}, dict.fromkeys("abc", "takes"))
    ledger = DeviceSettings("it", device.read, device.write, configure=True)
    ledger.put(DeviceSetting("a", "a", 1))
    ledger.keep(DeviceSetting("b", "b", 2, mask=2))
    ledger.keep(DeviceSetting("c", "c", 3, Lasts.WRITTEN, "its use"))
    assert ledger.notes == [
        "it: b 1 -> 3 written and read back", "it: c 1 -> 3 (its use) written and read back"
    ]  # fmt: skip
    assert ledger.forgotten() == []
    device.values = {"a": 0, "b": 0, "c": 0}  # its power was off
    assert [(one.name, one.wanted, found) for one, found in ledger.forgotten()] == [
        ("a", 1, 0), ("b", 3, 0)
    ]  # fmt: skip


def test_a_lasting_setting_lost_after_it_was_sent_is_a_note() -> None:
    device = Device({"a": 1}, {"a": "takes"})
    device.fails_at = 3  # it is read, it is written, and then it is gone
    ledger = DeviceSettings("it", device.read, device.write, configure=True)
    with pytest.raises(DriverError, match="gone"):
        ledger.keep(DeviceSetting("a", "a", 2, Lasts.WRITTEN))
    assert ledger.notes == ["it: a was written, but not read back"]


def test_what_differs_in_all_devices_is_one_refusal() -> None:
    bus = BusSpec("line", (AxisSpec("master.a", 1, "rotary", "impedance", 1.0),), 1000.0)
    ledgers = []
    for name in ("one", "two"):
        device = Device({"a": 1}, {"a": "takes"})
        ledgers.append(DeviceSettings(name, device.read, device.write))
    refuse_differences(bus, ledgers)
    for ledger in ledgers:
        assert ledger.settle(DeviceSetting("a", "a", 2, Lasts.WRITTEN)) == Settled(1, 1)
    with pytest.raises(SettingsDifferError) as caught:
        refuse_differences(bus, ledgers)
    assert str(caught.value) == (
        "bus line: lasting settings differ:\n  one: a 1 -> 2\n  two: a 1 -> 2\n"
        "run once with --configure to write them into the devices"
    )
