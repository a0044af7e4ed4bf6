"""An acceptance as a ladder: stages are repeated, left, resumed, waited for, and never left on."""

from __future__ import annotations

import errno
import json
import math
import os
from collections.abc import Callable, Generator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import yaml
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st

from tautwave import read_recording
from tautwave.cli import main
from tautwave.config import load_rig
from tautwave.errors import ConfigError, DeviceFault, NotCertifiedError
from tautwave.session.acceptance import accepting
from tautwave.session.acceptance.accepting import Accepted
from tautwave.session.acceptance.accepting import accept as lead
from tautwave.session.acceptance.day import Acceptance, Day, begun
from tautwave.session.acceptance.document import FILE, Check, verify
from tautwave.session.acceptance.ladder import FREE, STAGES
from tautwave.session.acceptance.waiting import WAIT_S, apart, middles, wait_for_place
from tautwave.session.guided.answers import (
    Scripted,
    read_answers,
)
from tautwave.session.guided.running import Conversation, Ways
from tautwave_sim.dynamixel import servo
from tautwave_sim.loopback import LoopbackDriver
from tests.reports.make import shipped
from tests.rigs.running import Tree
from tests.session.test_accepting import accept, checks, written

pytestmark = pytest.mark.realtime

FAKE = Ways("fake")


def still(name: str) -> Tree:
    """A shipped rig whose devices nobody holds or touches."""
    data = shipped(name)
    for key in ("hand", "environment"):
        data["simulation"].pop(key, None)
    return data


def bench(folder: Path) -> Path:
    return written(folder, still("bench-1dof-loopback"))


def talk(answers: str, *, pauses: bool = False) -> tuple[Conversation, list[str]]:
    said: list[str] = []
    return Conversation(read_answers(answers, "answers"), said.append, str, pauses), said


def led(rig: Path, stages: str, answers: str, **options: Any) -> tuple[Accepted, list[str]]:
    """Accept the slave of a rig by a script of answers."""
    pauses = options.pop("pauses", False)
    asked = Acceptance(rig, ("slave.lever",), stages.split(","), 0.5, "a person")
    conversation, said = talk(answers, pauses=pauses)
    return lead(asked, conversation, out=rig.parent / "out", ways=FAKE, **options), said


@pytest.fixture
def verdicts(monkeypatch: pytest.MonkeyPatch) -> dict[str, list[bool | type[BaseException]]]:
    """Stages without devices: what each try of them finds, in their order; else they are good."""
    given: dict[str, list[bool | type[BaseException]]] = {}

    def found(stage: str, day: Day, talk: Conversation, out: Path, *, resumed: bool) -> list[Check]:
        out.mkdir(parents=True)
        (out / "rig.yaml").write_text("{}")
        verdict = given[stage].pop(0) if given.get(stage) else True
        if not isinstance(verdict, bool):
            raise verdict("nobody answers")
        return [
            Check(
                "sign" if stage == "hand" else stage, "a", {"tried": day.tries[stage]}, "", verdict
            )
        ]

    monkeypatch.setattr(accepting, "_stage", found)
    return given


Verdicts = dict[str, list[bool | type[BaseException]]]


def document(rig: Path) -> dict[str, Any]:
    content: dict[str, Any] = json.loads((rig.parent / "out" / FILE).read_text())
    return content


# -- repeated ---------------------------------------------------------------------------------


def test_a_failed_stage_is_asked_for_again_and_both_tries_are_kept(
    tmp_path: Path, verdicts: Verdicts
) -> None:
    rig = bench(tmp_path)
    verdicts["hand"] = [False, False, True]
    found, said = led(rig, "identity,hand,noise", "0 r\n0 r\n")
    assert found.left == []
    assert "hand was not passed. Enter: end here. r: do it again" in said
    content = document(rig)
    assert content["accepted"]
    assert [one["measured"]["tried"] for one in content["earlier"]] == [1, 2]
    assert [one["measured"]["tried"] for one in content["checks"]] == [1, 3, 1]
    assert content["folders"] == {"identity": "identity", "hand": "hand-3", "noise": "noise"}
    assert verify(tmp_path / "out" / FILE).wrong == []


