"""Calibration: by hand and by a stop, the file it leaves, and what a rig makes of it."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Generator, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import yaml
from click.testing import CliRunner

from tautwave.analysis.identification.regression import Estimate
from tautwave.cli import main
from tautwave.config import load_rig, resolved_yaml
from tautwave.config.calibrated import digest
from tautwave.config.keys.calibration import AxisCalibration
from tautwave.errors import ConfigError, DriverError, RecordingError, SafetyStop
from tautwave.recordings.recording import read_recording
from tautwave.rig.calibrated import CalibratedDriver
from tautwave.runtime.unwatched import MayBeEnabledError
from tautwave.session.calibration import identify as identifying
from tautwave.session.calibration.by_hand import measure_by_hand
from tautwave.session.calibration.file import named_in
from tautwave.session.calibration.identify import Shaking, identify_axes
from tautwave.session.guided.answers import Scripted, read_answers
from tautwave.session.guided.running import Conversation, Ways
from tautwave.types import AxisCommand, CommandDelay, JointState

pytestmark = pytest.mark.realtime

BENCH = Path(__file__).parents[2] / "configs" / "bench-1dof-loopback.yaml"
WAY = "[[0, 0.2], [1, 0.2], [2, -0.1], [3, -0.3], [4, 0.3]]"
HAND = f"reference: {{type: minimum_jerk, waypoints: {WAY}}}"
ANSWERS = "0.3\n2\n2\n"
"""Zero at 0.2; to -0.1 and beyond is positive; then both ends."""


def written(folder: Path, answers: str = ANSWERS) -> Path:
    """Write the bench with another hand, and answers for it."""
    text = BENCH.read_text()
    start = text.index("      reference:\n")
    end = text.index("  environment:")
    rig = folder / "bench.yaml"
    lines = f"{text[:start]}      {HAND}\n{text[end:]}".splitlines()
    rig.write_text("\n".join(line for line in lines if "wall_" not in line) + "\n")
    (folder / "answers.txt").write_text(answers)
    return rig


def calibrate(rig: Path, *options: str) -> Any:
    words = ["calibrate", str(rig), "--axis", "master.lever", "--clock", "fake"]
    words += ["--script", str(rig.parent / "answers.txt"), "--out", str(rig.parent / "runs")]
    return CliRunner().invoke(main, [*words, *options])


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    rig = written(tmp_path_factory.mktemp("calibrated"))
    done = calibrate(rig)
    assert done.exit_code == 0, done.output
    return rig


def test_zero_direction_and_range_are_what_the_hand_showed(bench: Path) -> None:
    rig = load_rig(bench)
    assert rig.calibration is not None
    found = rig.calibration.axes["master.lever"]
    assert found.zero == pytest.approx(0.2, abs=2e-3)
    assert found.direction == -1
    low, high = rig.master.axes["lever"].position_range or (math.nan, math.nan)
    assert low == pytest.approx(-0.1, abs=0.02)  # the hand went to 0.3, which is -0.1 from zero
    assert high == pytest.approx(0.5, abs=0.02)
    assert rig.slave.axes["lever"].position_range != (low, high)


def test_the_hand_was_not_pushed_while_it_showed(bench: Path) -> None:
    rows = read_recording(bench.parent / "runs" / "by-hand" / "recording.mcap")
    assert not np.any(rows["master.lever.commanded"])
    assert set(np.unique(rows["guide.step"])) == {1.0, 2.0, 3.0}


@pytest.mark.nightly
@pytest.mark.slow
def test_a_run_counts_from_the_zero_and_its_rig_needs_no_file_any_more(
    bench: Path, tmp_path: Path
) -> None:
    words = [
        "run",
        str(bench),
        "--clock",
        "fake",
        "--duration",
        "0.2",
        "--out",
        str(tmp_path / "r"),
    ]
    done = CliRunner().invoke(main, words)
    assert done.exit_code == 0, done.output
    rows = read_recording(tmp_path / "r" / "recording.mcap")
    raw = rows["true.master.lever.position"]
    assert np.allclose(rows["master.lever.position"], -(raw - 0.2), atol=2e-3)
    kept = load_rig(tmp_path / "r" / "rig.yaml")
    assert kept.calibration == load_rig(bench).calibration
    assert kept.master == load_rig(bench).master


def test_a_calibration_that_was_changed_or_is_gone_is_refused(bench: Path, tmp_path: Path) -> None:
    file = bench.with_suffix(".calibration.yaml")
    moved = tmp_path / "bench.yaml"
    moved.write_text(bench.read_text())
    with pytest.raises(ConfigError, match=r"calibration\.file: .*no such file; run tautwave cal"):
        load_rig(moved)
    (tmp_path / file.name).write_text(file.read_text().replace("direction: -1", "direction: 1"))
    with pytest.raises(ConfigError, match="is not the file that this rig was calibrated with"):
        load_rig(moved)
    (tmp_path / file.name).write_text("axes:\n  slave.wrist: {zero: 1.0}\n")
    text = named_in(moved.read_text(), file.name, (tmp_path / file.name).read_text())
    moved.write_text(text)
    assert text.count("calibration:") == 1
    with pytest.raises(
        ConfigError, match=r"it lists axis slave\.wrist, which the " r"rig does not have"
    ):
        load_rig(moved)
    for wrong, said in (("axes: {a: [", r"yaml:1: .*; run"), ("a: 1\na: 2", "line 2: duplicate")):
        (tmp_path / file.name).write_text(wrong)
        moved.write_text(named_in(moved.read_text(), file.name, wrong))
        with pytest.raises(ConfigError, match=said):
            load_rig(moved)


REFUSED = {
    "no such file": None,
    "is not the file that this rig was calibrated with": "axes:\n  master.lever: {zero: 9.0}\n",
    "which the rig does not have": "axes:\n  slave.wrist: {zero: 1.0}\n",
    "yaml:1: ": "axes: {a: [",
    "has no `axes`": "a: 1\n",
}


@pytest.mark.parametrize("said", REFUSED)
def test_what_a_refused_calibration_asks_for_works(bench: Path, tmp_path: Path, said: str) -> None:
    """Each of its messages names `calibrate`, which leaves what is refused, and says so."""
    moved, text = tmp_path / "bench.yaml", REFUSED[said]
    moved.write_text(bench.read_text())
    (tmp_path / "answers.txt").write_text("0.5\n")
    if text is not None:
        file = moved.with_suffix(".calibration.yaml")
        file.write_text(text)
        if not said.startswith("is not the file"):
            moved.write_text(named_in(moved.read_text(), file.name, text))
    with pytest.raises(ConfigError, match="run tautwave calibrate") as refused:
        load_rig(moved)
    assert said in str(refused.value)
    done = calibrate(moved, "--steps", "zero")
    assert done.exit_code == 0, done.output
    assert "begins anew: " in done.output
    assert said in done.output
    again = load_rig(moved).calibration
    assert again is not None
    assert list(again.axes) == ["master.lever"]


def test_the_command_line_goes_before_a_calibration(bench: Path) -> None:
    rig = load_rig(bench, ["master.axes.lever.position_range=[-3, 3]"])
    assert rig.master.axes["lever"].position_range == (-3.0, 3.0)


@pytest.mark.slow
def test_a_range_stays_where_it_was_when_the_zero_moves(tmp_path: Path) -> None:
    rig = written(tmp_path, "0.3\n2\n2\n")
    assert calibrate(rig).exit_code == 0
    before = load_rig(rig).master.axes["lever"].position_range or (0.0, 0.0)
    (tmp_path / "answers.txt").write_text("2.3\n")  # where the hand is at -0.17
    done = calibrate(rig, "--steps", "zero", "--out", str(tmp_path / "again"))
    assert done.exit_code == 0, done.output
    after = load_rig(rig)
    assert after.calibration is not None
    shift = after.calibration.axes["master.lever"].zero - 0.2
    assert shift < -0.3
    ends = after.master.axes["lever"].position_range or (0.0, 0.0)
    assert ends == pytest.approx([end + shift for end in before], abs=3e-3)


@pytest.mark.slow
def test_a_stop_is_found_gently_and_friction_is_identified(tmp_path: Path) -> None:
    rig = written(tmp_path, "0.1\n0.1\n0.1\n0.1\n")
    text = rig.read_text()
    wall = "lever: {type: wall, position: 0.4, stiffness: 300, damping: 0.1}"
    start = text.index("  environment:")
    rig.write_text(text[:start] + f"  environment:\n    {wall}\n")
    words = ["calibrate", str(rig), "--axis", "slave.lever", "--clock", "fake", "--out"]
    words += [str(tmp_path / "runs"), "--script", str(tmp_path / "answers.txt")]
    steps = ["--steps", "identify", "--stop", "slave.lever=0.3", "--identify-s", "6"]
    done = CliRunner().invoke(main, [*words, *steps])
    assert done.exit_code == 0, done.output
    found = load_rig(rig)
    assert found.calibration is not None
    assert found.calibration.axes["slave.lever"].zero == pytest.approx(0.1, abs=0.01)
    axis = found.slave.axes["lever"]
    assert axis.inertia is not None
    assert axis.inertia.source == "identified"
    rows = read_recording(tmp_path / "runs" / "stops" / "recording.mcap")
    assert np.abs(rows["slave.lever.commanded"]).max() <= 0.2 * axis.effort_limit * 1.001
    assert np.abs(np.diff(rows["true.slave.lever.position"])).max() <= 0.2e-3


Answer = Callable[[str, float, int], Any]


class Shaken:
    """In place of devices: what each excitation of an axis finds, by share and number."""

    def __init__(self, answer: Answer) -> None:
        self.answer = answer
        self.tried: list[tuple[tuple[str, ...], float, float]] = []
        self.said: list[str] = []
        self.kept: list[str] = []

    def together(self, rig: Any, names: Sequence[str], **options: Any) -> dict[str, Any]:
        share = options["share"]
        self.tried.append((tuple(names), share, options["duration_s"]))
        found = {name: self.answer(name, share, len(self.tried)) for name in names}
        for each in found.values():
            if isinstance(each, DriverError | SafetyStop):
                raise each
        return found

    def identify(self, names: Sequence[str], tmp_path: Path) -> dict[str, str]:
        rig = SimpleNamespace(buses={}, axis_divisor=lambda name: 1)
        how = Shaking(4.0, tmp_path, Ways("fake"), None)
        talk = Conversation(Scripted([]), self.said.append, self.said.append)

        def keep(name: str, believed: Any) -> None:
            self.kept.append(name)

        return identify_axes(rig, names, talk, how, keep)  # type: ignore[arg-type]


def fitted(damping: float = 1e-4) -> Any:
    one = Estimate(1e-3, damping, 2e-3)
    return SimpleNamespace(
        fit=SimpleNamespace(inertia=one, damping=one, coulomb=one, explained=0.99)
    )


@pytest.fixture
def shaken(monkeypatch: pytest.MonkeyPatch) -> Callable[[Answer], Shaken]:
    def make(answer: Answer) -> Shaken:
        found = Shaken(answer)
        monkeypatch.setattr(identifying, "identify_together", found.together)
        return found

    return make


@pytest.mark.parametrize(
    ("moves_at", "damped_at", "shares"),
    [(0.3, 0.3, 1), (0.3, 0.6, 2), (1.0, 0.3, 3), (2.0, 0.3, 3)],
)
def test_an_axis_is_shaken_harder_and_longer_where_friction_holds_or_hides_it(
    moves_at: float, damped_at: float, shares: int, tmp_path: Path,
    shaken: Callable[[Answer], Shaken],
) -> None:  # fmt: skip
    def answer(name: str, share: float, number: int) -> Any:
        if share < moves_at:
            error = RecordingError("free it")
            error.__cause__ = ValueError("it hardly moved")
            return error
        return fitted(1e-4 if share >= damped_at else -1e-4)

    found = shaken(answer)
    failed = found.identify(["slave.a"], tmp_path)
    if moves_at <= 1.0:
        assert (found.kept, failed) == (["slave.a"], {})
    else:
        assert found.kept == []
        assert failed["slave.a"].endswith("or raise effort_limit: it hardly moved")
    assert found.tried == [
        (("slave.a",), share, seconds)
        for share, seconds in [(0.3, 4.0), (0.6, 8.0), (1.0, 16.0)][:shares]
    ]


NAMES = ["master.a", "master.b", "slave.a", "slave.b"]


def test_a_master_is_shaken_together_with_its_slave(
    tmp_path: Path, shaken: Callable[[Answer], Shaken]
) -> None:
    found = shaken(lambda name, share, number: fitted())
    assert found.identify(NAMES, tmp_path) == {}
    assert [names for names, _, _ in found.tried] == [
        ("master.a", "slave.a"), ("master.b", "slave.b"),
    ]  # fmt: skip
    assert sorted(found.kept) == NAMES


@pytest.mark.parametrize("gaps", [1, 2, 3, 99])
@pytest.mark.parametrize("kind", [DriverError, SafetyStop])
def test_a_gap_is_tried_again_then_alone_and_the_others_go_on(
    tmp_path: Path, gaps: int, kind: type[Exception], shaken: Callable[[Answer], Shaken]
) -> None:
    """`gaps` of 20 ms in the samples of one joint of four, in as many excitations of it."""
    left = [gaps]

    def answer(name: str, share: float, number: int) -> Any:
        if name == "slave.a" and left[0] > 0:
            left[0] -= 1
            return kind("slave.a: no sample for 20 ms")
        return fitted()

    found = shaken(answer)
    failed = found.identify(NAMES, tmp_path)
    assert list(failed) == (["slave.a"] if gaps == 99 else [])
    assert sorted(found.kept) == [name for name in NAMES if name not in failed]
    assert len(found.tried) < 10
    assert any("no sample for 20 ms; trying again" in line for line in found.said)


def test_a_device_that_may_be_on_ends_it_at_once(
    tmp_path: Path, shaken: Callable[[Answer], Shaken]
) -> None:
    error = MayBeEnabledError("slave.a may still be enabled (it is silent)")
    found = shaken(lambda name, share, number: error if name == "slave.a" else fitted())
    with pytest.raises(MayBeEnabledError, match="may still be enabled"):
        found.identify(NAMES, tmp_path)
    assert len(found.tried) == 1
    assert found.kept == []


def test_one_bus_served_every_nth_cycle_is_shaken_alone() -> None:
    slow = SimpleNamespace(buses={"b": SimpleNamespace(divisor=5)}, axis_divisor=lambda name: 5)
    assert identifying.rounds(slow, NAMES) == [[name] for name in NAMES]  # type: ignore[arg-type]


@pytest.mark.slow
@pytest.mark.parametrize("end", ["gap", "ctrl-c"])
def test_what_is_kept_and_how_to_go_on_is_said(
    tmp_path: Path, end: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The slave's samples stop for good; or a person stops it. The master is identified."""
    whole = identifying.identify_together

    def broken(rig: Any, names: Sequence[str], **options: Any) -> Any:
        if "slave.lever" in names:
            if end == "ctrl-c":
                raise KeyboardInterrupt
            raise DriverError("slave.lever: no sample for 20 ms; check its cable")
        return whole(rig, names, **options)

    monkeypatch.setattr(identifying, "identify_together", broken)
    monkeypatch.setattr(identifying, "rounds", lambda rig, names: [[name] for name in names])
    rig = written(tmp_path, "0.1\n")
    words = ["calibrate", str(rig), "--clock", "fake", "--out", str(tmp_path / "runs")]
    words += ["--script", str(tmp_path / "answers.txt"), "--steps", "identify"]
    done = CliRunner().invoke(main, [*words, "--identify-s", "6"])
    assert done.exit_code != 0
    assert (
        f"kept: master.lever; left: slave.lever; go on with: tautwave calibrate {rig} "
        "--steps identify --axis slave.lever"
    ) in done.output
    file = yaml.safe_load(rig.with_suffix(".calibration.yaml").read_text())
    assert "inertia" in file["axes"]["master.lever"]
    assert "inertia" not in file["axes"]["slave.lever"]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["bench-1dof-loopback", "bench-multirate-loopback"])
