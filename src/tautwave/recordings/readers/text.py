"""Tables of text: CSV as programs write it, and numbers between blanks; with a heading or none."""

from __future__ import annotations

import csv
import itertools
import math
from collections.abc import Iterator, Sequence
from io import TextIOWrapper
from pathlib import Path
from typing import NamedTuple, TextIO

import numpy as np

from tautwave.errors import ConfigError
from tautwave.reading import open_file
from tautwave.recordings.readers.shared import GREATEST, MEND, Array, wrong
from tautwave.recordings.stated import Stated

MAX_ROWS = 10_000_000
"""Of CSV text: nearly three hours at 1 kHz."""
LONGEST_LINE = 1 << 20
"""Characters of a line of CSV text."""
SEPARATORS = (",", ";", "\t")


def _text(path: Path) -> TextIO:
    return TextIOWrapper(open_file(path), encoding="utf-8-sig", newline="")


def _lines(path: Path, file: TextIO) -> Iterator[str]:
    """Yield lines; a file without any would be read whole as the first one."""
    while line := file.readline(LONGEST_LINE):
        if len(line) == LONGEST_LINE:
            raise ConfigError(f"{path}: a line of over {LONGEST_LINE} characters, so not CSV text")
        yield line


class _Heading(NamedTuple):
    """Names of the columns, what separates them (blanks: ''), and the lines before the numbers.

    `first` is the line that was read for it where that holds numbers already.
    """

    names: list[str]
    separator: str
    before: int
    first: str = ""


def _heading(path: Path, file: TextIO, stated: Stated) -> _Heading:
    number, line, comment = 1, file.readline(LONGEST_LINE), ""
    while line.startswith(("#", "%")):
        number, comment, line = number + 1, line, file.readline(LONGEST_LINE)
    separator = max(SEPARATORS, key=line.count)
    if separator not in line:
        separator = ""
    names = _cells(line, separator)
    if not names or any(_number(name, separator) is None for name in names):
        if stated.columns:
            raise ConfigError(
                f"{path}:{number}: names its columns already: {', '.join(names)}; leave "
                "--columns out"
            )
        return _Heading(names, separator, number)
    given = list(stated.columns) or _cells(comment.lstrip("#% "), separator)
    if len(given) != len(names) or not all(given):
        how = f"got {len(stated.columns)}" if stated.columns else "starts with numbers"
        raise ConfigError(
            f"{path}:{number}: {how}; name its {len(names)} columns with --columns A,B,... (in a "
            "rig `columns: [A, B, ...]`)"
        )
    return _Heading(given, separator, number - 1, line)


def _cells(line: str, separator: str) -> list[str]:
    if not separator:
        return line.split()
    return [cell.strip() for cell in next(csv.reader([line], delimiter=separator), [])]


def _rows(path: Path, file: TextIO, head: _Heading) -> Iterator[tuple[int, list[str]]]:
    """Yield the number of each line with numbers, and its cells."""
    lines = itertools.chain([head.first] if head.first else [], _lines(path, file))
    if not head.separator:
        for number, line in enumerate(lines, start=head.before + 1):
            yield number, line.split()
        return
    rows = csv.reader(lines, delimiter=head.separator)
    for row in rows:
        yield head.before + rows.line_num, row


def _number(cell: str, separator: str) -> float | None:
    """Return a number, with a decimal comma where commas separate nothing; None if it is none."""
    try:
        return float(cell if separator == "," else cell.replace(",", "."))
    except ValueError:
        return None


def text_names(path: Path, stated: Stated) -> list[str]:
    """Return the names of the columns of a text file.

    Raises
    ------
    ConfigError
        It cannot be read as text, or its heading contradicts `stated`.
    """
    try:
        with _text(path) as stream:
            return _heading(path, stream, stated).names
    except (OSError, ValueError, csv.Error) as err:
        if isinstance(err, ConfigError):
            raise
        raise ConfigError(f"{path}: cannot be read as CSV text: {err}") from err


def text_columns(
    path: Path, wanted: Sequence[str], stated: Stated, *, holes: bool
) -> dict[str, Array]:
    """Read some columns of a text file; the first of them is the time, unless a rate is stated.

    Each is of shape (rows,), in the file's units; with `holes` an empty cell is NaN.

    Raises
    ------
    ConfigError
        It cannot be read, lacks a column, has a cell that is not a finite number, times that do not
        increase, fewer than two rows, or more than `MAX_ROWS`.
    """
    timed = stated.rate_hz is None
    rows_read: list[list[float]] = []
    try:
        with _text(path) as file:
            head = _heading(path, file, stated)
            header, separator = head.names, head.separator
            for name in wanted:
                if name not in header:
                    raise ConfigError(
                        f"{path}: there is no column {name!r}; "
                        f"available: {', '.join(header) or 'none, the file is empty'}"
                    )
            places = [header.index(name) for name in wanted]
            for number_of, row in _rows(path, file, head):
                if not any(cell.strip() for cell in row):
                    continue
                numbers: list[float] = []
                for name, index in zip(wanted, places, strict=True):
                    cell = row[index].strip() if index < len(row) else ""
                    number = _number(cell, separator) if cell else math.nan
                    missing = number is not None and math.isnan(number)
                    if number is None or not (
                        abs(number) < GREATEST or (missing and holes and (numbers or not timed))
                    ):
                        raise ConfigError(
                            f"{path}:{number_of}: column {name!r} holds {cell!r}, "
                            f"{wrong(number)}; {MEND}"
                        )
                    numbers.append(number)
                if timed and rows_read and not numbers[0] > rows_read[-1][0]:
                    raise ConfigError(
                        f"{path}:{number_of}: time must increase, "
                        f"but {numbers[0]:.12g} follows {rows_read[-1][0]:.12g}"
                    )
                if len(rows_read) == MAX_ROWS:
                    raise ConfigError(f"{path}: more than {MAX_ROWS} rows; shorten or decimate it")
                rows_read.append(numbers)
    except (OSError, UnicodeDecodeError, csv.Error) as err:
        raise ConfigError(f"{path}: the recording cannot be read: {err}") from err
    if len(rows_read) < 2:
        raise ConfigError(f"{path}: a recording needs at least two rows, it has {len(rows_read)}")
    return dict(zip(wanted, np.array(rows_read).T.copy(), strict=True))
