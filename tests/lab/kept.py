"""Numbers of measurements that are kept, so that one night can be compared with another."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from pathlib import Path

import click

from tautwave.bench.result import Suite

append_option = click.option(
    "--append",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Append all numbers to this file, a line of JSON each time.",
)


def append_suites(file: Path | None, suites: Sequence[Suite]) -> None:
    """Append the numbers of suites to a file, each a line of JSON with its time [s since 1970]."""
    if file is None:
        return
    with file.open("a", encoding="utf-8") as kept:
        for suite in suites:
            kept.write(json.dumps({"at": time.time(), **suite.as_dict()}) + "\n")