def test_both_ends_are_identified_as_each_alone(name: str, tmp_path: Path) -> None:
    """What is found together is what the simulated devices are, within the interval's width."""
    data = yaml.safe_load((BENCH.parent / f"{name}.yaml").read_text())
    for side in ("wall_master", "wall_slave"):
        data["coupling"]["pairs"]["lever"].pop(side, None)
    rig = tmp_path / "rig.yaml"
    rig.write_text(yaml.safe_dump(data))
    (tmp_path / "answers.txt").write_text("0.1\n")
    words = ["calibrate", str(rig), "--clock", "fake", "--out", str(tmp_path / "runs")]
    words += ["--script", str(tmp_path / "answers.txt"), "--steps", "identify"]
    done = CliRunner().invoke(main, words)
    assert done.exit_code == 0, done.output
    found = load_rig(rig)
    for axis, truth in data["simulation"]["axes"].items():
        assert found.axes[axis].inertia.value == pytest.approx(truth["inertia"], rel=0.1)


# -- devices --------------------------------------------------------------------------------------


class Device:
    """A driver of two axes that says what it is."""

    command_delay = CommandDelay(0, 0.0)
    notes = ("a note",)

    def __init__(self, firmware: str) -> None:
        self.identities = {"slave.a": {"model": "X", "firmware": firmware}}
        self.open_now = False
        self.sent: Sequence[AxisCommand] = ()

    def open(self) -> None:
        self.open_now = True

    def close(self) -> None:
        self.open_now = False

    def read(self, deadline_ns: int) -> Sequence[JointState]:
        return [JointState(0.5, 2.0, 3.0, True, 7), JointState(1.0, math.nan, 1.0, False, 9)]

    def write(self, commands: Sequence[AxisCommand]) -> None:
        self.sent = commands

    def enable_step(self) -> bool:
        return True

    def __getattr__(self, name: str) -> Any:
        return lambda: ()


