"""Bus time: the table of what RTU lines carry, TCP, and what would fit where it does not."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml
from pydantic import ValidationError

from tautwave.contracts import READ_SHARE, BusSpec
from tautwave_drivers.modbus.budget import (
    both_exchange,
    budget,
    read_exchange,
    write_exchange,
)
from tautwave_drivers.modbus.options import ModbusOptions
from tests.drivers.modbus.parts import device, options_of, queued, spec

# Modbus RTU, 11 bits a character, FC 23 that writes 4 and reads 6 words (21 + 17 characters), and
# FC 16 + FC 3 for the same; gaps of 3.5 characters, 1.75 ms above 19200 baud. Rates [Hz] of one
# axis: fixed gap, gap scaled, FC 16 + FC 3 with the fixed gap.
TABLE = {9_600: (19, 19, 14), 19_200: (39, 39, 27), 57_600: (93, 116, 60), 115_200: (140, 233, 85)}


@pytest.mark.parametrize("baud", TABLE)
def test_what_a_serial_line_carries(baud: int) -> None:
    char = 11 / baud
    scaled = 3.5 * char
    fixed = scaled if baud <= 19_200 else 1.75e-3
    both = both_exchange(6, 4)
    assert (both.sent, both.answered) == (21, 17)
    one, narrow, two = TABLE[baud]
    assert round(1.0 / both.time_s(char, fixed, 0.0)) == pytest.approx(one, abs=0.5)
    assert round(1.0 / both.time_s(char, scaled, 0.0)) == pytest.approx(narrow, abs=0.5)
    pair = (write_exchange(4), read_exchange(6))
    assert sum(part.sent + part.answered for part in pair) == 50
    spent = sum(part.time_s(char, fixed, 0.0) for part in pair)
    assert round(1.0 / spent) == pytest.approx(two, abs=1)
    for count, rate in ((2, one / 2), (6, one / 6)):
        assert 1.0 / (count * both.time_s(char, fixed, 0.0)) == pytest.approx(rate, rel=0.05)


def made(axes: int, rate_hz: float, divisor: int = 1, **more: Any) -> Any:
    specs = [spec(unit) for unit in range(1, axes + 1)]
    block = options_of(specs, more.pop("profile", "generic"), **more)
    bus = BusSpec("arm", tuple(specs), rate_hz, divisor=divisor)
    return budget(ModbusOptions.model_validate(block), bus)


RTU: dict[str, Any] = {"link": "rtu", "baud": 115_200, "stop_bits": 2}


def test_one_drive_over_rtu() -> None:
    found = made(1, 50.0, **RTU)
    # FC 23: 15 characters out (one word), 13 back (four words); answers by the loop's share.
    spent = 28 * 11 / 115_200 + 1.75e-3
    assert found.time_s == pytest.approx(max(spent / READ_SHARE, spent + 1.75e-3))
    assert found.greatest_rate_hz == pytest.approx(1.0 / found.time_s)
    assert "28 characters x 11 bits" in found.arithmetic
    assert found.arithmetic.endswith(
        f"have to be in by 80% of a period of the bus: {1e3 * found.time_s:.3f} ms"
    )
    assert "function code 23" not in found.remedy  # it has it


def test_a_line_that_is_too_slow_says_what_would_fit() -> None:
    found = made(2, 200.0, **(RTU | {"baud": 19_200}), profile="dsy-rs")
    assert found.time_s > 1 / 200.0
    for remedy in ("baud: 115200", "one drive fewer", "function code 23", "divisor: "):
        assert remedy in found.remedy
        assert remedy not in found.arithmetic  # `check` shows both
    fast = made(1, 500.0, **RTU)
    assert "gap_s" in fast.remedy


def test_every_remedy_is_named_that_helps_and_no_other() -> None:
    """Two drives at 19200 baud: 100 characters x 11 bits and 8 silences, by 80 % of a period."""
    alone = "more axes or a higher rate, each alone: "
    two = made(2, 200.0, **(RTU | {"baud": 19_200}), profile="dsy-rs")
    assert two.remedy == alone + (
        "baud: 115200 gives 37 Hz, baud: 1000000 gives 60 Hz, one drive fewer on this line gives "
        "23 Hz, drives that accept function code 23 give 16 Hz, divisor: 18 on this bus (11.1 Hz) "
        "fits without other changes"
    )
    # 28 characters and 2 silences; where 0.2 of a period is less than a silence, that counts.
    one = made(1, 500.0, **(RTU | {"turnaround_s": 1e-3}))
    assert one.remedy == alone + (
        "baud: 1000000 gives 208 Hz, gap_s: 0.000334 (3.5 characters, if the drives take it) gives "
        "200 Hz, drives without turnaround give 162 Hz, divisor: 4 on this bus (125 Hz) fits "
        "without other changes"
    )


def test_over_tcp_every_remedy_is_named_that_helps_and_no_other() -> None:
    alone = "more axes or a higher rate, each alone: "
    own = [device(unit, endpoint=f"tcp://10.0.0.{unit}:502") for unit in (1, 2, 3)]
    apart = made(3, 50.0, turnaround_s=0.003, devices=own)
    assert apart.remedy == alone + "drives without turnaround give 5333 Hz"  # 0.8 / 0.15 ms
    behind_one = made(3, 50.0, turnaround_s=0.003)
    assert behind_one.remedy == alone + (
        "outstanding: 3 in the profile, if the server takes that many requests at once, gives "
        "254 Hz, drives without turnaround give 1778 Hz"
    )
    assert made(1, 50.0, turnaround_s=0.0).remedy == ""


def test_the_divisor_it_names_fits_and_the_one_before_does_not() -> None:
    for profile, axes in (("dsy-rs", 1), ("dsy-rs", 2), ("cia402", 1), ("generic", 3)):
        found = made(axes, 1000.0, **RTU, profile=profile)
        nth = int(found.remedy.split("divisor: ")[1].split()[0])
        for divisor, fits in ((nth, True), (nth - 1, False)):
            cost = made(axes, 1000.0 / divisor, divisor, **RTU, profile=profile)
            assert (cost.time_s <= divisor / 1000.0) == fits, (profile, divisor)
        assert found.greatest_rate_hz <= 1000.0 / (nth - 1)


@pytest.mark.parametrize("key", ["turnaround_s", "gap_s", "late_s", "comm_timeout_s"])
def test_a_time_that_nobody_waits_is_refused(key: str) -> None:
    """1e30 s once kept the search for a divisor going for ever."""
    with pytest.raises(ValidationError, match=key):
        made(1, 50.0, **(RTU | {key: 1e30}))


def test_the_slowest_drive_there_may_be_has_its_divisor_at_once() -> None:
    found = made(1, 10_000.0, turnaround_s=10.0)
    nth = int(found.remedy.split("divisor: ")[1].split()[0])
    assert 100_000 < nth < 101_000


def test_over_tcp_drives_behind_one_connection_are_polled_in_turn() -> None:
    one = made(1, 50.0, turnaround_s=0.003)
    three = made(3, 50.0, turnaround_s=0.003)
    assert one.time_s == pytest.approx(0.00315 / READ_SHARE)
    assert three.time_s == pytest.approx(3 * 0.00315 / READ_SHARE)
    cia402 = made(1, 50.0, turnaround_s=0.003, profile="cia402")
    assert cia402.time_s == pytest.approx(3 * 0.00315 / READ_SHARE)
    assert "assumed" in made(1, 50.0, turnaround_s=None).arithmetic
    assert "TCP: 1 drive (FC 23), 1 exchange, " in one.arithmetic
    assert (
        "TCP: 3 drives in turn, 1 request outstanding per connection (outstanding in the profile) "
        "(FC 23), 3 exchanges one after the other, " in three.arithmetic
    )
    assert "outstanding: 3 in the profile" in three.remedy
    assert f"gives {1 / one.time_s:.0f} Hz" in three.remedy


def test_over_tcp_connections_are_polled_in_parallel() -> None:
    own = [device(unit, endpoint=f"tcp://10.0.0.{unit}:502") for unit in (1, 2, 3)]
    apart = made(3, 50.0, turnaround_s=0.003, devices=own)
    assert apart.time_s == pytest.approx(0.00315 / READ_SHARE)
    assert "TCP: 3 drives in parallel (FC 23), 1 exchange, " in apart.arithmetic
    own[2]["endpoint"] = own[1]["endpoint"]
    assert made(3, 50.0, turnaround_s=0.003, devices=own).time_s == pytest.approx(
        2 * 0.00315 / READ_SHARE
    )


@pytest.mark.parametrize(("outstanding", "rounds"), [(1, 5), (2, 3), (4, 2), (5, 1), (9, 1)])
def test_the_profile_says_how_many_a_server_takes(
    tmp_path: Path, outstanding: int, rounds: int
) -> None:
    found = made(5, 10.0, turnaround_s=0.003, devices=queued(tmp_path, outstanding, 5))
    assert found.time_s == pytest.approx(rounds * 0.00315 / READ_SHARE)


def test_a_rig_over_budget_exits_4(tmp_path: Any, capsys: pytest.CaptureFixture[str]) -> None:
    from tautwave.cli import main

    source = Path(__file__).parents[3] / "configs" / "bench-modbus-rtu-sim.yaml"
    data = yaml.safe_load(source.read_text(encoding="utf-8"))
    data["buses"]["arm"]["divisor"] = 5
    path = tmp_path / "rig.yaml"
    path.write_text(yaml.safe_dump(data, sort_keys=False), encoding="utf-8")
    with pytest.raises(SystemExit) as ended:
        main(["check", str(path)])
    assert ended.value.code == 4
    assert "divisor: " in capsys.readouterr().out
