"""What a right rig file becomes."""

from __future__ import annotations

from pathlib import Path

import pytest
from pydantic import ValidationError

from tautwave.config import (
    MinimumJerk,
    Recording,
    Rig,
    bus_spec,
    load_rig,
    parse_rig,
    simulation_of,
)
from tautwave.contracts import AxisSpec, BusSpec
from tautwave.errors import ConfigError
from tests.config.bench import BENCH, problems


def test_numbers_follow() -> None:
    rig = parse_rig(BENCH)
    assert rig.period_s == 0.001
    assert rig.period_ns == 1_000_000
    assert rig.cycles == 10_000
    assert rig.delay_samples == 20
    assert list(rig.axes) == ["master.wrist", "slave.wrist"]
    assert rig.axes["slave.wrist"] is rig.slave.axes["wrist"]


def test_source_is_known_but_no_key(tmp_path: Path) -> None:
    path = tmp_path / "rig.yaml"
    path.write_text(BENCH)
    rig = load_rig(str(path))
    assert rig.source == path
    assert "source" not in rig.model_dump()
    assert rig == parse_rig(BENCH)
    assert problems(BENCH + "source: elsewhere\n")


def test_utf8_with_byte_order_mark(tmp_path: Path) -> None:
    path = tmp_path / "rig.yaml"
    path.write_bytes(b"\xef\xbb\xbf" + BENCH.replace("name: bench", "name: bänch").encode())
    assert load_rig(path).name == "bänch"


def test_rig_does_not_change() -> None:
    rig = parse_rig(BENCH)
    with pytest.raises(ValidationError):
        rig.rate_hz = 500.0  # type: ignore[misc]


def test_damping_as_a_number() -> None:
    damping = parse_rig(BENCH).slave.axes["wrist"].damping
    assert damping.value == damping.lower == 0.002
    assert damping.source == "given"


def test_whole_numbers_are_numbers() -> None:
    rig = parse_rig(BENCH)
    assert isinstance(rig.rate_hz, float)
    reference = rig.simulation.hand["wrist"].reference  # type: ignore[union-attr]
    assert isinstance(reference, MinimumJerk)
    assert reference.waypoints == ((0.0, 0.0), (1.0, 0.3))


def test_force_scale_keeps_power_unless_given() -> None:
    assert parse_rig(BENCH).coupling.pairs["wrist"].effective_force_scale == 1.0
    scaled = parse_rig(BENCH, overrides=["coupling.pairs.wrist.position_scale=4"])
    assert scaled.coupling.pairs["wrist"].effective_force_scale == 0.25
    given = parse_rig(
        BENCH,
        overrides=["coupling.pairs.wrist.position_scale=4", "coupling.pairs.wrist.force_scale=3"],
    )
    assert given.coupling.pairs["wrist"].effective_force_scale == 3.0


def test_rotary_master_with_linear_slave() -> None:
    text = BENCH.replace(
        "id: 1\n      kind: rotary\n      inertia: {value: 1.5e-3, lower: 1.0e-3, "
        "source: identified}\n      damping: 2.0e-3",
        "id: 1\n      kind: linear\n      inertia: {value: 1.5e-3, lower: 1.0e-3, "
        "source: identified}\n      damping: 2.0e-3",
    )
    assert "position_scale: required key is missing" in problems(text)[0]
    parse_rig(text, overrides=["coupling.pairs.wrist.position_scale=0.1"])


def test_driver_options_are_filled_in() -> None:
    rig = parse_rig(BENCH)
    assert rig.buses["hand"].options == {"command_delay_s": 0.0}
    assert rig.buses["arm"].options == {"command_delay_s": 0.001}


def test_third_party_options_keep_their_shape() -> None:
    text = BENCH.replace(
        "arm: {driver: loopback, options: {command_delay_s: 0.001}}",
        "arm: {driver: acme, options: {port: /dev/ttyUSB0, gains: [3, 4]}}",
    ).replace(
        "damping: 2.0e-3",
        "damping: 2.0e-3\n      effort_rate_limit: 10\n      velocity_limit: 3\n"
        "      position_range: [-1, 1]",
    )
    assert parse_rig(text).buses["arm"].options == {
        "port": "/dev/ttyUSB0",
        "baud": 115200,
        "gains": [3.0, 4.0],
        "watchdog": {"timeout_s": 0.05},
    }


def test_options_that_want_to_be_open_are() -> None:
    rig = parse_rig(BENCH, overrides=["buses.arm={driver: open, options: {any: [1, {x: y}]}}"])
    assert rig.buses["arm"].options == {"any": [1, {"x": "y"}]}


def test_truth_is_belief_unless_given() -> None:
    rig = parse_rig(BENCH)
    master, slave = simulation_of(rig, "master.wrist"), simulation_of(rig, "slave.wrist")
    assert master.inertia == 1.584e-3
    assert master.damping == 3.0e-3
    assert master.encoder_quantum == 2.0e-5
    assert master.command_delay_s == 0.0
    assert slave.inertia == 1.5e-3
    assert slave.coulomb == 0.0
    assert slave.effort_limit == 1.1
    assert slave.command_delay_s == 0.001
    assert slave.start_position == 0.0
    assert slave.velocity_time_constant_s == 0.002


