"""Before enabling: the right drive, healthy, limited, watched; what may be written and what not."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import pytest

from tautwave.errors import BusBudgetError, BusTimeout, DeviceFault, DriverError
from tautwave_sim.modbus.faults import UNDISTURBED, FaultPlan
from tautwave_sim.modbus.options import ModbusFaults
from tests.drivers.modbus.parts import FAST_RTU, Bench, bench, device, spec

CYCLIC_READ = bytes.fromhex("03 0002 0004")  # status, fault and position


def quirks(**keys: Any) -> dict[str, Any]:
    return {"simulator": {"devices": {1: keys}}}


def refusal(made: Bench) -> str:
    with pytest.raises(DriverError) as found:
        made.driver.open()
    return str(found.value)


def notes(made: Bench) -> str:
    return "\n".join(made.driver.notes)


def test_a_drive_of_another_family_is_not_written_to() -> None:
    made = bench(**quirks(registers={"identity": 7}))
    assert "identity reads 0x7, but a generic drive has 0x5457" in refusal(made)
    assert made.world.bus.drives[1].wear == {}
    assert made.number(1, "eeprom") == 1  # as it was


def test_a_wrong_rated_torque_or_encoder_is_found() -> None:
    made = bench(devices=[device(1, rated_torque=1.0)], **quirks(registers={"rated_torque": 2000}))
    assert "its rated torque is 2 N m, but the rig states 1" in refusal(made)
    made = bench(devices=[device(1)], **quirks(registers={"counts": 4096}))
    assert "it has 4096 counts per revolution, but the rig states 65536" in refusal(made)


def test_the_family_is_noted_with_what_the_drive_reports_of_itself() -> None:
    made = bench()
    made.driver.open()
    [found] = made.driver.identities.values()
    said = ", ".join([found["family"], *(f"{k} {v}" for k, v in found.items() if k != "family")])
    assert any(note.endswith(f": {said}") for note in made.driver.notes), made.driver.notes


def test_limits_and_mode_are_written_and_read_back() -> None:
    made = bench(spec(1, effort=0.5))
    made.driver.open()
    assert made.number(1, "torque_limit") == 500
    assert made.number(1, "mode") == 2
    assert "torque_limit 3000 -> 500 (the rig's limit) written and read back" in notes(made)
    made = bench(spec(1, "admittance", effort=0.5, velocity=2.0))
    made.driver.open()
    assert made.number(1, "velocity_limit") == 191  # 2 rad/s is 190.99 tenths of rpm: rounded up
    assert made.number(1, "mode") == 1


def test_writes_are_kept_out_of_the_eeprom() -> None:
    """With the switch they wear nothing, however often the rig runs."""
    made = bench()
    for _ in range(3):
        made.enable()
        made.run(50, 0.3)
        made.driver.close()
    assert sum(made.world.bus.drives[1].wear.values()) == 0
    assert made.number(1, "eeprom") == 0
    dsy = bench(profile="dsy-rs", **quirks(registers={"eeprom": 1}))
    dsy.enable()
    dsy.run(50, 0.3)
    assert sum(dsy.world.bus.drives[1].wear.values()) == 0
    assert dsy.number(1, "eeprom") == 0


def changed_profile(tmp_path: Any, change: Callable[[dict[str, Any]], None]) -> str:
    import yaml

    from tests.drivers.modbus.test_profile import generic

    data = generic()
    change(data)
    path = tmp_path / "mine.yaml"
    path.write_text(yaml.safe_dump(data), encoding="utf-8")
    return str(path)


def without_switch(data: dict[str, Any]) -> None:
    del data["eeprom_off"]


def taciturn(data: dict[str, Any]) -> None:
    del data["roles"]["rated_torque"], data["roles"]["counts"]


def test_a_drive_that_tells_no_rating_is_taken_as_the_rig_states_it(tmp_path: Any) -> None:
    mine = device(1, rated_torque=2.0) | {"profile": changed_profile(tmp_path, taciturn)}
    made = bench(spec(1, effort=0.5), devices=[mine])
    made.driver.open()
    assert made.number(1, "torque_limit") == 250  # of 2 N m


def test_lasting_writes_need_configure(tmp_path: Any) -> None:
    profile = changed_profile(tmp_path, without_switch)
    mine = device(1, counts_per_revolution=65536) | {"profile": profile}
    reported = refusal(bench(devices=[mine]))
    first, mode, _, timeout, last = reported.splitlines()
    assert first == "bus arm: lasting settings differ:"
    assert mode.endswith(" on bus arm: mode 0 -> 2 (the mode that the axis needs)")
    assert timeout.endswith(": comm_timeout 0 -> 100 (comm-loss timeout)")
    assert last == "run once with --configure to write them into the devices"
    made = bench(devices=[mine], bus={"configure": True})
    made.driver.open()
    assert made.number(1, "mode") == 2
    assert made.number(1, "comm_timeout") == 100  # lasting too: it stays
    made.driver.close()
    # What is right already needs no permission.
    registers = {"mode": 2, "torque_limit": 1000, "comm_timeout": 100}
    bench(devices=[mine], **quirks(registers=registers)).driver.open()


def test_a_lasting_timeout_alone_needs_configure_as_well(tmp_path: Any) -> None:
    mine = device(1) | {"profile": changed_profile(tmp_path, without_switch)}
    made = bench(devices=[mine], **quirks(registers={"mode": 2, "torque_limit": 1000}))
    _, only, _ = refusal(made).splitlines()
    assert only.endswith(": comm_timeout 0 -> 100 (comm-loss timeout)")
    assert made.number(1, "comm_timeout") == 0


def test_what_differs_in_all_drives_is_listed_at_once(tmp_path: Any) -> None:
    mine = changed_profile(tmp_path, without_switch)
    given = [device(unit) | {"profile": mine} for unit in (1, 2)]
    made = bench(spec(1), spec(2), devices=given)
    listed = refusal(made).splitlines()[1:-1]
    assert [(line.split()[2], line.split(": ")[1].split()[0]) for line in listed] == [
        (f"{unit})", name) for unit in "12" for name in ("mode", "torque_limit", "comm_timeout")
    ], listed
    assert [made.number(unit, "mode") for unit in (1, 2)] == [0, 0]


def without_reset(data: dict[str, Any]) -> None:
    del data["fault_reset"]


def test_a_fault_that_no_sequence_resets_is_left_to_the_drive(tmp_path: Any) -> None:
    mine = device(1) | {"profile": changed_profile(tmp_path, without_reset)}
    made = bench(devices=[mine], **quirks(starts_in_fault=True))
    assert refusal(made).endswith(
        "is in fault: overloaded for too long (code 0x6); clear the fault at the drive"
    )


def test_a_register_that_a_drive_does_not_let_us_use_is_named_with_its_exception() -> None:
    made = bench(spec(1, effort=0.5))
    bank = made.world.bus.drives[1].bank
    limit = bank.registers["torque_limit"]
    bank.registers["torque_limit"] = limit._replace(high=400)
    reported = refusal(made)
    assert "torque_limit does not take 500: value or count not accepted (exception 03)" in reported
    made = bench()
    made.world.bus.drives[1].bank._at.pop(("", limit.address))
    reported = refusal(made)
    assert "torque_limit cannot be read: " in reported


@pytest.mark.parametrize(
    ("profile", "register", "value", "said"),
    [
        ("generic", "control", "1", r"enable, step \d \(control\): "),
        ("cia402", "controlword", "0x6", "controlword = 0x6: "),
    ],
)
def test_a_command_that_a_drive_does_not_take_is_named(
    profile: str, register: str, value: str, said: str
) -> None:
    made = bench(profile=profile)
    bank = made.world.bus.drives[1].bank
    bank.registers[register] = bank.registers[register]._replace(high=int(value, 16) - 1)
    with pytest.raises(DeviceFault, match=rf"slave\.a1 \(unit 1\): {said}value or count not acc"):
        made.enable()
    made.driver.close()


def test_a_status_that_a_cia_402_drive_does_not_show_is_named() -> None:
    made = bench(profile="cia402")
    bank = made.world.bus.drives[1].bank
    bank._at.pop(("", bank.registers["statusword"].address))
    with pytest.raises(DeviceFault, match=r"slave\.a1 \(unit 1\): statusword: .*exception 02"):
        made.enable()
    made.driver.close()


def test_a_drive_that_falls_silent_while_it_comes_on_is_reported() -> None:
    made = bench(**quirks(enable_s=0.5))
    made.driver.open()
    for _ in range(10):
        assert not made.driver.enable_step()
        made.clock.sleep_until(made.clock.now_ns() + made.bus.period_ns)
    made.world.bus.plan = FaultPlan(ModbusFaults(request_lost=1.0))

    def enable() -> None:
        for _ in range(20_000):
            made.driver.enable_step()
            made.clock.sleep_until(made.clock.now_ns() + made.bus.period_ns)

    with pytest.raises(BusTimeout, match=r"slave\.a1 \(unit 1\): stopped answering while it was"):
        enable()
    made.driver.close()


def test_the_comm_loss_timeout_is_tried_then_armed_and_stops_the_drive() -> None:
    made = bench()
    made.driver.open()
    assert made.number(1, "comm_timeout") == 0  # nobody speaks to it while others are brought up
    assert "after 0.1 s without a request" in notes(made)
    made.enable()
    assert made.number(1, "comm_timeout") == 100
    made.run(5, 0.5)
    made.clock.sleep_until(made.clock.now_ns() + 150_000_000)  # the host is away
    made.run(3, 0.5)
    assert made.commanded(0) == 0.0
    faults = made.faults()
    assert [fault.fatal for fault in faults] == [True]
    assert "the line was silent for too long (comm-loss timeout) (code 0x1)" in faults[0].text
    made.driver.close()
    assert made.number(1, "comm_timeout") == 0


def test_a_comm_loss_timeout_that_does_not_stick_is_found() -> None:
    reported = refusal(bench(**quirks(keeps_comm_timeout=True)))
    assert "comm_timeout reads 0 after 100 was written" in reported


def test_a_timeout_of_less_than_three_periods_is_refused() -> None:
    reported = refusal(bench(rate_hz=20.0, comm_timeout_s=0.1))
    assert "set it to 0.15 or more" in reported


@pytest.mark.parametrize("profile", ["dsy-rs", "cia402"])
def test_a_drive_without_comm_loss_timeout_is_refused_or_marked_unwatched(profile: str) -> None:
    reported = refusal(bench(profile=profile, bus={"allow_unwatched": False}))
    assert "keeps following its last command" in reported
    assert "--allow-unwatched" in reported
    made = bench(profile=profile)
    made.driver.open()
    assert made.driver.unwatched == {
        "slave.a1": "(unit 1) keeps following its last command: it has no comm-loss timeout"
    }
    assert made.driver.watchdog_s == {}


def test_settings_that_a_profile_takes_for_granted_are_compared() -> None:
    made = bench(profile="dsy-rs", **quirks(registers={"di1_function": 2}))
    assert "di1_function is 2, but must be 1: DI1 has to be servo on" in refusal(made)
    made = bench(profile="dsy-rs", **quirks(registers={"torque_filter": 50}))
    made.driver.open()
    assert made.number(1, "torque_filter") == 0


def test_a_fault_is_reset_once_or_reported() -> None:
    made = bench(**quirks(starts_in_fault=True))
    made.enable()
    assert "was in fault, now reset: too much current (code 0x2)" in notes(made)
    made = bench(**quirks(starts_in_fault=True, resets=5))
    reported = refusal(made)
    assert "is still in fault after a reset: too much current" in reported


@pytest.mark.parametrize("profile", ["generic", "dsy-rs"])
def test_a_drive_that_does_not_come_on_is_reported_with_its_step(profile: str) -> None:
    made = bench(profile=profile, **quirks(refuses_to_enable=True))
    with pytest.raises(BusTimeout, match=r"slave.a1 \(unit 1\): enable, step \d \(\w+\): still "):
        made.enable()
    made.driver.close()


def test_a_cia_402_drive_that_does_not_come_on_is_reported_with_its_state() -> None:
    made = bench(profile="cia402", **quirks(refuses_to_enable=True))
    with pytest.raises(DeviceFault, match=r"slave.a1 \(unit 1\)"):
        made.enable()
    made.driver.close()


@pytest.mark.parametrize("profile", ["generic", "cia402", "dsy-rs"])
def test_a_slow_drive_is_waited_for_without_blocking(profile: str) -> None:
    made = bench(profile=profile, **quirks(enable_s=0.3))
    made.driver.open()
    began, longest = made.clock.now_ns(), 0
    while True:
        before = made.clock.now_ns()
        done = made.driver.enable_step()
        longest = max(longest, made.clock.now_ns() - before)
        if done:
            break
        made.clock.sleep_until(before + made.bus.period_ns)
        assert made.clock.now_ns() - began < 2_000_000_000
    assert made.clock.now_ns() - began > 290_000_000
    assert longest == 0


def test_a_drive_that_is_not_there() -> None:
    made = bench(spec(9), devices=[device(9)], **{"simulator": {"faults": {"request_lost": 1.0}}})
    began = made.clock.now_ns()
    assert "no answer at sim; check its supply and cable" in refusal(made)
    assert made.clock.now_ns() - began < 2_000_000_000


def test_a_drive_on_in_spite_of_us_is_taken_off_first() -> None:
    made = bench(**quirks(registers={"control": 1, "target_torque": 400}))
    made.world.bus.drives[1].machine.on_write({"control"}, 0)
    assert made.world.bus.drives[1].on
    made.driver.open()
    assert not made.world.bus.drives[1].on
    assert made.number(1, "target_torque") == 0


def test_tcp_drives_too_slow_for_the_rate_are_measured_before_anything_moves() -> None:
    made = bench(rate_hz=100.0, **quirks(answer_s=0.02), turnaround_s=0.001)
    with pytest.raises(BusBudgetError, match=r"takes 20 ms \(measured\).*divisor: 3 on this bus"):
        made.driver.open()
    assert not made.world.bus.drives[1].on


@pytest.mark.parametrize("lost", [4, 5])
def test_a_trial_of_the_cyclic_request_may_be_lost_but_not_all(lost: int) -> None:
    made = bench()
    bus, left = made.world.bus, [lost]
    handle = bus.handle

    def lossy(unit: int, pdu: bytes, now_ns: int) -> Any:
        if pdu != CYCLIC_READ or left[0] == 0:
            return handle(unit, pdu, now_ns)
        left[0] -= 1
        return None, UNDISTURBED._replace(lost=True)

    bus.handle = lossy
    if lost == 5:
        assert "no response to the cyclic request, although each drive" in refusal(made)
    else:
        made.driver.open()


def test_a_busy_drive_is_asked_again() -> None:
    # Each write that went to its EEPROM keeps it busy: there is one, before the switch is off.
    made = bench(bus={"configure": True}, **quirks(busy_after_write_s=0.03, registers={"mode": 0}))
    made.driver.open()
    assert made.number(1, "mode") == 2


def test_watchdogs_are_fed_while_other_buses_are_enabling() -> None:
    for more in ({}, FAST_RTU):
        made = bench(**more)  # type: ignore[arg-type]
        made.enable()
        responses = []
        for _ in range(1000):
            responses.append(made.driver.enable_step())
            made.clock.sleep_until(made.clock.now_ns() + made.bus.period_ns)
        assert made.commanded(0) == 0.0
        assert made.world.bus.drives[1].on  # it heard us in every 0.1 s
        assert responses.count(True) > 900
        assert not any(one is two is False for one, two in pairwise(responses))
        assert made.world.axes[0].physics.x == 0.0


def test_many_slow_drives_on_one_line_are_all_enabled() -> None:
    axes = [spec(unit) for unit in range(1, 6)]
    made = bench(*axes, profile="cia402", rate_hz=4.0, link="rtu", baud=115_200)
    made.driver.open()
    for _ in range(400):
        if made.driver.enable_step():
            break
        made.clock.sleep_until(made.clock.now_ns() + 17_000_000)
    assert all(made.world.bus.drives[unit].on for unit in range(1, 6))
    made.driver.close()
    assert not any(made.world.bus.drives[unit].on for unit in range(1, 6))


def test_drives_that_were_disabled_can_be_enabled_again() -> None:
    made = bench()
    made.enable()
    made.run(5, 0.5)
    made.driver.disable()
    assert not made.world.bus.drives[1].on
    for _ in range(100):
        if made.driver.enable_step():
            break
        made.clock.sleep_until(made.clock.now_ns() + made.bus.period_ns)
    made.run(5, 0.5)
    assert made.commanded(0) == 500.0
    made.driver.close()


def test_a_drive_that_goes_into_fault_while_it_comes_on_is_reported_with_its_code() -> None:
    made = bench(**quirks(enable_s=0.5))
    made.driver.open()

    def enable() -> None:
        for number in range(200):
            if number == 100:
                made.world.bus.drives[1].machine.fail(6)
            made.driver.enable_step()
            made.clock.sleep_until(made.clock.now_ns() + made.bus.period_ns)

    with pytest.raises(DeviceFault, match=r"into fault instead .*: overloaded .* \(code 0x6\)"):
        enable()
    made.driver.close()
