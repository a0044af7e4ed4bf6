"""Draw the progress that arrives on stdin. `progress.py` runs it as a script."""

from __future__ import annotations

import os
import select
import signal
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TextIO

STEP = 0.1
LOOK_S = 0.2
KEYS = "space engage/disengage  c clutch  p hold  r rest  e s f b episode  q stop"


def reports(stream: TextIO) -> Iterator[tuple[float, str]]:
    """Fraction and text of each line; invalid lines are dropped."""
    for line in stream:
        number, _, text = line.rstrip("\n").partition("\t")
        try:
            fraction = float(number)
        except ValueError:
            continue
        yield min(max(fraction, 0.0), 1.0), text


def draw_lines(stream: TextIO, out: TextIO, title: str) -> None:
    """One line every 10 % and for each new activity."""
    shown, activity = -STEP, ""
    for fraction, text in reports(stream):
        if text != activity or fraction >= shown + STEP - 1e-9:
            shown, activity = fraction, text
            out.write(f"{title}: {100.0 * fraction:3.0f} %  {text}\n")
            out.flush()


def draw_bar(stream: TextIO, title: str) -> None:
    """Draw a bar from the first report on, erased at the end: the summary follows."""
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        Progress,
        TaskProgressColumn,
        TextColumn,
        TimeRemainingColumn,
    )

    columns = (
        TextColumn("{task.fields[title]}", style="bold"),
        BarColumn(),
        TaskProgressColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.description}"),
    )
    coming = reports(stream)
    for fraction, text in coming:  # a guided procedure talks before it has any
        with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
            task = bar.add_task(text, total=1.0, title=title)
            bar.update(task, completed=fraction)
            for later, text in coming:
                bar.update(task, completed=later, description=text)


def draw_run(stream: TextIO, title: str, directory: str) -> None:
    """Draw one line a pair and the loop's health while the run moves, a bar otherwise."""
    for fraction, text in reports(stream):
        if text == "running":
            draw_pairs(stream, Path(directory))
            break
        sys.stderr.write(f"\r\x1b[K{title}: {text}")
        sys.stderr.flush()
        if fraction >= 1.0:
            break
    sys.stderr.write("\r\x1b[K")
    draw_bar(stream, title)


def draw_pairs(stream: TextIO, directory: Path) -> None:
    """Draw the newest row now and then until the loop has finished."""
    from tautwave.cli.terminal.live import Health, live_lines, news_lines, room, watch_health
    from tautwave.errors import RecordingError
    from tautwave.runtime.tap import Tap
    from tautwave.view.watched import read_live

    try:
        live = read_live(directory)
        tap = Tap.of_run(live)
    except RecordingError:
        return  # a bar will do
    health, shown, due = Health(), 0, 0.0
    keys = [KEYS] if "operation.state" in live.columns else []
    while not tap.closed:
        if select.select([stream], [], [], LOOK_S)[0] and not os.read(stream.fileno(), 65536):
            break
        if time.monotonic() < due:
            continue
        due = time.monotonic() + LOOK_S
        rows = tap.take()
        health = watch_health(rows, live, health)
        if rows:
            columns, most = room(sys.stderr.fileno())
            said = news_lines(tap.news(), columns)
            lines = [*live_lines(rows[-1], live, health, tap.missed), *said, *keys]
            lines = [line[:columns] for line in lines[:most]]  # a wrapped line is not erased
            up = f"\x1b[{shown}A\x1b[J" if shown else "\r\x1b[K"
            sys.stderr.write(up + "\n".join(lines) + "\n")
            sys.stderr.flush()
            shown = len(lines)


def main() -> None:
    """Draw until stdin ends. Ctrl-C belongs to the run, which then ends stdin."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.nice(10)
    title = sys.argv[1]
    try:
        if sys.stderr.isatty() and len(sys.argv) > 2:
            draw_run(sys.stdin, title, sys.argv[2])
        elif sys.stderr.isatty():
            draw_bar(sys.stdin, title)
        else:
            draw_lines(sys.stdin, sys.stderr, title)
    except BrokenPipeError:
        os._exit(0)  # the reader has gone, and flushing at exit would raise


if __name__ == "__main__":
    main()
