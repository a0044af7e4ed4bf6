"""Draw the progress that arrives on stdin. `progress.py` runs it as a script."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterator
from typing import TextIO

STEP = 0.1


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
    """Draw a bar that is erased at the end: the summary follows."""
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
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=1.0, title=title)
        for fraction, text in reports(stream):
            bar.update(task, completed=fraction, description=text)


def main() -> None:
    """Draw until stdin ends. Ctrl-C belongs to the run, which then ends stdin."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.nice(10)
    title = sys.argv[1]
    try:
        if sys.stderr.isatty():
            draw_bar(sys.stdin, title)
        else:
            draw_lines(sys.stdin, sys.stderr, title)
    except BrokenPipeError:
        os._exit(0)  # the reader has gone, and flushing at exit would raise


if __name__ == "__main__":
    main()