@pytest.mark.parametrize("answers", ["", "0\n", "0 n\n0\n"])
def test_without_another_try_a_failed_stage_ends_it(
    tmp_path: Path, verdicts: Verdicts, answers: str
) -> None:
    rig = bench(tmp_path)
    verdicts["hand"] = [False]
    found, said = led(rig, "identity,hand,noise", answers or "0\n")
    assert found.left == ["hand", "noise"]
    assert not [line for line in said if line.startswith("-- noise")]
    assert document(rig)["ended_at"] == "hand"


@pytest.mark.parametrize(
    ("answers", "left", "tries"),
    [
        ("0\n0\n", [], {"identity": 1, "hand": 1, "noise": 1}),
        ("0 r\n0\n0 R\n0 r\n0\n", [], {"identity": 2, "hand": 3, "noise": 1}),
        ("0\n0 q\n", ["noise"], {"identity": 1, "hand": 1}),
        ("0\n", ["noise"], {"identity": 1, "hand": 1}),
        ("0\n0 no\n", ["noise"], {"identity": 1, "hand": 1}),
        ("0 what\n0\n0 yes!\n0\n", [], {"identity": 1, "hand": 1, "noise": 1}),
    ],
)
def test_between_stages_a_person_goes_on_does_it_again_or_leaves(
    tmp_path: Path, verdicts: Verdicts, answers: str, left: list[str], tries: dict[str, int]
) -> None:
    rig = bench(tmp_path)
    found, said = led(rig, "identity,hand,noise", answers, pauses=True)
    assert "Enter: go on to hand. r: identity again. q: stop here for now" in said
    assert found.left == left
    content = document(rig)
    assert content["tries"] == tries
    assert content["ended_at"] == (left[0] if left else "")
    assert content["accepted"] == (not left)


# -- what is typed ----------------------------------------------------------------------------


@pytest.mark.parametrize("word", ["no", "N", "q", "quit"])
def test_no_begins_nothing_and_its_stage_is_not_passed(tmp_path: Path, word: str) -> None:
    rig = bench(tmp_path)
    found, _ = led(rig, "identity,motion", f"0.1\n0.1 {word}\n0\n")
    assert found.left == ["motion"]
    (check,) = [one for one in document(rig)["checks"] if one["stage"] == "motion"]
    assert check["measured"]["said"].startswith(f"you answered {word!r} to: each axis is moved")
    recording = tmp_path / "out" / "motion" / "recording.mcap"
    efforts = read_recording(recording, ["slave.lever.commanded"])["slave.lever.commanded"]
    assert len(efforts) > 50
    assert not efforts.any()


def test_devices_that_are_not_ours_end_it(tmp_path: Path) -> None:
    rig = bench(tmp_path)
    found, _ = led(rig, "identity,hand", "0.1 no\n0\n")
    assert found.left == ["identity", "hand"]
    assert str(found.refused).startswith("you answered 'no' to: are these your devices")


@pytest.mark.slow
def test_what_cannot_be_read_is_asked_again(tmp_path: Path) -> None:
    rig = bench(tmp_path)
    answers = "0.1 sure\n0.1\n0.1 thirty\n0.1\n0.1 1,000\n0.1 30 deg\n0\n"
    found, said = led(rig, "identity,hand", answers)
    assert found.left == ["hand"]  # nobody moved it
    assert "'sure': Enter goes on, no ends this. are these your devices? Press Enter" in said
    assert len([line for line in said if "type one number in degrees; no ends this" in line]) == 2
    assert any("'1,000': it may be two numbers" in line for line in said)
    measured = {one["what"] + one["stage"]: one["measured"] for one in document(rig)["checks"]}
    assert measured["slave.leverscale"]["known_rad"] == pytest.approx(math.radians(30.0))


# -- resumed ----------------------------------------------------------------------------------


@pytest.mark.parametrize("end", [False, KeyboardInterrupt, ConfigError])
@pytest.mark.parametrize("at", ["hand", "limits", "noise"])
def test_what_was_passed_is_resumed_however_it_ended(
    tmp_path: Path, verdicts: Verdicts, at: str, end: Any
) -> None:
    rig = bench(tmp_path)
    stages = "identity,hand,limits,noise"
    names = stages.split(",")
    verdicts[at] = [end]
    if end is False:
        assert led(rig, stages, "0\n")[0].left == names[names.index(at) :]
    else:
        with pytest.raises(end):
            led(rig, stages, "0\n")
    content = document(rig)
    assert content["ended_at"] == at
    assert not content["accepted"]
    found, said = led(rig, stages, "0\n", resume=True)
    assert found.left == []
    before = [line.split()[1][:-1] for line in said if line.endswith("passed before")]
    assert before == names[1 : names.index(at)]
    assert [line for line in said if line.startswith("-- identity: read only")]
    assert document(rig)["folders"][at] == f"{at}-2"
    found, said = led(rig, stages, "0\n", resume=True, redo=["hand"])
    assert found.left == []
    assert document(rig)["tries"]["hand"] == (3 if at == "hand" else 2)
    assert "-- noise: passed before" in said
    assert verify(tmp_path / "out" / FILE).wrong == []