def known(device: dict[str, str]) -> CalibratedDriver:
    found = [AxisCalibration(device=device, zero=0.2, direction=-1), AxisCalibration()]
    return CalibratedDriver(Device("53"), ["slave.a", "slave.b"], found)  # type: ignore[arg-type]


def test_positions_and_commands_are_turned_and_other_axes_are_as_they_come() -> None:
    driver = known({})
    one, two = driver.read(0)
    assert one == JointState(pytest.approx(-0.3), -2.0, -3.0, True, 7)
    assert (two.position, two.effort, two.valid, two.age_ns) == (1.0, 1.0, False, 9)
    driver.write([AxisCommand(0.5, 1.0), AxisCommand(0.5, 1.0, 0.3)])
    first, second = driver._driver.sent  # type: ignore[attr-defined]
    assert first[:2] == (-0.5, -1.0)
    assert math.isnan(first.position)  # it stays where it is
    assert second == AxisCommand(0.5, 1.0, 0.3)
    driver.write([AxisCommand(0.0, 0.0, 0.3), AxisCommand(0.0, 0.0)])
    assert driver._driver.sent[0].position == pytest.approx(-0.1)  # type: ignore[attr-defined]
    assert driver.notes == ("a note",)


def test_another_device_is_refused_and_let_go_of() -> None:
    known({"model": "X", "firmware": "53"}).open()
    driver = known({"model": "X", "firmware": "52", "serial": "9"})
    with pytest.raises(
        DriverError, match=r"slave\.a: firmware was 52, now 53; slave\.a: serial was 9"
    ):
        driver.open()
    assert not driver._driver.open_now  # type: ignore[attr-defined]


