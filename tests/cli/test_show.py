"""Tables on a terminal and in a pipe, and progress that never blocks the loop."""

from __future__ import annotations

import fcntl
import io
import json
import os
import pty
import re
import signal
import struct
import subprocess
import sys
import termios
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace
from unicodedata import category

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave.cli.rigs.talking import Screen
from tautwave.cli.terminal import progress_bar
from tautwave.cli.terminal.live import room
from tautwave.cli.terminal.progress import Progress
from tautwave.cli.terminal.show import plain, plain_lines
from tautwave.cli.terminal.streams import escaped, warn
from tautwave.tables import Cell, Table
from tests.view.served import Run

TABLE = Table(
    "Tracking", ("pair", ">rms"), [("wrist", "1.5 mrad"), ("elbow", Cell("12 µrad", "red"))]
)


def test_what_others_wrote_does_not_command_the_terminal(capfd: pytest.CaptureFixture[str]) -> None:
    text = "drive \x1b[31m\x9b2J\a\u202eevil\ud800 \N{MICRO SIGN}m\n\tnext"
    assert escaped(text) == "drive \\x1b[31m\\x9b2J\\x07\\u202eevil\\ud800 \N{MICRO SIGN}m\n\tnext"
    assert list(plain_lines(Table("a\x1b[2J", ("b",), [("c\x1b]0;t\a",)]))) == [
        "a\\x1b[2J", "  b", "  c\\x1b]0;t\\x07",
    ]  # fmt: skip
    warn("bus \x1b[2J")
    assert capfd.readouterr().err == "bus \\x1b[2J\n"


@given(st.text())
def test_what_is_printable_stays(text: str) -> None:
    assert escaped(escaped(text)) == escaped(text)
    if text.isprintable():
        assert escaped(text) == text
    assert all(one.isprintable() or category(one)[0] in "CZ" for one in escaped(text))


def test_plain_tables_are_aligned() -> None:
    assert list(plain_lines(TABLE)) == [
        "Tracking",
        "  pair        rms",
        "  wrist  1.5 mrad",
        "  elbow   12 urad",
    ]


def test_plain_figures_can_be_read_by_a_script() -> None:
    space = "\N{NARROW NO-BREAK SPACE}"
    assert plain(f"2.1{space}×{space}10⁻¹⁴ of gross flow") == "2.1e-14 of gross flow"
    assert plain("−3 µs") == "-3 us"


def test_a_terminal_gets_a_table_with_colours() -> None:
    code = (
        "from tautwave.cli.terminal.show import *\n"
        "show([Table('Title', ('a',), [(Cell('bad', BAD),)])])"
    )
    main, side = pty.openpty()
    try:
        env = os.environ | {"TERM": "xterm-256color", "COLUMNS": "80"}
        env.pop("NO_COLOR", None)
        subprocess.run([sys.executable, "-c", code], stdout=side, check=True, env=env)
        printed = os.read(main, 10_000).decode()
    finally:
        os.close(main)
        os.close(side)
    assert "\x1b[1mTitle" in printed
    assert "bad" in printed


def test_a_pipe_gets_a_line_every_tenth() -> None:
    stream = io.StringIO("".join(f"{i / 200:.4f}\trunning\n" for i in range(201)) + "junk\n")
    out = io.StringIO()
    progress_bar.draw_lines(stream, out, "bench")
    lines = out.getvalue().splitlines()
    assert lines[0] == "bench:   0 %  running"
    assert lines[-1] == "bench: 100 %  running"
    assert len(lines) == 11


def test_a_terminal_gets_a_bar_that_is_gone_at_the_end() -> None:
    main, side = pty.openpty()
    try:
        with subprocess.Popen(
            [sys.executable, "-P", progress_bar.__file__, "bench"],
            stdin=subprocess.PIPE,
            stderr=side,
            env=os.environ | {"TERM": "xterm"},
        ) as child:
            child.communicate(b"0.5\trunning\n0.9\trunning\n")
        printed = os.read(main, 100_000).decode()
    finally:
        os.close(main)
        os.close(side)
    assert "bench" in printed
    assert "\x1b[2K" in printed, "the bar erases itself"


END = "the end"


def on_a_terminal(columns: int, talk: Callable[[Screen], None]) -> str:
    main, side = pty.openpty()
    fcntl.ioctl(side, termios.TIOCSWINSZ, struct.pack("HHHH", 12, columns, 0, 0))
    try:
        with open(side, "w", encoding="utf-8", closefd=False) as out:
            talk(Screen(out))
            out.write(END)
        printed = ""
        while END not in printed:
            printed += os.read(main, 100_000).decode()
        return printed.removesuffix(END)
    finally:
        os.close(main)
        os.close(side)


def test_a_guided_procedure_wraps_sentences_and_replaces_numbers() -> None:
    def talk(screen: Screen) -> None:
        screen.say("  master: bring j1, j2, j3, j4, j5, j6 to the zero pose and hold")
        screen.show("j1 +0.1\nj2 +0.2")
        screen.show("j1 +0.3\nj2 +0.4")
        screen.say("well done")

    printed = on_a_terminal(40, talk)
    printed = re.sub("\r(\x1b\\[K)?", "", printed)
    first, replaced, last = re.split(r"\x1b\[2A\x1b\[J|(?=well)", printed)
    lines = first.splitlines()
    assert max(map(len, lines)) <= 40
    assert " ".join(" ".join(lines[:2]).split()).endswith("j6 to the zero pose and hold")
    assert lines[2:] == ["j1 +0.1", "j2 +0.2"]
    assert replaced == "j1 +0.3\nj2 +0.4\n"
    assert last == "well done\n"