def test_an_end_before_anything_was_passed_leaves_no_document(
    tmp_path: Path, verdicts: Verdicts
) -> None:
    verdicts["identity"] = [KeyboardInterrupt]
    with pytest.raises(KeyboardInterrupt):
        led(bench(tmp_path), "identity,hand", "0\n")
    assert not (tmp_path / "out" / FILE).exists()


def change(folder: Path, *path: str, to: Any) -> None:
    """Write the rig anew with one key changed."""
    data = block = yaml.safe_load((folder / "rig.yaml").read_text())
    for key in path[:-1]:
        block = block[key]
    block[path[-1]] = to
    written(folder, data)


def changed_axis(folder: Path) -> None:
    change(folder, "slave", "axes", "lever", "velocity_limit", to=9.0)


def changed_rate(folder: Path) -> None:
    change(folder, "rate_hz", to=500)


def edited(folder: Path) -> None:
    text = (folder / "out" / FILE).read_text()
    (folder / "out" / FILE).write_text(text.replace('"good": true', '"good": false'))


def of_another_version(folder: Path) -> None:
    reseal(folder, version="0.1.9")


def of_other_axes(folder: Path) -> None:
    reseal(folder, axes=["master.lever"])


def of_other_files(folder: Path) -> None:
    reseal(folder, uncoupled_sha256="0" * 64)


def without_state(folder: Path) -> None:
    reseal(folder, counts=None)


def gone(folder: Path) -> None:
    (folder / "out" / FILE).unlink()


def reseal(folder: Path, **changes: Any) -> None:
    from tautwave.session.acceptance.document import content_digest

    path = folder / "out" / FILE
    content = {**json.loads(path.read_text()), **changes}
    content = {key: value for key, value in content.items() if value is not None}
    content["seal"] = {"sha256": content_digest(content)}
    path.write_text(json.dumps(content))


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (changed_axis, "cannot be resumed: more of the rig than its coupling changed since"),
        (changed_rate, "cannot be resumed: more of the rig than its coupling changed since"),
        (edited, "was changed after it was sealed"),
        (of_another_version, "cannot be resumed: tautwave changed since"),
        (of_other_axes, "cannot be resumed: the axes changed since"),
        (of_other_files, "cannot be resumed: more of the rig than its coupling changed since"),
        (without_state, "was written by a tautwave that does not resume"),
        (gone, "there is no acceptance.json to resume"),
    ],
)
def test_what_is_not_of_this_rig_is_not_believed(
    tmp_path: Path, changes: Callable[[Path], None], said: str
) -> None:
    rig = bench(tmp_path)
    asked, out = Acceptance(rig, ("slave.lever",), STAGES, 1.0, "me"), tmp_path / "out"
    out.mkdir()
    day = Day(asked, load_rig(rig), out, FAKE)
    day.checks["identity"] = [Check("identity", "slave.lever", {}, "", True)]
    day.seal()
    changes(tmp_path)
    with pytest.raises(ConfigError, match=said):
        Day(asked, load_rig(rig), out, FAKE).resume(())


@pytest.mark.parametrize("changes", [changed_axis, changed_rate, of_other_axes, of_other_files])
def test_a_rig_whose_devices_were_refused_at_first_is_mended_and_goes_on(
    tmp_path: Path, verdicts: Verdicts, changes: Callable[[Path], None]
) -> None:
    rig = bench(tmp_path)
    verdicts["identity"] = [False]
    assert led(rig, "identity,hand", "0\n")[0].left == ["identity", "hand"]
    changes(tmp_path)
    assert led(rig, "identity,hand", "0\n", resume=True)[0].left == []
    content = document(rig)
    assert [one["good"] for one in content["earlier"]] == [False]
    assert content["folders"] == {"identity": "identity-2", "hand": "hand"}
    assert verify(tmp_path / "out" / FILE).wrong == []


