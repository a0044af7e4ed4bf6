"""A rig over simulated Modbus gives the rows of a loopback rig with the bus's steps and delay."""

from __future__ import annotations

import json
import subprocess
import sys
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from tautwave.certificate import certify
from tautwave.config import load_rig
from tautwave.errors import DriverError
from tautwave.registry import load_driver
from tautwave.rig import Assembly
from tautwave.session.checking import bus_budgets, over_budget
from tautwave_drivers.modbus.driver import ModbusDriver
from tests.commands import assert_ran_to_its_end, patient
from tests.rigs.running import Run, Tree, books, rig_of, run_rig

CONFIGS = Path(__file__).parents[2] / "configs"
TCP = CONFIGS / "bench-modbus-tcp-sim.yaml"
RTU = CONFIGS / "bench-modbus-rtu-sim.yaml"
THREE = CONFIGS / "three-bus-sim.yaml"
DURATION_S = 4.0


def tree_of(path: Path, **options: Any) -> Tree:
    data: Tree = yaml.safe_load(path.read_text(encoding="utf-8"))
    data["simulation"]["axes"]["slave.lever"]["position_noise"] = 1e-4
    data["buses"]["arm"]["options"].update(options)
    return data


def one_rate_tree(profile: str, **device: Any) -> Tree:
    """Both levers on one TCP bus at 100 Hz, as the whole rig's rate."""
    data = tree_of(TCP)
    arm = data["buses"]["arm"]
    del arm["divisor"]
    data["rate_hz"] = 100
    one = {"profile": profile, "rated_torque": 1.0, "gear_ratio": 2.0, **device}
    arm["options"]["turnaround_s"] = 0.0005  # behind one connection they are asked in turn
    arm["options"]["devices"] = [{"unit": 1, **one}, {"unit": 2, "direction": -1, **one}]
    del data["buses"]["hand"]
    for side, unit in (("master", 1), ("slave", 2)):
        axis = data[side]["axes"]["lever"]
        axis |= {"bus": "arm", "id": unit, "effort_limit": 1.0, "effort_rate_limit": 200}
        axis.pop("encoder_quantum", None)
        axis["inertia"] = {"value": 4.0e-3, "lower": 3.0e-3, "source": "test"}
    data["coupling"] |= {"delay_s": 0.02}
    data["coupling"]["pairs"]["lever"]["wave_filter_hz"] = 10
    del data["coupling"]["pairs"]["lever"]["wall_slave"]
    return data


def admittance_tree() -> Tree:
    data = tree_of(TCP)
    data["require"] = "coupled_stable"
    slave = data["slave"]["axes"]["lever"]
    for key in ("inertia", "damping", "stall_energy_j"):
        del slave[key]
    slave |= {"causality": "admittance", "environment_stiffness_upper": 0.5, "velocity_limit": 10}
    pair = data["coupling"]["pairs"]["lever"]
    pair["wave_impedance"] = 0.03
    del pair["wall_slave"]
    data["simulation"]["axes"]["slave.lever"] = {"velocity_time_constant_s": 0.005}
    data["simulation"]["environment"]["lever"] = {"type": "spring", "stiffness": 0.4, "position": 0}
    return data


def loopback_tree(data: Tree, *, steps: bool = True) -> Tree:
    """Return the same rig on loopback buses, with the quanta and the command delay of Modbus."""
    rig = rig_of(data)
    out: Tree = deepcopy(data)
    bus = rig.buses["arm"]
    load_driver("modbus").options.model_validate(bus.options)
    period = bus.divisor / rig.rate_hz
    out["buses"]["arm"] = {
        "driver": "loopback",
        "divisor": bus.divisor,
        "options": {"command_delay_s": period},
    }
    for side in ("master", "slave"):
        axis = rig.axes[f"{side}.lever"]
        if axis.bus != "arm":
            continue
        for key in ("encoder_quantum", "effort_quantum", "velocity_quantum"):
            out[side]["axes"]["lever"][key] = getattr(axis, key) if steps else 0.0
    return out


def compare(one: Run, other: Run) -> list[str]:
    shared = [name for name in one.columns if not name.endswith(".answer_us")]
    assert shared == list(other.columns)
    return [
        name
        for name in shared
        if name not in ("lateness_us", "compute_us")
        and not np.array_equal(one[name], other[name], equal_nan=True)
    ]


def allow_unwatched(built: Assembly) -> None:
    """As --allow-unwatched does it."""
    for bus in built.buses:
        if isinstance(bus.driver, ModbusDriver):
            bus.driver._bus = bus.driver._bus._replace(allow_unwatched=True)


