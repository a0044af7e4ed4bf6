"""The hand-written C of the yardsticks, compiled by gcc."""

from __future__ import annotations

import subprocess
from collections.abc import Sequence
from pathlib import Path

from tautwave.errors import ConfigError


def compile_text(text: str, directory: Path, flags: Sequence[str]) -> Path:
    """Compile a C file into a shared library in `directory`; there is a gcc.

    Raises
    ------
    ConfigError
        It refuses the text.
    """
    source = directory / "kernel.c"
    library = directory / "kernel.so"
    source.write_text(text, encoding="utf-8")
    command = ["gcc", *flags, "-o", str(library), str(source), "-lm"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise ConfigError(f"gcc refuses the text: {done.stderr.strip()[:2000]}")
    return library