@pytest.mark.parametrize(
    ("path", "to", "again"),
    [
        (("coupling", "pairs", "lever", "wall_slave", "stiffness"), 1.0, True),
        (("coupling", "delay_s"), 0.01, True),
        (("duration_s",), 3.0, True),
        (("seed",), 5, None),
        ((), None, False),
    ],
)
def test_what_does_not_rest_on_the_coupling_outlasts_another_one(
    tmp_path: Path,
    verdicts: Verdicts,
    monkeypatch: pytest.MonkeyPatch,
    path: tuple[str, ...],
    to: Any,
    again: bool | None,
) -> None:
    monkeypatch.setattr(accepting, "admit", lambda rig, **_: rig)
    rig, stages = bench(tmp_path), "identity,hand,touch,gentle,walls,full"
    verdicts["walls"] = [False]
    assert led(rig, stages, "0\n")[0].left == ["walls", "full"]
    if path:
        change(tmp_path, *path, to=to)
    else:
        rig.write_text(f"# a remark\n{rig.read_text()}")
    if again is None:
        with pytest.raises(ConfigError, match="more of the rig than its coupling"):
            led(rig, stages, "0\n", resume=True)
        return
    found, said = led(rig, stages, "0\n", resume=True)
    assert found.left == []
    before = [line.split()[1][:-1] for line in said if line.endswith("passed before")]
    assert before == ["hand", "touch"] + ["gentle"] * (not again)
    assert ("the coupling changed since: gentle, walls done again" in said) == again
    assert verify(tmp_path / "out" / FILE).wrong == []


# -- refused at the beginning, not at the end of a day ----------------------------------------


@pytest.mark.slow
def test_a_rig_that_a_coupled_stage_would_refuse_is_refused_before_a_device_is_opened(
    tmp_path: Path,
) -> None:
    rig = bench(tmp_path)
    change(tmp_path, "coupling", "pairs", "lever", "wall_slave", "stiffness", to=1e4)
    with pytest.raises(NotCertifiedError) as caught:
        led(rig, "identity,touch,full", "0\n")
    assert not (tmp_path / "out").exists()
    assert "mend the rig first, or leave what is coupled out: --stages identity,touch." in str(
        caught.value
    )
    assert "--allow-uncertified" not in str(caught.value)
    assert led(rig, "identity", "0.1\n")[0].left == []  # as it says


@pytest.mark.parametrize("damaged", [True, False])
def test_a_file_of_accepted_devices_that_cannot_be_kept_is_said_first(
    tmp_path: Path, verdicts: Verdicts, monkeypatch: pytest.MonkeyPatch, damaged: bool
) -> None:
    rig = bench(tmp_path)
    monkeypatch.setattr(accepting, "real_buses", lambda ways: set(ways))
    said = "is not writable, and what was accepted is stored next to the rig"
    if damaged:
        rig.with_suffix(".accepted.json").write_text("{")
        said = "was not written by `tautwave accept`, or is damaged"
    else:
        monkeypatch.setattr(os, "access", lambda place, mode: place != tmp_path)
    with pytest.raises(ConfigError, match=said):
        led(rig, "identity,motion", "0\n")
    assert not (tmp_path / "out").exists()
    assert led(rig, "identity,hand", "0\n")[0].left == []  # keeps none


def test_other_devices_end_a_resumed_day_and_change_nothing(tmp_path: Path) -> None:
    rig = bench(tmp_path)
    day = Day(Acceptance(rig, ("slave.lever",), STAGES, 1.0, "me"), load_rig(rig), tmp_path, FAKE)
    day.devices = {"slave.lever": {"serial": "5", "model": "X"}}
    day.compare({"slave.lever": {"serial": "5", "model": "X", "new": "of a newer version"}})
    with pytest.raises(DeviceFault, match=r"slave\.lever: serial was 5, now 6; put them back"):
        day.compare({"slave.lever": {"serial": "6", "model": "X"}})
    with pytest.raises(DeviceFault, match="serial was 5, now not given"):
        day.compare({})


@pytest.mark.slow
def test_a_resumed_day_meets_another_drive(tmp_path: Path) -> None:
    rig = written(tmp_path, still("bench-dynamixel-sim"))
    with pytest.raises(ConfigError, match="fewer answers"):
        led(rig, "identity,touch", "0.1\n")
    path = tmp_path / "out" / FILE
    reseal(tmp_path, devices={"slave.lever": {"firmware": "12"}})
    before = path.read_text()
    with pytest.raises(DeviceFault, match="firmware was 12, now 48"):
        led(rig, "identity,touch", "0.1\n", resume=True)
    assert path.read_text() == before