def one_line_tree() -> Tree:
    """Both levers on one RTU line at 20 Hz: the second drive is asked after the first."""
    data = one_rate_tree("generic")
    data["rate_hz"] = 20
    data["buses"]["arm"]["options"] |= {"link": "rtu", "baud": 115200, "comm_timeout_s": 0.5}
    data["coupling"] |= {"delay_s": 0.05}
    data["coupling"]["pairs"]["lever"]["wave_filter_hz"] = 2
    for side in ("master", "slave"):
        data[side]["axes"]["lever"]["inertia"] = {"value": 0.03, "lower": 0.02, "source": "test"}
        data[side]["axes"]["lever"]["damping"] = {"value": 0.1, "lower": 0.08, "source": "test"}
        data["simulation"]["axes"][f"{side}.lever"] |= {"inertia": 0.03, "damping": 0.1}
    return data


TREES = {
    "tcp, divisor 10": tree_of(TCP),
    "rtu, divisor 20": tree_of(RTU),
    "rtu, FC 23, divisor 10": tree_of(
        RTU, devices=[{"unit": 1, "rated_torque": 0.64, "gear_ratio": 4.0}], late_s=0.005
    ),
    "admittance, divisor 10": admittance_tree(),
    "two drives at the rig's rate": one_rate_tree("generic"),
    "two CiA 402 drives": one_rate_tree("cia402", counts_per_revolution=20000),
    "two drives on one line": one_line_tree(),
    "two DSY-RS": one_rate_tree("dsy-rs", rated_torque=1.27),
}


@pytest.mark.sparse(12)
@pytest.mark.parametrize("name", TREES)
def test_rows_over_simulated_modbus_equal_those_of_loopback(name: str) -> None:
    data = TREES[name]
    over_modbus = run_rig(data, duration_s=DURATION_S, change=allow_unwatched)
    loopback = run_rig(loopback_tree(data), duration_s=DURATION_S)
    assert compare(over_modbus, loopback) == []
    assert np.ptp(over_modbus["true.slave.lever.position"]) > 0.1  # it did something


@pytest.mark.slow
@pytest.mark.parametrize("path", [TCP, RTU], ids=lambda path: path.stem)
def test_the_books_close_and_the_difference_to_ideal_drives_is_small(path: Path) -> None:
    data = tree_of(path)
    over_modbus = run_rig(data, duration_s=DURATION_S)
    closed = books(over_modbus, "lever")
    assert closed.residual < 1e-9 * closed.gross_flow
    assert closed.plant_residual < 1e-9 * closed.plant_flow
    ideal = run_rig(loopback_tree(data, steps=False), duration_s=DURATION_S)
    for name, limit in (("position", 5e-3), ("commanded", 5e-3)):
        for side in ("master", "slave"):
            gap = over_modbus[f"{side}.lever.{name}"] - ideal[f"{side}.lever.{name}"]
            assert 0.0 < float(np.sqrt(np.mean(gap**2))) < limit


@pytest.mark.parametrize("path", [TCP, RTU], ids=lambda path: path.stem)
def test_the_same_rig_gives_the_same_rows_twice(path: Path) -> None:
    one, other = (run_rig(tree_of(path), duration_s=1.0) for _ in range(2))
    assert np.array_equal(one.table, other.table, equal_nan=True)


@pytest.mark.slow
def test_contact_at_100_hz_under_a_1_khz_master_is_stable_and_its_price_is_stated() -> None:
    data: Tree = yaml.safe_load(TCP.read_text(encoding="utf-8"))
    run = run_rig(data)
    pressed = (run["time_s"] > 2.0) & (run["time_s"] < 3.0)
    depth = run["true.slave.lever.position"][pressed] - 0.15
    assert depth.min() > 0.0  # it stays in contact: no bouncing
    assert np.ptp(depth) < 2e-3
    closed = books(run, "lever")
    assert closed.residual < 1e-9 * closed.gross_flow
    found = certify(rig_of(data))
    assert found.passed
    reported = [line for line in _sentences(found.as_dict()) if "served every 10 cycles" in line]
    assert any("a rigid environment feels like" in line for line in reported)


