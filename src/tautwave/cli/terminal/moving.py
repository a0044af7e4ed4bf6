"""The rig that an identification moves: how its buses are reached, where its files go."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tautwave.cli.terminal.progress import Progress

if TYPE_CHECKING:
    from tautwave.config import Rig


@contextmanager
def moved(
    rig: Rig, options: Mapping[str, Any], words: str
) -> Iterator[tuple[Path, dict[str, Any]]]:
    """Say how each bus is reached; give a directory and what every identification takes.

    `words` stand before the progress. A directory in which nothing was written is removed.
    """
    from tautwave.cli.run import fresh_directory
    from tautwave.session import describe_ways

    ways = {name: options[name] for name in ("clock", "simulate", "attach")}
    for sentence in describe_ways(rig, **ways):
        click.echo(sentence, err=options["as_json"])
    directory = fresh_directory(options["out"], f"identify-{rig.name}")
    try:
        with Progress(words) as progress:
            yield (
                directory,
                {
                    **ways,
                    "out": directory,
                    "duration_s": options["duration"],
                    "allow_uncertified": options["allow_uncertified"],
                    "progress": progress,
                },
            )
    finally:
        with suppress(OSError):
            directory.rmdir()  # only an empty one: a refused rig leaves nothing