def test_a_guided_procedure_is_seen_before_it_goes_on() -> None:
    main, side = pty.openpty()
    os.set_blocking(main, False)
    try:
        with open(side, "w", buffering=8192, encoding="utf-8", closefd=False) as out:
            screen = Screen(out)
            for write, text in ((screen.say, "bring j1 to zero"), (screen.show, "j1 +0.1")):
                write(text)
                assert text in os.read(main, 1000).decode()
    finally:
        os.close(main)
        os.close(side)


def test_a_guided_procedure_in_a_pipe_is_one_line_a_sentence() -> None:
    out = io.StringIO()
    screen = Screen(out)
    screen.say("word " * 40)
    screen.show("numbers")
    assert out.getvalue() == f"{'word ' * 40}\n"


@pytest.mark.slow
def test_a_run_is_drawn_in_the_room_there_is_with_what_was_said_last(tmp_path: Path) -> None:
    run = Run(tmp_path)
    entry = {"at_s": 1.0, "word": "engage", "source": "key", "text": "engage: " + 20 * "refused "}
    run.recorder.tell(json.dumps([[1, entry]]))
    main, side = pty.openpty()
    fcntl.ioctl(side, termios.TIOCSWINSZ, struct.pack("HHHH", 12, 40, 0, 0))
    os.set_blocking(main, False)
    printed = b""
    try:
        with subprocess.Popen(
            [sys.executable, "-P", progress_bar.__file__, "bench", str(tmp_path)],
            stdin=subprocess.PIPE, stderr=side, env=os.environ | {"TERM": "xterm"},
        ) as child:  # fmt: skip
            assert child.stdin is not None
            child.stdin.write(b"0.1\trunning\n")
            child.stdin.flush()
            until = time.monotonic() + 60.0
            while printed.count(b"space engage") < 3 and time.monotonic() < until:
                run.commit(5)
                with suppress(BlockingIOError):
                    printed += os.read(main, 100_000)
                time.sleep(0.02)
            child.stdin.close()
    finally:
        os.close(main)
        os.close(side)
        run.close()
    shown = re.sub(r"\x1b\[\??\d*[A-Za-z]", "", printed.decode()).splitlines()
    assert any(line.startswith("last  1.0 s, engage: refused") for line in shown)
    assert max(len(line) for line in shown[:20]) <= 40  # else a line wraps, and is never erased


def test_progress_goes_to_a_process_of_its_own(capfd: pytest.CaptureFixture[str]) -> None:
    with Progress("bench") as progress:
        progress(0.0, "engaging")
        progress(0.5, "running")
    assert capfd.readouterr().err.splitlines() == [
        "bench:   0 %  engaging",
        "bench:  50 %  running",
    ]


def test_progress_is_written_every_half_percent_and_when_the_word_changes(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    there, here = os.pipe()
    with os.fdopen(there, "r") as lines:
        child = SimpleNamespace(stdin=os.fdopen(here, "wb"), wait=lambda timeout: 0)
        monkeypatch.setattr(subprocess, "Popen", lambda *_, **__: child)
        with Progress("bench") as progress:
            for percent in (0.0, 0.4, 0.6, 1.0, 1.2):
                progress(percent / 100.0, "running")
            progress(0.012, "reporting")
            progress(0.012, "reporting")
            progress(0.0, "reporting")
        assert lines.read().splitlines() == [
            *("0.0000\trunning", "0.0060\trunning", "0.0120\trunning"),
            *("0.0120\treporting", "0.0000\treporting"),
        ]


@pytest.mark.slow
def test_progress_never_waits_for_a_stopped_reader() -> None:
    progress = Progress("bench")
    os.kill(progress._child.pid, signal.SIGSTOP)  # as Ctrl-S does to whoever writes to a terminal
    try:
        for count in range(100_000):  # more than any pipe holds
            progress(count / 1e5, f"step {count}")
    finally:
        os.kill(progress._child.pid, signal.SIGCONT)
        progress.__exit__()


def test_progress_survives_the_death_of_its_reader() -> None:
    with Progress("bench") as progress:
        progress._child.kill()
        progress._child.wait()
        for count in range(100):
            progress(count / 100.0, "running")


def test_ctrl_c_leaves_the_bar_to_the_run(tmp_path: Path) -> None:
    """The terminal sends SIGINT to both; the bar goes on until the run has ramped down."""
    with (
        (tmp_path / "err").open("w+") as err,
        subprocess.Popen(
            [sys.executable, "-P", progress_bar.__file__, "bench"],
            stdin=subprocess.PIPE,
            stderr=err,
        ) as child,
    ):
        assert child.stdin is not None
        child.stdin.write(b"0.5\trunning\n")
        child.stdin.flush()
        give_up = time.monotonic() + 60.0
        while not (tmp_path / "err").read_text() and time.monotonic() < give_up:
            time.sleep(0.01)  # its handler is set before its first line
        child.send_signal(signal.SIGINT)
        child.communicate(b"0.6\tramping down\n")
        assert child.returncode == 0
    assert "ramping down" in (tmp_path / "err").read_text()


@pytest.mark.parametrize(
    ("rows", "columns", "found"),
    [(40, 120, (120, 39)), (2, 1, (1, 1)), (1, 120, (80, 1_000)), (40, 0, (80, 1_000))],
)
def test_a_terminal_that_does_not_tell_its_size_has_room_for_everything(
    rows: int, columns: int, found: tuple[int, int]
) -> None:
    ours, theirs = os.openpty()
    try:
        fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", rows, columns, 0, 0))
        assert room(theirs) == found
    finally:
        os.close(ours)
        os.close(theirs)