@pytest.mark.sparse(3)
@pytest.mark.parametrize("profile", ["generic", "dsy-rs", "cia402"])
def test_the_fastest_divisor_of_the_budget_loses_nothing(profile: str) -> None:
    """Where bus time says that a line carries a rate, it does, looked at once a cycle."""
    data = tree_of(RTU)
    data["buses"]["arm"]["options"]["devices"] = [
        {"unit": 1, "profile": profile, "rated_torque": 1.27 if profile == "dsy-rs" else 1.0}
    ]
    data["slave"]["axes"]["lever"]["effort_limit"] = 1.0
    rig = rig_of(data)
    greatest = bus_budgets(rig)["arm"].greatest_rate_hz
    data["buses"]["arm"]["divisor"] = divisor = round(1000.0 / greatest)
    run = run_rig(data, duration_s=2.0, change=allow_unwatched)
    assert sum(run.result.lost) == 0
    data["buses"]["arm"]["divisor"] = divisor - 1
    assert over_budget(rig_of(data), bus_budgets(rig_of(data)))


@pytest.mark.slow
def test_three_buses_run_in_one_loop_and_their_books_close() -> None:
    run = run_rig(rig_of(yaml.safe_load(THREE.read_text(encoding="utf-8"))), duration_s=5.0)
    for pair in ("wrist", "grip"):
        closed = books(run, pair)
        assert closed.residual < 1e-9 * closed.gross_flow
        assert closed.plant_residual < 1e-9 * closed.plant_flow
        pressed = (run["time_s"] > 4.0) & (run["time_s"] < 4.5)
        if pair == "grip":
            assert run["true.slave.grip.position"][pressed].min() > 0.2  # in its wall
    assert sum(run.result.lost) == 0
    assert certify(load_rig(THREE)).passed


@pytest.mark.slow
@pytest.mark.nightly
@pytest.mark.realtime
@pytest.mark.parametrize("path", [TCP, RTU, THREE], ids=lambda path: path.stem)
def test_the_shipped_rigs_run_on_the_real_clock(path: Path, tmp_path: Path) -> None:
    """As a new user runs them, with the drives in processes of their own."""
    start = "from tautwave.cli import main; main()"
    out = tmp_path / "run"
    words = [sys.executable, "-c", start, "run", str(path), "--duration", "4", "--out", str(out)]
    rig = yaml.safe_load(path.read_text())
    words += patient(*rig["master"]["axes"], slots=1000 if path == THREE else 10000)
    late = {
        "canopen": ["heartbeat_timeout_ms=5000"],
        "dynamixel": ["watchdog_s=2.5"],
        "modbus": ["silence_s=5", "comm_timeout_s=5"],
    }
    for bus, block in rig["buses"].items():
        for option in late.get(block["driver"], []):
            words += ["--set", f"buses.{bus}.options.{option}"]
    done = subprocess.run(words, capture_output=True, text=True, timeout=100, check=False)
    reported = assert_ran_to_its_end(done.returncode, out, done.stdout + done.stderr)
    assert "measured" in json.dumps(reported) or path == RTU


def _sentences(value: Any) -> list[str]:
    if isinstance(value, str):
        return [value]
    parts = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    return [text for part in parts for text in _sentences(part)]


def test_lost_answers_stay_passive() -> None:
    """Random loss on the slow line: samples are missing, no energy appears."""
    data = tree_of(TCP, simulator={"faults": {"seed": 3, "answer_lost": 0.1, "request_lost": 0.1}})
    data["loop"]["missing_limit"] = 20
    run = run_rig(data, duration_s=DURATION_S)
    closed = books(run, "lever")
    assert closed.residual < 1e-9 * closed.gross_flow
    assert int(
        np.count_nonzero(run["slave.lever.lost"]) if "slave.lever.lost" in run.columns else 1
    )


@pytest.mark.parametrize("path", [TCP, RTU], ids=lambda path: path.stem)
def test_the_shipped_rigs_load_with_the_steps_of_their_drives(path: Path) -> None:
    rig = load_rig(path)
    axis = rig.axes["slave.lever"]
    gear = {TCP: 1.0, RTU: 4.0}[path]
    rated = {TCP: 1.0, RTU: 0.64}[path]
    assert axis.encoder_quantum == pytest.approx(2 * np.pi / (65536 * gear))
    assert axis.effort_quantum == pytest.approx(1e-3 * rated * gear)


def test_a_rig_file_gives_the_simulated_drives_their_quirks() -> None:
    quirks = {"devices": {1: {"registers": {"identity": 7}}}}
    with pytest.raises(DriverError, match="identity reads 0x7"):
        run_rig(tree_of(TCP, simulator=quirks), duration_s=0.1)
