"""What several pages say, or a page and the program, is said alike.

Each row: how pages speak of a fact, what the program has, and which pages speak of it at least.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

from tautwave import errors, registry
from tautwave.config.keys.sites import PORT
from tautwave.config.law import LATE_LAW, PROMPT_S
from tautwave.report.calm import CHATTER_THRESHOLD
from tautwave.view.server import MAX_VIEWERS
from tautwave_drivers.canopen.options import CanopenOptions
from tautwave_drivers.dynamixel.options import DynamixelOptions
from tautwave_drivers.mit.options import MitOptions

ROOT = Path(__file__).parents[2]
NUMBERS = {"a fifth": 0.2, "a quarter": 0.25, "sixteen": 16}


def pages() -> Iterator[Path]:
    """Pages for a reader of this version: no decisions, no releases, nothing generated."""
    yield ROOT / "README.md"
    yield ROOT / "configs/README.md"
    for page in sorted((ROOT / "docs").rglob("*.md")):
        parts = page.relative_to(ROOT / "docs").parts
        if not {"_build", "examples", "decisions", "generated"} & set(parts):
            yield page


class Fact(NamedTuple):
    """`spoken`: its groups are what a page says; `value`: what they have to be, in order."""

    spoken: str
    value: Callable[[], tuple[str, ...]]
    pages: set[str]


def _python() -> tuple[str, ...]:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    return (project["requires-python"].removeprefix(">="),)


def _watchdogs_ms() -> tuple[str, ...]:
    heartbeat = CanopenOptions.model_fields["heartbeat_timeout_ms"].default
    servos = [one.model_fields["watchdog_s"].default for one in (DynamixelOptions, MitOptions)]
    all_of_them = [heartbeat, *(1e3 * one for one in servos)]
    return f"{min(all_of_them):g}", f"{max(all_of_them):g}"


def _code(error: type[errors.TautwaveError]) -> Callable[[], tuple[str, ...]]:
    return lambda: (str(error.exit_code),)


FACTS = {
    "python": Fact(r"Python (3\.\d+) or newer", _python, {"README.md", "docs/scope.md"}),
    "auto's delay": Fact(
        r"(?i)\bwaves? up to (\d+) ms each way|(?<=\n)Up to (\d+) ms each way law `wave`",
        lambda: (f"{1e3 * PROMPT_S:g}",), {"docs/explanation/couplings.md"},
    ),
    "auto's other law": Fact(
        r"law `(\w+)`, a model of what the slave touches|longer line law `(\w+)` in an account",
        lambda: (LATE_LAW,), {"docs/explanation/couplings.md"},
    ),
    "chatter": Fact(
        r"more than (a \w+) of the motion power is above",
        lambda: (next(word for word, value in NUMBERS.items() if value == CHATTER_THRESHOLD),),
        {"docs/explanation/couplings.md"},
    ),
    "port of sites": Fact(
        r"one port \((\d+)\)|--to 127\.0\.0\.1:(\d+)", lambda: (str(PORT),),
        {"docs/howto/two-machines.md", "docs/howto/test-the-path.md"},
    ),
    "watchdogs": Fact(r"(\d+) to (\d+) ms by default", _watchdogs_ms, {"docs/safety.md"}),
    "pages of a run": Fact(
        r"(?i)\b(sixteen) pages get data",
        lambda: (next(word for word, value in NUMBERS.items() if value == MAX_VIEWERS).title(),),
        {"docs/howto/watch-a-run.md"},
    ),
    "not certified": Fact(
        r"not certified as required \(exit code (\d)\)|A run that gives more exits with (\d)"
        r"|gave out more than its claim \| exit (\d)",
        _code(errors.NotCertifiedError), {"docs/start/walls.md", "docs/explanation/the-port.md"},
    ),
    "stopped": Fact(
        r"debt beyond its reserve \| the run stops, exit (\d)"
        r"|stops, as on one machine \(exit code (\d)"
        r"|The run stops \(exit (\d)\)",
        _code(errors.SafetyStop),
        {
            "docs/explanation/the-port.md",
            "docs/howto/two-machines.md",
            "docs/reference/rig/scene.md",
        },
    ),
    "other site": Fact(
        r"says so in a sentence, with exit code (\d)|a passive stop, exit code (\d)",
        _code(errors.LinkError), {"docs/howto/two-machines.md"},
    ),
    "devices": Fact(
        r"a run that would have to is refused \(exit code (\d)\)"
        r"|such a run ends with exit code (\d)"
        r"|run exits with (\d) however it ended",
        _code(errors.DriverError),
        {"docs/reference/rig/buses.md", "docs/add-a-driver.md", "docs/safety.md"},
    ),
}  # fmt: skip
SENTENCES = {
    "a wave line takes a constant delay": (r"(?i)\bwaves?\b[^.|\n]*\bany delay\b", set()),
    "no real hardware so far": (
        r"Not yet tried on a real drive|Real hardware(?: tried so far)?: none",
        {"README.md", "docs/scope.md", "docs/tried-on.md"},
    ),
}
"""What pages say in words: a pattern, and all pages that have it."""


def said(fact: Fact) -> dict[str, list[tuple[str, ...]]]:
    """Return what each page says of a fact."""
    found: dict[str, list[tuple[str, ...]]] = {}
    for page in pages():
        for match in re.finditer(fact.spoken, page.read_text(encoding="utf-8")):
            groups = tuple(group for group in match.groups() if group is not None)
            found.setdefault(str(page.relative_to(ROOT)), []).append(groups)
    return found


@pytest.mark.parametrize("name", FACTS)
def test_pages_and_program_agree(name: str) -> None:
    fact = FACTS[name]
    found = said(fact)
    assert fact.pages <= set(found)
    wanted = fact.value()
    assert {groups for page in found.values() for groups in page} == {wanted}, found


@pytest.mark.parametrize("name", SENTENCES)
def test_pages_say_alike(name: str) -> None:
    pattern, wanted = SENTENCES[name]
    found = {
        str(page.relative_to(ROOT))
        for page in pages()
        if re.search(pattern, page.read_text(encoding="utf-8"))
    }
    assert found == wanted


def test_pages_that_list_all_laws_have_each() -> None:
    laws = set(registry.coupling_names())
    for name, line in (
        ("README.md", r"^Laws: .*"),
        ("docs/reference/glossary.md", r"^\| law \|.*"),
    ):
        found = re.search(line, (ROOT / name).read_text(encoding="utf-8"), flags=re.M)
        assert found is not None
        assert laws <= set(re.findall(r"`(\w+)`", found[0])), name


def test_each_bus_has_its_watchdog_on_the_page_of_safety() -> None:
    text = (ROOT / "docs/safety.md").read_text(encoding="utf-8")
    part = text.partition("## What the drive's watchdog does")[2].partition("\n## ")[0]
    buses = {
        name.split()[0].lower() for name in re.findall(r"^- \*\*([^*]+)\*\*", part, flags=re.M)
    }
    in_software = {"arm", "loopback", "replay"}
    assert buses == set(registry.driver_names()) - in_software
