"""Key devices and enable inputs: commands by HID keys, and a rig that engages only while held."""

from __future__ import annotations

import os
import typing
from pathlib import Path

import pytest

from tautwave.config.keys.key_codes import CODES
from tautwave.config.keys.operate import Word
from tautwave.errors import ConfigError, DriverError
from tautwave.runtime.operate.commands import ENDINGS, PAYLOAD, TOGGLE, WORDS, Order, Script
from tautwave.runtime.operate.key_device import DROPPED, EVENT, KEY, SYN, KeyDevice
from tautwave.runtime.operate.mailbox import HELD, LOOSE, Kept
from tautwave.runtime.operate.states import SCALE
from tests.rigs.running import Tree, rig_of
from tests.rigs.test_canopen_rows import can_tree
from tests.runtime.operating import BARE, FREE, STILL, bench, operate
from tests.runtime.test_device_faults import operated

SPACE, A = CODES["KEY_SPACE"], CODES["KEY_A"]


def key(code: int, value: int) -> bytes:
    return EVENT.pack(12, 345, KEY, code, value) + EVENT.pack(12, 345, SYN, 0, 0)


class Pedal:
    """A device of keys whose bytes the test writes: a named pipe."""

    def __init__(self, path: Path) -> None:
        os.mkfifo(path)
        self.device = KeyDevice(str(path), {A: "toggle"}, SPACE)
        self.end = os.open(path, os.O_WRONLY)

    def words(self, data: bytes = b"") -> list[str]:
        os.write(self.end, data)
        return [order.word for order in self.device.take(0)]


@pytest.fixture
def pedal(tmp_path: Path) -> Pedal:
    return Pedal(tmp_path / "event7")


def test_the_words_of_a_rig_file_are_those_of_the_controller() -> None:
    # A key has no argument.
    assert set(typing.get_args(Word)) == {TOGGLE, *WORDS, *ENDINGS} - {SCALE, PAYLOAD}


def test_a_press_is_a_command_and_repeats_are_none(pedal: Pedal) -> None:
    assert pedal.words(key(A, 1) + key(A, 2) + key(A, 2) + key(A, 0)) == ["toggle"]
    assert pedal.words(key(CODES["KEY_B"], 1)) == []
    half = key(A, 1)
    assert pedal.words(half[:30]) == ["toggle"]  # the first event is whole, the second is not
    assert pedal.words(half[30:] + key(A, 1)) == ["toggle"]


def test_a_dead_man_is_held_until_released_or_unknown_or_gone(pedal: Pedal) -> None:
    assert not pedal.device.held()
    for end in (key(SPACE, 0), EVENT.pack(0, 0, SYN, DROPPED, 0)):
        pedal.words(key(SPACE, 1) + key(SPACE, 2))
        assert pedal.device.held()
        pedal.words(end)
        assert not pedal.device.held()
    pedal.words(key(SPACE, 1))
    os.close(pedal.end)
    assert pedal.device.take(0) == ()
    assert not pedal.device.held()
    assert pedal.device.take(0) == ()


