"""Output files: one place for their modes, and for write errors.

The rule: every output file (recording, summary, report, figures, tables, the traceback of an error)
and its directory get the modes of the user's umask, and no code sets any other. With umask 022 that
is 0644 in 0755, with 077 it is 0600 in 0700.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from tautwave.errors import ConfigError, WritingError

MODE = 0o666
"""Mode before the umask."""


def create(path: str | os.PathLike[str], *, replace: bool = True) -> int:
    """Return the descriptor of a new file, open for writing; raises OSError.

    An existing file is emptied, or with `replace` False refused.
    """
    flags = os.O_WRONLY | os.O_CREAT | os.O_CLOEXEC | (os.O_TRUNC if replace else os.O_EXCL)
    return os.open(path, flags, MODE)


@contextmanager
def writing(path: str | os.PathLike[str]) -> Iterator[None]:
    """Turn an error while writing `path` into one sentence.

    Raises
    ------
    WritingError
        Instead of any OSError.
    """
    try:
        yield
    except WritingError:
        raise
    except OSError as err:
        raise WritingError(f"{os.fspath(path)}: cannot be written: {reason(err)}") from err


def reason(error: OSError) -> str:
    """Return the system's error message."""
    return error.strerror or str(error) or type(error).__name__


def refuse_unwritable(places: Iterable[Path], command: str, what: str) -> None:
    """Refuse before all the questions of a command what could not be written after them.

    Raises
    ------
    ConfigError
        A place may not be written to.
    """
    for place in places:
        if not os.access(place, os.W_OK):
            raise ConfigError(
                f"{command}: {place} is not writable, and {what} is stored next to the rig file; "
                "copy the rig to a directory that you can write to"
            )


def make_directory(path: Path) -> None:
    """Make a directory and its parents.

    Raises
    ------
    ConfigError
        A file has its name.
    WritingError
        The disk is full, or permission is denied.
    """
    with writing(path):
        try:
            path.mkdir(parents=True, exist_ok=True)
        except (FileExistsError, NotADirectoryError) as err:
            raise ConfigError(f"{path}: cannot be a directory: {reason(err)}") from err


def write_bytes(path: Path, content: bytes | Iterable[bytes]) -> None:
    """Replace a file in one step: a full disk or a kill leaves the old one, never half a new one.

    What is too large for memory comes in pieces.

    Raises
    ------
    WritingError
        It cannot be written.
    """
    draft = path.with_name(f"{path.name}.part")
    with writing(path):
        try:
            with open(create(draft), "wb") as file:
                file.writelines([content] if isinstance(content, bytes) else content)
            os.replace(draft, path)
        except BaseException:
            with suppress(OSError):
                draft.unlink()
            raise


def write_text(path: Path, text: str) -> None:
    """Replace a text file in one step, in UTF-8; as `write_bytes`."""
    write_bytes(path, text.encode("utf-8"))


def json_ready(value: Any) -> Any:
    """Return data for JSON: None for non-finite numbers."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {key: json_ready(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [json_ready(inner) for inner in value]
    return value
