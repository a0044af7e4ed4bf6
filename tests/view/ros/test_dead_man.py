"""What a topic's Bools come to: `held` and `engage`, or nothing."""

from __future__ import annotations

from collections.abc import Sequence

from tautwave.view.ros.dead_man import DeadMan

MS = 1_000_000
T, F = True, False


def heard(*looks: tuple[int, Sequence[bool]]) -> list[tuple[int, str]]:
    """Return when [ms] what was sent, with a look every 10 ms and messages at some of them."""
    sent: list[tuple[int, str]] = []
    now = 0
    man = DeadMan(lambda line: sent.append((now, line)))
    messages = dict(looks)
    for now in range(0, max(messages) + 700, 10):
        man.hear(messages.get(now, ()), now * MS)
    return sent


def test_a_true_after_a_false_engages_and_each_one_is_passed_on() -> None:
    assert heard((0, [F]), (10, [T]), (110, [T]), (210, [T, T]), (220, [F])) == [
        (10, "held"), (10, "engage"), (110, "held"), (210, "held"), (210, "held"), (220, "loose"),
    ]  # fmt: skip


def test_a_true_without_a_false_before_it_is_nothing() -> None:
    assert heard((0, [T]), (100, [T]), (200, [T])) == []


def test_silence_lets_go_and_what_comes_after_it_is_not_held() -> None:
    found = heard((0, [F, T]), (100, [T]), (700, [T]), (800, [F]), (810, [T]))
    assert found == [
        (0, "held"), (0, "engage"), (100, "held"), (610, "loose"), (810, "held"), (810, "engage"),
        (1320, "loose"),
    ]  # fmt: skip


def test_what_waited_while_this_process_stood_still_is_not_of_now() -> None:
    sent: list[str] = []
    man = DeadMan(sent.append)
    man.hear([F], 0)
    man.hear([T], 10 * MS)
    man.hear([T, F, T, T], 400 * MS)
    man.hear([T], 410 * MS)
    assert sent == ["held", "engage", "loose"]
    assert man.state == "waits for a false"
    man.hear([F], 420 * MS)
    assert man.state == "loose"
    man.hear([T], 430 * MS)
    assert man.state == "held"