# -- the person -----------------------------------------------------------------------------------


class Person:
    """Answers the guide's questions by moving axes, in place of a controller."""

    class run:  # noqa: N801  as the controller has it
        period_ns = 100_000_000

    def __init__(self, moves: Sequence[dict[str, float]]) -> None:
        self.moves = list(moves)
        self.at = {"master.a": 0.0, "master.b": 0.0}
        self.said: list[str] = []

    def position(self, name: str) -> float:
        return self.at[name]

    def say(self, text: str) -> None:
        self.said.append(text)

    def show(self, text: Any) -> None:
        text()

    def ask(self, question: str) -> Generator[None, None, str]:
        self.said.append(question)
        yield
        self.at |= self.moves.pop(0)
        yield
        return ""


def led(steps: Sequence[str], *moves: dict[str, float]) -> tuple[Any, list[str]]:
    rig = load_rig(BENCH)
    axes = {"a": rig.master.axes["lever"], "b": rig.master.axes["lever"]}
    rig = rig.model_copy(update={"master": rig.master.model_copy(update={"axes": axes})})
    person = Person(moves)
    guide = measure_by_hand(rig, ["master.a", "master.b"], steps, person)  # type: ignore[arg-type]
    try:
        while True:
            next(guide)
    except StopIteration as ended:
        return ended.value, person.said


