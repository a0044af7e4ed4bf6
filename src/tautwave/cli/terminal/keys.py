"""Where the commands of an operated rig come from on the command line: keys, a file, stdin."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tautwave.errors import ConfigError
from tautwave.runtime.operate.commands import (
    Descriptor,
    Lines,
    Order,
    Script,
    Source,
    read_keys,
    read_script,
)
from tautwave.runtime.operate.states import STOP

LARGEST = 1 << 20
"""[bytes] of a file of commands."""


def command_sources(
    commands: str | None, *, end_with_input: bool = False
) -> tuple[Sequence[Source], Sequence[Source]]:
    """Return the sources with times and the live ones that `--commands` names.

    Raises
    ------
    ConfigError
        The file cannot be read, a line is wrong, or there is no input that could end.
    """
    if end_with_input and commands != "-":
        raise ConfigError("--end-with-input requires --commands -")
    if commands is None:
        return (), ()
    if commands == "-":
        last = (Order(STOP, "", "end of input"),) if end_with_input else ()
        return (), (Descriptor(sys.stdin.fileno(), Lines("stdin"), last),)
    from tautwave.config.guard import read_guarded

    text = read_guarded(Path(commands), "file of commands", LARGEST)
    return (Script(read_script(text, commands)),), ()


@contextmanager
def keys_of(rig: Any, clock: str, commands: str | None) -> Iterator[Sequence[Source]]:
    """Give the keys of the terminal, unbuffered inside the block, if there is one to type at."""
    wanted = rig.operate is not None and clock == "real" and commands != "-"
    if not (wanted and sys.stdin is not None and sys.stdin.isatty()):
        yield ()
        return
    import termios
    import tty

    terminal = sys.stdin.fileno()
    before = termios.tcgetattr(terminal)
    tty.setcbreak(terminal)  # Ctrl-C stays what it is
    try:
        yield (Descriptor(terminal, read_keys, fresh=True),)
    finally:
        termios.tcsetattr(terminal, termios.TCSADRAIN, before)