@pytest.mark.slow
def test_a_person_their_axes_and_stages_are_those_that_were_begun(tmp_path: Path) -> None:
    rig = bench(tmp_path)
    done = accept(rig, "identity,touch", "0.1\n", "--axis", "slave.lever")
    assert done.exit_code == 2  # nobody answered any more
    kept = f"what was passed is kept; go on with: tautwave accept {rig} --resume {tmp_path / 'out'}"
    assert kept in done.output
    assert begun(tmp_path / "out") == ("a person", ["slave.lever"], ["identity", "touch"])
    (tmp_path / "answers.txt").write_text("0.1\n0.1\n0.1 +\n")
    words = ["accept", str(rig), "--resume", str(tmp_path / "out"), "--clock", "fake"]
    script = ["--script", str(tmp_path / "answers.txt")]
    done = CliRunner().invoke(main, [*words, *script])
    assert done.exit_code == 0, done.output
    assert "accepted by a person" in done.output
    for more, said in (
        (["--out", "x"], "--resume DIR goes on in DIR"),
        (["--redo", "flying"], "'flying' is not one of identity"),
    ):
        done = CliRunner().invoke(main, [*words, *more])
        assert done.exit_code == 2
        assert said in done.output
    done = CliRunner().invoke(main, ["accept", str(rig), "--by", "x", "--redo", "hand"])
    assert "--redo goes with --resume DIR" in done.output


# -- interrupted ------------------------------------------------------------------------------


class Leaves(Scripted):
    """Somebody who presses Ctrl-C at a question."""

    def __init__(self, answers: str, at: int) -> None:
        super().__init__([(0.1, line) for line in answers.split(",")])
        self._question, self._at = 0, at

    def ask(self, now_ns: int) -> None:
        self._question += 1
        super().ask(now_ns)

    def take(self, now_ns: int) -> str | None:
        if self._question == self._at:
            raise KeyboardInterrupt
        return super().take(now_ns)