def test_loaded_rig_says_the_whole_truth() -> None:
    simulation = parse_rig(BENCH).simulation
    assert simulation is not None
    assert simulation.axes["slave.wrist"].inertia == 1.5e-3
    assert simulation.axes["slave.wrist"].velocity_time_constant_s is None


def test_truth_of_an_unknown_axis() -> None:
    with pytest.raises(KeyError):
        simulation_of(parse_rig(BENCH), "master.elbow")


def test_a_bus_knows_its_axes_in_the_order_of_the_file() -> None:
    rig = parse_rig(BENCH)
    axis = AxisSpec("slave.wrist", 1, "rotary", "impedance", 1.1)
    assert bus_spec(rig, "arm") == BusSpec("arm", (axis,), rig.rate_hz)


def test_empty_simulation_is_enough() -> None:
    rig = parse_rig(BENCH[: BENCH.index("simulation:")] + "simulation: {}\n")
    assert simulation_of(rig, "master.wrist").inertia == 1.5e-3


def test_models_validate_python_values_too() -> None:
    rig = parse_rig(BENCH)
    assert Rig.model_validate(rig.model_dump()) == rig


RECORDING = "{type: recording, file: hand.csv, column: hand_reference}"
CSV = "time_s,hand_reference\n0.0,0.0\n0.001,0.1\n"


def test_recording_lies_beside_the_rig_file(tmp_path: Path) -> None:
    (tmp_path / "hand.csv").write_text(CSV)
    path = tmp_path / "rig.yaml"
    path.write_text(BENCH.replace("{type: minimum_jerk, waypoints: [[0, 0], [1, 0.3]]}", RECORDING))
    rig = load_rig(path)
    reference = rig.simulation.hand["wrist"].reference  # type: ignore[union-attr]
    assert isinstance(reference, Recording)
    assert reference.file == str(tmp_path / "hand.csv")
    assert reference.time_column == "time_s"


def test_recording_given_in_the_shell_starts_at_the_current_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "hand.csv").write_text(CSV)
    monkeypatch.chdir(tmp_path)
    override = f"simulation.hand.wrist.reference={RECORDING}"
    rig = parse_rig(BENCH, "elsewhere/rig.yaml", [override])
    reference = rig.simulation.hand["wrist"].reference  # type: ignore[union-attr]
    assert isinstance(reference, Recording)
    assert reference.file == str(tmp_path / "hand.csv")


def test_a_place_where_a_recording_is_not_is_named_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    override = f"simulation.hand.wrist.reference={RECORDING}"
    with pytest.raises(ValueError, match="no such file") as caught:
        parse_rig(BENCH, tmp_path / "rig.yaml", [override])
    assert f"(tried {tmp_path}/hand.csv);" in str(caught.value)


def test_missing_recording_says_where_it_looked_and_what_to_give(tmp_path: Path) -> None:
    path = tmp_path / "rig.yaml"
    text = BENCH.replace("{type: minimum_jerk, waypoints: [[0, 0], [1, 0.3]]}", RECORDING)
    with pytest.raises(ValueError, match="no such file") as caught:
        parse_rig(text, path)
    assert str(caught.value) == (
        f"{path}:38: simulation.hand.wrist.reference.file: no such file (tried "
        f"{tmp_path}/hand.csv); give another with "
        "--set simulation.hand.wrist.reference.file=PATH"
    )


def test_recording_without_the_time(tmp_path: Path) -> None:
    (tmp_path / "hand.csv").write_text(CSV.replace("time_s", "t"))
    text = BENCH.replace("{type: minimum_jerk, waypoints: [[0, 0], [1, 0.3]]}", RECORDING)
    with pytest.raises(ValueError, match=r"hand\.csv has no column 'time_s'"):
        parse_rig(text, tmp_path / "rig.yaml")


@pytest.mark.parametrize(("count", "ends"), [(12, "c10, c11"), (13, "c10, c11, ...")])
def test_a_recording_without_the_column_names_a_dozen_of_its_own(
    tmp_path: Path, count: int, ends: str
) -> None:
    (tmp_path / "hand.csv").write_text(",".join(f"c{n}" for n in range(count)) + "\n")
    text = BENCH.replace("{type: minimum_jerk, waypoints: [[0, 0], [1, 0.3]]}", RECORDING)
    with pytest.raises(ConfigError) as caught:
        parse_rig(text, tmp_path / "rig.yaml")
    assert all(
        problem.endswith(f"It has: c0, c1, c2, c3, c4, c5, c6, c7, c8, c9, {ends}")
        for problem in caught.value.problems
    )


def test_recording_that_is_no_text(tmp_path: Path) -> None:
    (tmp_path / "hand.csv").write_bytes(b"\xff\xfe\x00\x81")
    text = BENCH.replace("{type: minimum_jerk, waypoints: [[0, 0], [1, 0.3]]}", RECORDING)
    with pytest.raises(ValueError, match="cannot be read as CSV text"):
        parse_rig(text, tmp_path / "rig.yaml")