def test_a_device_that_is_not_there_is_refused_in_a_sentence(tmp_path: Path) -> None:
    with pytest.raises(DriverError, match="event9: No such file or directory; plug it in"):
        KeyDevice(str(tmp_path / "event9"), {})


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ("{KEY_NONE: engage}", "unknown key KEY_NONE; keys are KEY_A"),
        ("{KEY_A: jump}", "'toggle', 'engage'"),
    ],
)
def test_unknown_keys_and_commands_are_refused(keys: str, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        bench(f"operate.key_devices=[{{device: /dev/input/event0, keys: {keys}}}]")


class Hand:
    """A dead-man that is released after some looks, and held again later."""

    name = "pedal"

    def __init__(self, looks: str) -> None:
        self.left = looks

    def held(self) -> bool:
        now, self.left = self.left[0], self.left[1:] or self.left
        return now == "x"


def test_a_rig_engages_only_while_the_dead_man_is_held_and_holds_when_it_is_released() -> None:
    # One look at each command, then one a slot while engaging and engaged.
    hand = Hand(".x" + 500 * "x" + ".x")
    script = "0.1 engage\n0.2 engage\n1.0 engage"
    done = operate(bench(STILL, FREE, *BARE), script, 1.5, dead_men=[hand])
    assert done.words() == [
        ("engage", "idle"), ("engage", "aligning"), ("aligned", "engaged"), ("released", "holding"),
        ("engage", "aligning"), ("aligned", "engaged"),
    ]  # fmt: skip
    said = [entry.text for entry in done.control.journal.entries]
    assert said[0] == "engage: press the dead-man first: pedal"
    assert said[3] == "pedal: the dead-man was released"


def switched(*inputs: tuple[float, int]) -> Tree:
    data = can_tree(simulator={"nodes": {2: {"inputs": [list(one) for one in inputs]}}})
    data["buses"]["can"]["options"]["nodes"][1]["enable_input"] = 3
    return data


def test_a_drive_has_a_dead_man_on_a_digital_input() -> None:
    done = operated(switched((0.2, 0x08), (0.8, 0x07)), "0.1 engage\n0.3 engage", 1.0)
    assert done.words() == [
        ("engage", "idle"), ("engage", "aligning"), ("aligned", "engaged"), ("released", "holding"),
    ]  # fmt: skip
    last = done.control.journal.entries[-1]
    assert last.text == "enable input of slave.lever: the dead-man was released"
    assert 0.8 < last.at_s <= 0.84  # read every 10 ms, looked at every 20


def test_a_drive_that_no_longer_answers_holds_no_dead_man() -> None:
    data = switched((0.0, 0x08))
    data["loop"]["missing_limit"] = 500
    data["buses"]["can"]["options"]["simulator"]["nodes"][2]["silent_at_s"] = 0.5
    data["buses"]["can"]["options"]["heartbeat_timeout_ms"] = 5000
    done = operated(data, "0.1 engage", 0.9)
    last = done.control.journal.entries[-1]
    assert last.word == "released"
    assert 0.58 <= last.at_s <= 0.62  # what was read counts for 0.1 s


def test_a_rig_without_operate_refuses_an_enable_input() -> None:
    with pytest.raises(ConfigError, match="enable_input: the rig has no `operate` block"):
        operate(rig_of(switched()), "", 0.1)


def sent(*orders: tuple[float, str]) -> Kept:
    """Commands of a program elsewhere, at times in s."""
    return Kept(Script([(round(1e9 * at_s), Order(word, "", "ros")) for at_s, word in orders]))


@pytest.mark.parametrize(
    ("last", "seen_s"), [("nothing", (0.95, 1.0)), (LOOSE, (0.6, 0.62))], ids=["silent", "loose"]
)
def test_who_says_held_is_missed_within_half_a_second(
    last: str, seen_s: tuple[float, float]
) -> None:
    held = [(0.1 * k, HELD) for k in range(1, 6)]
    kept = sent(*held, (0.1, "engage"), *([(0.6, last)] if last == LOOSE else []), (1.1, "engage"))
    done = operate(bench(STILL, FREE, *BARE), "", 1.5, live=[kept])
    assert done.words() == [
        ("engage", "aligning"), ("aligned", "engaged"), ("released", "holding"),
        ("engage", "aligning"), ("aligned", "engaged"),  # nobody has to go on but who began
    ]  # fmt: skip
    released = done.control.journal.entries[2]
    assert seen_s[0] <= released.at_s <= seen_s[1]
    assert released.text == "ros: the dead-man was released"


def test_who_said_held_at_rest_does_not_stand_in_the_way_of_others() -> None:
    kept = sent((0.1, HELD), (0.8, "engage"))
    done = operate(bench(STILL, FREE, *BARE), "", 1.2, live=[kept])
    assert done.words() == [("engage", "aligning"), ("aligned", "engaged")]