@pytest.mark.slow
@pytest.mark.parametrize("at", range(1, 7))
def test_ctrl_c_at_any_question_leaves_nothing_on_and_keeps_what_was_passed(
    tmp_path: Path, at: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    on: set[int] = set()
    enabled: list[LoopbackDriver] = []
    enable, disable = LoopbackDriver.enable_step, LoopbackDriver.disable

    def enables(self: LoopbackDriver) -> bool:
        enabled.append(self)
        on.add(id(self))
        return enable(self)

    def disables(self: LoopbackDriver) -> None:
        on.discard(id(self))
        disable(self)

    monkeypatch.setattr(LoopbackDriver, "enable_step", enables)
    monkeypatch.setattr(LoopbackDriver, "disable", disables)
    rig = bench(tmp_path)
    stages = ["identity", "noise", "silence", "touch", "motion"]
    said: list[str] = []
    asked = Acceptance(rig, ("slave.lever",), stages, 0.5, "a person")
    conversation = Conversation(Leaves(",,,,+,", at), said.append, str)
    with pytest.raises(KeyboardInterrupt):
        lead(asked, conversation, out=tmp_path / "out", ways=FAKE)
    assert enabled
    assert not on
    passed = {1: 0, 2: 1, 3: 2, 4: 3, 5: 3, 6: 4}[at]
    assert (tmp_path / "out" / FILE).exists() == (passed > 0)
    if passed:
        assert "what was passed is kept" in said[-1]
        assert document(rig)["ended_at"] == stages[passed]
        assert verify(tmp_path / "out" / FILE).wrong == []


def test_a_terminal_that_is_gone_keeps_what_was_passed_and_says_how_it_ended(
    tmp_path: Path, verdicts: Verdicts
) -> None:
    def say(text: str) -> None:
        if "what was passed is kept" in text:
            raise OSError(errno.EIO, "Input/output error")

    rig = bench(tmp_path)
    verdicts["hand"] = [KeyboardInterrupt]  # as a hang-up of the terminal does
    asked = Acceptance(rig, ("slave.lever",), ["identity", "hand"], 0.5, "a person")
    conversation = Conversation(read_answers("0", "answers"), say, str, False)
    with pytest.raises(KeyboardInterrupt):
        lead(asked, conversation, out=tmp_path / "out", ways=FAKE)
    assert document(rig)["ended_at"] == "hand"


# -- waited for -------------------------------------------------------------------------------


class Stub:
    """Of a guided controller: positions that somebody moves, and what was said."""

    def __init__(self, at: dict[str, float]) -> None:
        self.at, self.said, self.now_ns = at, list[str](), 0

    def position(self, name: str) -> float:
        return self.at[name]

    def say(self, text: str) -> None:
        self.said.append(text)

    def show(self, text: Callable[[], str]) -> None:
        text()


def waits(rig: Any, stub: Any, axes: tuple[str, ...], seconds: float, **options: Any) -> Any:
    steps: Generator[None, None, Any] = wait_for_place(rig, axes, stub, **options)
    return proceed(steps, stub, seconds)


def proceed(steps: Generator[None, None, Any], stub: Any, seconds: float) -> Any:
    """Let time pass; return the checks once it has them, else the guide."""
    for _ in range(round(seconds / 0.05)):
        try:
            next(steps)
        except StopIteration as ended:
            return ended.value
        stub.now_ns += 50_000_000
    return steps


def test_a_stage_that_needs_the_middle_asks_for_it_and_waits(tmp_path: Path) -> None:
    rig = load_rig(bench(tmp_path))
    low, high = middles(rig, ["slave.lever"])["slave.lever"]
    stub = Stub({"master.lever": 0.0, "slave.lever": 0.49})
    steps = waits(rig, stub, ("slave.lever",), 20.0, coupled=False)
    assert stub.said == [
        f"  waiting: move slave.lever towards the middle, between {low:.3g} and {high:.3g} rad; "
        "it is at 0.49"
    ]
    stub.at["slave.lever"] = 0.1
    assert proceed(steps, stub, 0.25) is steps  # it is to stand there
    stub.at["slave.lever"] = 0.48
    assert proceed(steps, stub, 1.0) is steps
    stub.at["slave.lever"] = -0.1
    assert proceed(steps, stub, 1.0) == []
    assert len(stub.said) == 1
    assert waits(rig, Stub({"slave.lever": 0.1}), ("slave.lever",), 0.1, coupled=False) == []
    stub = Stub({"slave.lever": -0.49})
    (check,) = waits(rig, stub, ("slave.lever",), WAIT_S + 1.0, coupled=False)
    assert not check.good
    assert "it is at -0.49" in check.measured["said"]


@given(low=st.floats(-3.0, 3.0), span=st.floats(1e-3, 6.0), share=st.floats(0.0, 1.0))
def test_the_middle_is_inside_every_range(low: float, span: float, share: float) -> None:
    axis = SimpleNamespace(position_range=(low, low + span), kind="rotary")
    (found,) = middles(SimpleNamespace(axes={"a": axis}), ["a"]).values()  # type: ignore[arg-type]
    assert low < found[0] < found[1] < low + span
    assert found[0] - low == pytest.approx(low + span - found[1], rel=1e-6, abs=1e-9)
    free = SimpleNamespace(position_range=None, kind="rotary")
    assert middles(SimpleNamespace(axes={"a": free}), ["a"]) == {}  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("pair", "more", "at", "gap"),
    [
        ({"engage_tolerance": 0.05, "offset": 0.0}, {}, (0.3, 0.0), -0.3),
        ({"engage_tolerance": 0.05, "offset": 0.0}, {}, (0.3, 0.29), None),
        ({"engage_tolerance": 0.05, "offset": 0.0, "position_scale": 2.0}, {}, (0.3, 0.6), None),
        ({"engage_tolerance": 0.05, "offset": 0.1}, {}, (0.3, 0.2), None),
        ({"engage_tolerance": 0.05}, {}, (0.3, 0.0), None),
        ({"engage_tolerance": 0.05, "offset": 0.0}, {"operate": {}}, (0.3, 0.0), None),
    ],
)  # fmt: skip
def test_a_pair_is_brought_together_where_it_would_be_refused(
    tmp_path: Path, pair: Tree, more: Tree, at: tuple[float, float], gap: float | None
) -> None:
    data = still("bench-1dof-loopback")
    keys = data["coupling"]["pairs"]["lever"]
    for key in ("wall_master", "wall_slave", "offset", "engage_tolerance"):
        keys.pop(key, None)
    keys |= pair
    rig = load_rig(written(tmp_path, {**data, **more}), choose=False)
    found = apart(rig, {"master.lever": at[0], "slave.lever": at[1]})
    assert found == ({} if gap is None else {"lever": pytest.approx(gap)})


