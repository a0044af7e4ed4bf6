"""Signals in each part of a run: raised, handed on, kept waiting, and given back."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from contextlib import suppress

import pytest

from tautwave.runtime.interrupts import SIGNALS, Interrupted, interrupts


@pytest.fixture(autouse=True)
def handlers() -> Iterator[None]:
    before = {number: signal.getsignal(number) for number in SIGNALS}
    yield
    assert {number: signal.getsignal(number) for number in SIGNALS} == before


@pytest.mark.parametrize("number", SIGNALS)
def test_a_signal_is_raised_once_with_the_shells_own_code(number: int) -> None:
    with interrupts():
        with pytest.raises(Interrupted) as caught:
            os.kill(os.getpid(), number)
        os.kill(os.getpid(), number)  # while the first one is being cleaned up after
    assert caught.value.exit_code == 128 + number


def test_the_loop_hears_every_signal_inside_its_block() -> None:
    heard: list[int] = []
    with interrupts() as outer, interrupts() as inner:
        assert inner is outer
        with inner.calling(lambda: heard.append(outer.number)):
            for number in SIGNALS:
                os.kill(os.getpid(), number)
    assert heard == list(SIGNALS)


def test_a_signal_after_the_loop_waits_for_the_report() -> None:
    with interrupts() as heard:
        with heard.calling(lambda: None):
            pass
        os.kill(os.getpid(), signal.SIGTERM)
        with pytest.raises(Interrupted, match="SIGTERM"), heard.raised():
            pytest.fail("the report was begun")
        os.kill(os.getpid(), signal.SIGTERM)  # ignored: nothing is left to end


def test_a_signal_during_the_report_ends_it() -> None:
    with interrupts() as heard, pytest.raises(Interrupted, match="Ctrl-C"), heard.raised():
        os.kill(os.getpid(), signal.SIGINT)


def test_nohup_is_respected() -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with interrupts():
            os.kill(os.getpid(), signal.SIGHUP)
            assert signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)


def test_a_process_that_ends_can_stay_deaf() -> None:
    before = {number: signal.getsignal(number) for number in SIGNALS}
    try:
        with interrupts() as heard:
            heard.ignore_further_signals()
        assert {signal.getsignal(number) for number in SIGNALS} == {signal.SIG_IGN}
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@interrupts()
def import_interrupted() -> None:
    try:
        os.kill(os.getpid(), signal.SIGTERM)
    except KeyboardInterrupt:
        raise ImportError("numpy._core failed to import") from None


def test_an_error_that_an_interruption_causes_is_the_interruption() -> None:
    with pytest.raises(Interrupted, match="SIGTERM") as caught:
        import_interrupted()
    assert caught.value.exit_code == 143


def test_an_interruption_that_was_dropped_is_raised_before_anything_moves() -> None:
    with interrupts() as heard:
        with suppress(Interrupted):  # as in a callback from C
            os.kill(os.getpid(), signal.SIGTERM)
        with pytest.raises(Interrupted, match="SIGTERM"), heard.calling(lambda: None):
            pytest.fail("the loop was begun")


@interrupts()
def fail_after_the_report(*, early: bool) -> None:
    with interrupts() as heard:
        if early:
            with heard.calling(lambda: None):
                pass
            os.kill(os.getpid(), signal.SIGTERM)
        with suppress(Interrupted), heard.raised():
            os.kill(os.getpid(), signal.SIGTERM)
        raise ValueError("later")


@pytest.mark.parametrize("early", [False, True])
def test_what_ends_the_report_says_nothing_about_a_later_error(early: bool) -> None:
    with pytest.raises(ValueError, match="later"):
        fail_after_the_report(early=early)
