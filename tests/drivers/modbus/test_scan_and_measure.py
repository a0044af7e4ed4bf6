"""`tautwave scan modbus` over drives that are served, and what an exchange costs the host."""

from __future__ import annotations

import pytest

from tautwave.errors import ConfigError, DriverError
from tautwave_drivers.modbus.measure import measure
from tautwave_drivers.modbus.scan import ScanOptions, scan, units_of
from tests.sim.modbus.served import beside, served

pytestmark = pytest.mark.realtime


def test_scan_over_tcp_tells_unit_profile_and_state() -> None:
    with served("--tcp", "127.0.0.1:0", "--units", "3,7") as drives:
        nowhere = "tcp://127.0.0.1:1"
        rows = scan(ScanOptions(endpoint=[drives["endpoint"], nowhere], units="1-8"))
    failed = rows.pop()
    assert (failed["endpoint"], failed["unit"]) == (nowhere, None)
    assert failed["fault"].startswith("connection refused")
    assert [(row["unit"], row["profile"], row["state"]) for row in rows] == [
        (3, "generic", "off (0x1)"),
        (7, "generic", "off (0x1)"),
    ]
    assert rows[0]["endpoint"] == drives["endpoint"]
    assert rows[0]["position_counts"] == 0


def test_scan_tells_which_fault_a_drive_has() -> None:
    devices = {"unit": 1}, {"unit": 2, "profile": "cia402"}, {"unit": 3}
    ill = {unit: {"starts_in_fault": True} for unit in (1, 2)}
    with beside(*devices, devices=ill) as port:
        rows = scan(ScanOptions(endpoint=[f"tcp://127.0.0.1:{port}"], units="1-3"))
    found = {row["unit"]: (row["profile"], row["state"], row.get("fault")) for row in rows}
    assert found[1] == ("generic", "fault", "too much current")
    assert found[2][0] == "cia402"
    assert found[2][1].startswith("FAULT (0x")
    assert found[2][2] == "0x2310: continuous overcurrent on the motor side"
    assert found[3] == ("generic", "off (0x1)", None)


@pytest.mark.slow
@pytest.mark.parametrize(("profile", "state"), [("dsy-rs", "off (0x0)"), ("cia402", "SWITCH ON")])
def test_scan_of_a_serial_line(profile: str, state: str) -> None:
    with served("--rtu", "--units", "2", "--profile", profile) as drives:
        asked = ScanOptions(endpoint=[drives["endpoint"]], units="1,2", timeout_s=0.3)
        rows = next((rows for _ in range(5) if (rows := scan(asked))), [])  # a busy machine
    assert [(row["unit"], row["profile"]) for row in rows] == [(2, profile)]
    assert str(rows[0]["state"]).startswith(state)


def test_units_are_ranges_and_lists() -> None:
    assert units_of("1-3,9", serial=True) == [1, 2, 3, 9]
    assert len(units_of("", serial=True)) == 247
    for wrong in ("a", "0", "5-", "240-250", ",", "9-1", "²", "1-99999999999999"):
        with pytest.raises(ConfigError, match=r"--units"):
            units_of(wrong, serial=True)


def test_a_host_that_is_not_there_is_a_sentence() -> None:
    with pytest.raises(DriverError, match=r"refused"):
        scan(ScanOptions(endpoint=["tcp://127.0.0.1:1"]))


def test_a_host_without_its_scheme_is_refused_with_the_right_form() -> None:
    with pytest.raises(ConfigError, match=r"write tcp://10\.0\.0\.7:502"):
        scan(ScanOptions(endpoint=["10.0.0.7:502"]))


@pytest.mark.slow
def test_our_exchange_and_the_synchronous_client_s_stand_beside_the_bare_bytes() -> None:
    costs = measure(20)
    assert [cost.goal_ratio for cost in costs] == [2.0, None, 1.5, None]
    for cost in costs:
        assert len(cost.spent_us) == len(cost.floor_us) == 20
        assert max(cost.spent_us) < 150_000  # answered, not timed out