def test_a_person_who_moves_nothing_or_another_axis_is_asked_once_more() -> None:
    found, said = led(
        ["zero", "direction"],
        {"master.a": 1.0, "master.b": 2.0}, {}, {"master.b": 2.5}, {"master.a": 0.5},
        {"master.a": 1.0, "master.b": 2.9},
    )  # fmt: skip
    assert (found["master.a"].pose, found["master.a"].direction) == (1.0, -1)
    assert (found["master.b"].pose, found["master.b"].direction) == (2.0, 1)
    assert any(
        text.startswith("nothing moved by at least 0.1 rad; try again: master.a") for text in said
    )
    assert any(text.startswith("that was master.b; try again: master.a") for text in said)


def test_a_range_needs_both_axes_to_have_moved() -> None:
    found, said = led(["range"], {"master.a": 1.0}, {"master.a": -1.0, "master.b": 0.4})
    assert any(text.startswith("b hardly moved; master: move") for text in said)
    assert found["master.a"].low == pytest.approx(-0.96)
    assert found["master.a"].high == pytest.approx(0.96)


def test_a_script_is_answers_after_their_questions() -> None:
    script = read_answers("0.5 yes  # then\n\n0\n", "s")
    script.ask(1_000_000_000)
    assert script.take(1_400_000_000) is None
    assert script.take(1_500_000_000) == "yes"
    script.ask(1_500_000_000)
    assert script.take(1_500_000_000) == ""
    with pytest.raises(ConfigError, match="fewer answers"):
        script.ask(0)
    with pytest.raises(ConfigError) as caught:
        read_answers("soon yes\n-1", "s")
    assert [problem.partition(": ")[0] for problem in caught.value.problems] == ["s:1", "s:2"]


