"""Much work by seed, in pieces: it reports its progress, and a file lets it continue."""

from __future__ import annotations

import functools
import json
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from tautwave.config.guard import parse_json, read_guarded
from tautwave.errors import ConfigError
from tautwave.sweep.pool import Piece, ProcessPool, in_process

LARGEST = 1 << 28

Begin = Callable[[], Callable[[Piece], Any]]
"""Makes the worker of a process: what it returns of a piece can be written as JSON."""


class Work(NamedTuple):
    """What is done piece by piece.

    `command` names the command whose file it is, `word` what its seeds are; `same`, of JSON values:
    what a kept piece has to agree with to be of this work (its sources, its settings).
    """

    command: str
    word: str
    size: int
    begin: Begin
    same: dict[str, Any]


def run_pieces(
    work: Work,
    first: int,
    count: int,
    *,
    jobs: int = 1,
    keep: Path | None = None,
    tell: Callable[[str], None] = lambda _: None,
) -> Iterator[Any]:
    """Return what was found of every piece, by seed.

    Parameters
    ----------
    work : Work
        What is done.
    first, count : int
        First seed, and how many.
    jobs : int
        Processes.
    keep : Path, optional
        File of the pieces that are done: what it has of the same work is not done again.
    tell : callable
        Called with how far it is, fifty times or so.

    Raises
    ------
    ConfigError
        The file is something else, or cannot be written.
    """
    end = first + count
    pieces = [(at, min(at + work.size, end)) for at in range(first, end, work.size)]
    done = {} if keep is None else _read(keep, work)
    left = [piece for piece in pieces if piece not in done]
    runs = ProcessPool(min(jobs, len(left))) if jobs > 1 and len(left) > 1 else in_process
    results = runs(functools.partial(_begin, work.begin), left)
    often = max(1, len(pieces) // 50)
    try:
        for number, (piece, found) in enumerate(results):
            if number % often == 0:
                tell(f"{work.word}, {len(left) - number} of {len(pieces)} pieces left")
            done[piece] = found
            if keep is not None:
                _append(keep, {**_whose(work), "piece": piece, "found": found})
    finally:
        results.close()
    return iter([done[piece] for piece in pieces])


def _begin(begin: Begin) -> Callable[[Piece], tuple[Piece, Any]]:
    """Return a worker that says which piece it has done."""
    worker = begin()
    return lambda piece: (piece, worker(piece))


def _whose(work: Work) -> dict[str, Any]:
    """Return what a kept piece of a work says of it."""
    return {"command": work.command, **work.same}


def _append(keep: Path, line: dict[str, Any]) -> None:
    try:
        with keep.open("a", encoding="utf-8") as file:
            file.write(json.dumps(line) + "\n")
    except OSError as err:
        raise ConfigError(f"{keep}: cannot be written: {err.strerror}") from err


def _read(keep: Path, work: Work) -> dict[Piece, Any]:
    """Return the pieces that a file has of a work; a last line that was cut off is left out."""
    found: dict[Piece, Any] = {}
    for number, line in _lines(keep):
        try:
            one = parse_json(line)
            begin, end = one["piece"]
            whose, result = one["command"], one["found"]
        except (ValueError, KeyError, TypeError):
            whose = ""
        if whose != work.command:
            raise ConfigError(
                f"{keep}:{number}: no piece of `{work.command} --keep`; name another file"
            )
        if _whose(work).items() <= one.items():
            found[int(begin), int(end)] = result
    return found


def _lines(keep: Path) -> Sequence[tuple[int, str]]:
    if not keep.exists():
        return ()
    text = read_guarded(keep, "file of pieces that are done", LARGEST)
    whole = text[: text.rfind("\n") + 1]
    if whole != text:
        keep.write_text(whole, encoding="utf-8")
    return tuple(enumerate(whole.splitlines(), 1))
