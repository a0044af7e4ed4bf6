"""Opening files: a pipe is refused without waiting, a device without reading it endlessly."""

from __future__ import annotations

import errno
import hashlib
import os
import stat
from typing import Any, BinaryIO

NO_FILE = "a pipe or device, not a file; save its output as a file first"


def open_file(path: str | os.PathLike[str], buffering: int = -1) -> BinaryIO:
    """Open a file to read its bytes.

    Raises
    ------
    OSError
        It cannot be opened, or is no regular file.
    """
    # Without waiting: the opening of a pipe would, until somebody writes into it.
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    mode = os.fstat(descriptor).st_mode
    if not stat.S_ISREG(mode):
        os.close(descriptor)
        if stat.S_ISDIR(mode):
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), os.fspath(path))
        raise OSError(errno.EINVAL, NO_FILE, os.fspath(path))
    file: Any = os.fdopen(descriptor, "rb", buffering)
    return file  # type: ignore[no-any-return]


def read_file(path: str | os.PathLike[str], most: int) -> bytes:
    """Return the bytes of a file.

    Raises
    ------
    OSError
        It cannot be read, is no regular file, or has more than `most` bytes.
    """
    with open_file(path) as file:
        data = file.read(most + 1)
    if len(data) > most:
        raise OSError(errno.EFBIG, f"larger than {most // 1024} KiB", os.fspath(path))
    return data


def digest_of(path: str | os.PathLike[str]) -> str:
    """Return the SHA-256 of a file, of any size, in hexadecimal digits; errors as `open_file`."""
    file: Any
    with open_file(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