def test_mistakes_of_the_command_line_are_sentences(bench: Path) -> None:
    for options, words in (
        (["--steps", "jump"], "'jump' is not one of zero"),
        (["--stop", "master.lever=up"], "write AXIS=POSITION"),
        (["--stop", "master.lever=0"], "does not give the direction"),
        (["--axis", "master.wrist"], "no axis 'master.wrist'"),
    ):
        done = calibrate(bench, "--out", str(bench.parent / "refused"), *options)
        assert done.exit_code == 2
        assert words in done.output
    assert not (bench.parent / "refused").exists()


def test_a_folder_that_may_not_be_written_is_said_before_anything_is_asked(
    bench: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "access", lambda place, mode: place != bench.parent)
    done = calibrate(bench, "--out", str(bench.parent / "refused"))
    assert done.exit_code == 2
    assert "is not writable, and the calibration is stored next to the rig" in done.output
    assert "bring" not in done.output


@pytest.mark.slow
def test_what_does_not_end_says_after_how_long(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tautwave.session.guided.running.SIMULATED_S", 2.0)
    done = calibrate(written(tmp_path))
    assert done.exit_code == 2
    assert "the procedure did not finish within 2 s" in done.output


def test_the_digest_of_a_file_is_that_of_its_bytes() -> None:
    assert digest("a\n") == "87428fc522803d31065e7bce3cf03fe475096631e5e07bbd7a0fde60c4cf25c7"
    rig = load_rig(BENCH)
    assert "calibration" not in resolved_yaml(rig)