# -- the watchdog, tripped on purpose ---------------------------------------------------------

SPEAK = {
    "bench-canopen-virtual": "EMCY 0x8130: heartbeat or life guarding lost",
    "bench-dynamixel-sim": "its bus watchdog tripped",
    "bench-mit-virtual": "its TIMEOUT(9) has passed and its torque is off",
    "bench-modbus-rtu-sim": "the line was silent for too long",
    "bench-modbus-tcp-sim": "the line was silent for too long",
}


@pytest.mark.slow
@pytest.mark.parametrize("name", SPEAK)
def test_a_silent_host_trips_every_watchdog(name: str, tmp_path: Path) -> None:
    rig = written(tmp_path, still(name))
    found, _ = led(rig, "silence", "0.1\n")
    (check,) = found.checks
    assert check.good
    assert SPEAK[name] in str(check.measured["said"])
    assert float(check.measured["silent_s"]) > 2.0 * float(check.measured["watchdog_s"])


@pytest.mark.slow
def test_a_watchdog_that_does_not_trip_is_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A servo that takes its setting, reads it back, and waits for a thousand times as long."""
    monkeypatch.setattr(servo, "WATCHDOG_UNIT_NS", 1000 * servo.WATCHDOG_UNIT_NS)
    found, said = led(written(tmp_path, still("bench-dynamixel-sim")), "silence,touch", "0.1\n")
    (check,) = found.checks
    assert not check.good
    assert check.measured["said"] == "nothing"
    assert found.left == ["silence", "touch"]
    assert [line for line in said if "FAILED, expected lets go by itself, and says so" in line]


@pytest.mark.slow
def test_devices_without_a_watchdog_are_named_where_they_are_allowed(tmp_path: Path) -> None:
    rig = written(tmp_path, still("bench-feetech-sim"))
    done = accept(rig, "identity,silence", "0.1\n0.1\n", "--allow-unwatched")
    assert done.exit_code == 0, done.output
    found = checks(rig)["silence", "slave.lever"]
    assert found["measured"] == {"watchdog": "none, allowed by --allow-unwatched"}
    assert document(rig)["unwatched"] == ["master.lever", "slave.lever"]


# -- every stage ------------------------------------------------------------------------------

NO_PERSON = [stage for stage in STAGES if stage not in ("hand", "limits", "watchdog", "effort")]


@pytest.mark.slow
@pytest.mark.nightly
@pytest.mark.timeout(300)
@pytest.mark.parametrize("name", ["bench-modbus-tcp-sim", "three-bus-sim", "bench-canopen-virtual"])
def test_all_that_needs_no_person_passes_also_on_slow_buses(name: str, tmp_path: Path) -> None:
    data = still(name)
    rig = written(tmp_path, data)
    axes = sum(len(data[side]["axes"]) for side in ("master", "slave"))
    answers = "0.1\n" * 3 + "0.1\n0.1 +\n" * axes + "0.1\n" * 2
    done = accept(rig, ",".join(NO_PERSON), answers, "--run-s", "1")
    assert done.exit_code == 0, done.output
    found = checks(rig)
    for (stage, what), check in found.items():
        if stage == "motion":
            assert math.radians(0.5) < check["measured"]["moved"] < math.radians(5.0), what
        if stage == "delay":
            assert 0.0 < check["measured"]["moved"] < math.radians(1.0), what
    limits = {}
    for stage in ("gentle", "walls", "full"):
        path = tmp_path / "out" / stage / "rig.yaml"
        if path.exists():
            ran = yaml.load(path.read_text(), yaml.CSafeLoader)
            pairs = ran["coupling"]["pairs"].values()
            walls = [pair[key] for pair in pairs for key in ("wall_master", "wall_slave")]
            limits[stage] = next(iter(ran["slave"]["axes"].values()))["effort_limit"]
            assert any(walls) == (stage != "gentle" and "walls" in limits), stage
    assert limits["gentle"] == pytest.approx(0.1 * limits["full"])
    assert limits.get("walls", limits["gentle"]) == limits["gentle"]


def test_what_has_no_torque_comes_first() -> None:
    assert set(STAGES[: len(FREE)]) == FREE
