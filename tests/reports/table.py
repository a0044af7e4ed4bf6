"""The table of what was tried, of the files here: `python -m tests.reports.table --write`."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

from tautwave.session.acceptance.shared import Shared, read_shared

HERE = Path(__file__).parent
PAGE = HERE.parents[1] / "docs" / "tried-on.md"
HEAD = """# Tried on

{today}

Each row is a file that somebody made with `tautwave accept --share FILE` on a bench, and handed on
([Hand on what you found](first-day.md)). `tautwave replay-bus FILE` plays its devices for our
drivers, in every test run. This page is made of the files in `tests/reports`.

| device | firmware | bus | at | rate | what was run | by, when |
|---|---|---|---|---|---|---|
"""
NONE = "**Real hardware: none so far.** So far the list has only simulators."
SOME = "{count} of these are real hardware."
NAMES = ("model", "family", "vendor", "product")


def reports() -> list[Path]:
    return sorted(HERE.glob("*.json"))


def rows(one: Shared) -> Iterator[str]:
    """One row for each bus."""
    where = {
        name: axis.get("bus") or one.rig[side].get("defaults", {}).get("bus")
        for side in ("master", "slave")
        for short, axis in one.rig[side]["axes"].items()
        for name in [f"{side}.{short}"]
    }
    for bus, facts in one.buses.items():
        said = [told for name, told in one.devices.items() if where.get(name) == bus]
        if not said or not any(said):
            continue
        device = ", ".join(dict.fromkeys(" ".join(_names(told)) for told in said))
        firmware = ", ".join(dict.fromkeys(_firmware(told) for told in said))
        options = one.rig["buses"][bus].get("options", {})
        at = options.get("interface") or options.get("link") or "serial"
        ran = one.checks[-1]["stage"] if one.accepted else f"failed at {one.ended_at}"
        stages = ", ".join(dict.fromkeys(check["stage"] for check in one.checks))
        how = f"{stages}: accepted" if one.accepted else f"{stages}: {ran}"
        who = "our simulator" if one.simulated else one.by or "not named"
        yield (
            f"| {device} | {firmware} | {facts['driver']} | {at} | {facts['rate_hz']:g} Hz | "
            f"{how} | {who}, {one.day} |"
        )


def _names(told: dict[str, str]) -> list[str]:
    return [told[key] for key in NAMES if told.get(key)] or ["not named"]


def _firmware(told: dict[str, str]) -> str:
    return told.get("firmware") or told.get("software") or told.get("revision") or "-"


def page() -> str:
    """The page's text."""
    found = [read_shared(path) for path in reports()]
    real = sum(not one.simulated for one in found)
    today = SOME.format(count=real) if real else NONE
    return HEAD.format(today=today) + "".join(f"{row}\n" for one in found for row in rows(one))


if __name__ == "__main__":
    if sys.argv[1:] == ["--write"]:
        PAGE.write_text(page())
    else:
        print(page(), end="")
