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
from tautwave.contracts import READ_SHARE
from tautwave.report.calm import CHATTER_THRESHOLD
from tautwave.runtime.operate.commands import KEYS
from tautwave.runtime.operate.lead import MISSED_FRAMES
from tautwave.session.acceptance.accepting import GENTLE
from tautwave.session.acceptance.ladder import STAGES
from tautwave.view.server import MAX_VIEWERS
from tautwave_drivers.canopen.options import CanopenOptions
from tautwave_drivers.dynamixel.options import DynamixelOptions
from tautwave_drivers.dynamixel.survey import ADVISED_SHARE
from tautwave_drivers.mit.options import MitOptions
from tautwave_sim.network import NetworkOptions

ROOT = Path(__file__).parents[2]
NUMBERS = {"a tenth": 0.1, "a fifth": 0.2, "a quarter": 0.25, "three": 3, "five": 5, "sixteen": 16}


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


def _spoken(number: float) -> tuple[str, ...]:
    return (next(word for word, value in NUMBERS.items() if value == number),)


def _takes_no_positions() -> tuple[str, ...]:
    titles = {"canopen": "CiA 402", "modbus": "Modbus", "mit": "MIT motors"}
    without = {
        name
        for name in registry.driver_names()
        if (plugin := registry.load_driver(name)).endpoint and not plugin.positions
    }
    return tuple(titles[name] for name in titles if name in without)


FACTS = {
    "python": Fact(
        r"Python (3\.\d+) or newer", _python,
        {"README.md", "docs/scope.md", "docs/start/first-run.md"},
    ),
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
        lambda: _spoken(CHATTER_THRESHOLD),
        {"docs/explanation/couplings.md"},
    ),
    "port of sites": Fact(
        r"one port \((\d+)\)|--to 127\.0\.0\.1:(\d+)", lambda: (str(PORT),),
        {"docs/howto/two-machines.md", "docs/howto/test-the-path.md"},
    ),
    "watchdogs": Fact(r"(\d+) to (\d+) ms by default", _watchdogs_ms, {"docs/safety.md"}),
    "pages of a run": Fact(
        r"(?i)\b(sixteen) pages get data",
        lambda: _spoken(MAX_VIEWERS),
        {"docs/howto/watch-a-run.md"},
    ),
    "relay of sites": Fact(
        r"at port (7\d+)|127\.0\.0\.1:(7448)",
        lambda: (NetworkOptions.model_fields["listen"].default.rpartition(":")[2],),
        {"docs/howto/two-machines.md", "docs/howto/test-the-path.md"},
    ),
    "answers in time": Fact(
        r"(?:in|answer) by (\d+) % of the period", lambda: (f"{100 * READ_SHARE:g}",),
        {"docs/start/feetech.md", "docs/start/mit.md"},
    ),
    "effort of a new rig": Fact(
        r"(a fifth) of the\s+stall torque", lambda: _spoken(ADVISED_SHARE),
        {"docs/start/new-rig.md", "docs/tutorials/two-arms.md"},
    ),
    "effort of a first day": Fact(
        r"(a \w+) of every effort limit|by a (?:hand, )?(a \w+) of `effort_limit`"
        r"|with (a \w+) of\s+`effort_limit`|`effort_limit` at (a \w+),"
        r"|Begin with (a \w+) of the motor's capability",
        lambda: _spoken(GENTLE),
        {
            "docs/first-day.md",
            "docs/start/first-hardware.md",
            "docs/start/two-openarms.md",
            "docs/start/two-so101-arms.md",
        },
    ),
    "actions that are missed": Fact(
        r"(?i)\b(\w+) frames without an action", lambda: _spoken(MISSED_FRAMES),
        {"docs/howto/lerobot.md", "docs/howto/take-over.md"},
    ),
    "positions": Fact(
        r"(CiA 402) drives, (Modbus) drives and (MIT motors) in position mode are refused",
        _takes_no_positions, {"docs/scope.md", "docs/howto/follow-positions.md"},
    ),
    "rigs to feel": Fact(
        r"(?i)\b(five) rigs to feel",
        lambda: _spoken(len(list((ROOT / "configs").glob("feel-*.yaml")))),
        {"docs/index.md", "docs/start/feel.md"},
    ),
}  # fmt: skip
SENTENCES = {
    "a wave line takes a constant delay": (
        r"(?i)\bwaves?\b[^.|\n]*\bany delay\b|passive[^.|\n]*\bany delay\b", set(),
    ),
    "no real hardware so far": (
        r"Not yet tried on a real drive|Real hardware(?: tried so far)?: none",
        {"README.md", "docs/index.md", "docs/scope.md", "docs/tried-on.md"},
    ),
    "a load is carried where it is stated": (
        r"(?i)gravity is not compensated|all stops are passive|use\s+counterweights", set(),
    ),
    "pages that leave a load alone name the one that carries it": (
        r"carry-a-load\.md\)[^.]*(?:through a stop|where it is)|\[carry it\]|keeps\nsuch an arm",
        {"docs/safety.md", "docs/tutorials/dynamixel-arms.md", "docs/howto/carry-a-load.md"},
    ),
    "a fault ends a run, but for an operated one": (r"the whole run stops", set()),
    "a policy leads by a hand": (r"(?i)lerobot\b[^.|\n]*\bnever leads", set()),
    "Feetech servos have no watchdog": (
        r"(?is)(?:none of these servos has|these servos have no|They have no|the servos have) "
        r"(?:a watchdog|watchdog|none)|without a watchdog, such as Feetech",
        {
            "docs/start/feetech.md",
            "docs/start/two-so101-arms.md",
            "docs/safety.md",
            "docs/howto/lerobot.md",
            "docs/reference/rig/driver-feetech.md",
        },
    ),
}  # fmt: skip
"""What pages say in words: a pattern, and all pages that have it."""


def said(fact: Fact) -> dict[str, list[tuple[str, ...]]]:
    """Return what each page says of a fact."""
    found: dict[str, list[tuple[str, ...]]] = {}
    for page in pages():
        for match in re.finditer(fact.spoken, page.read_text(encoding="utf-8")):
            groups = tuple(group for group in match.groups() if group is not None)
            found.setdefault(str(page.relative_to(ROOT)), []).append(
                tuple(group.lower() if group.lower() in NUMBERS else group for group in groups)
            )
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
    for name, part in (
        ("README.md", r"^\| law \| what(?:.+\n)+"),
        ("docs/explanation/couplings.md", r"^\| law \| 0 ms(?:.+\n)+"),
        ("docs/reference/glossary.md", r"^\| law \|.*"),
    ):
        found = re.search(part, (ROOT / name).read_text(encoding="utf-8"), flags=re.M)
        assert found is not None
        assert laws <= set(re.findall(r"\w+", found[0])), name


def test_each_bus_has_its_watchdog_on_the_page_of_safety() -> None:
    text = (ROOT / "docs/safety.md").read_text(encoding="utf-8")
    part = text.partition("## What the drive's watchdog does")[2].partition("\n## ")[0]
    buses = {
        name.split()[0].lower() for name in re.findall(r"^- \*\*([^*]+)\*\*", part, flags=re.M)
    }
    in_software = {"arm", "loopback", "replay"}
    assert buses == set(registry.driver_names()) - in_software


MENTIONED = re.compile(
    r"(?i)\bexit(?:s|ed)?(?: code)?(?: with| is)? (\d)\b|\bends? with (\d)\b"
    r"|with (\d)(?= however|\))"
)
REASONS = {
    r"not certified|`require` fails|its own certificate|worse than its certificate|gives more"
    r"|more than its claim|breaks its certificate|outranks": 3,
    r"safety stop(?! \(6)|in debt|debt exceeds|slots stops": 6,
    r"bus time|silent intervals|factory setting": 4,
    r"is off\b|confirm `disable`|ports only|no answer|passive stop|the other says|scheduler that"
    r"|workers are gone|would have to is refused": 5,
    r"All mistakes at once|A mistake gets": 2,
    r"beside the goals|ends its run": 0,
    r"a number differs": 1,
}
"""What a page says before it names the exit code, and the code."""


def test_every_exit_code_that_a_page_names_is_that_of_its_reason() -> None:
    codes = {error.exit_code for error in all_errors(errors.TautwaveError)}
    assert set(REASONS.values()) <= codes | {0}
    seen = 0
    of_former_versions = ROOT / "docs/reference/renamed.md"
    for page in (page for page in pages() if page != of_former_versions):
        text = re.sub(r"<!--.*?-->", "", page.read_text(encoding="utf-8"))
        for mention in MENTIONED.finditer(text):
            where = f"{page.relative_to(ROOT)}: {text[mention.start() - 100 : mention.end() + 50]}"
            reason = reason_of(text[: mention.start()], text[mention.end() :])
            assert reason is not None, f"no known reason for an exit code: {where}"
            assert REASONS[reason] == int(next(filter(None, mention.groups()))), where
            seen += 1
    assert seen > 20


def reason_of(before: str, after: str) -> str | None:
    """Return which of `REASONS` is given last before a mention, else first after it."""
    last = [
        (found.start(), reason)
        for reason in REASONS
        for found in re.finditer(reason, before[-400:])
    ]
    if last and max(last)[0] > len(before[-400:]) - 150:
        return max(last)[1]
    first = [
        (found.start(), reason) for reason in REASONS for found in re.finditer(reason, after[:60])
    ]
    return min(first)[1] if first else max(last)[1] if last else None


def all_errors(error: type[errors.TautwaveError]) -> set[type[errors.TautwaveError]]:
    """Return an error and all that derive from it."""
    return {error}.union(*(all_errors(one) for one in error.__subclasses__()))


def test_the_first_day_has_the_stages_of_an_acceptance() -> None:
    text = (ROOT / "docs/first-day.md").read_text(encoding="utf-8")
    table = text.partition("| stage | torque |")[2].partition("\n\n")[0]
    assert tuple(re.findall(r"^\| `(\w+)` \|", table, flags=re.M)) == STAGES


def test_keys_that_pages_name_give_the_commands_that_they_say() -> None:
    named: dict[str, set[str]] = {}
    for page in pages():
        for key, word in re.findall(
            r"^\| \*\*(\w)\*\* \| `(\w+)` \|", page.read_text(encoding="utf-8"), flags=re.M
        ):
            named.setdefault(key, set()).add(word)
    assert len(named) >= 6
    assert named == {key: {KEYS[key]} for key in named}


def test_tables_of_buses_have_every_bus_and_the_first_page_every_page_of_one() -> None:
    buses = {name for name in registry.driver_names() if registry.load_driver(name).hardware}
    for name in ("README.md", "docs/index.md"):
        text = (ROOT / name).read_text(encoding="utf-8")
        table = "\n".join(line for line in text.splitlines() if line.startswith("|"))
        assert buses - {"arm"} <= set(re.findall(r"start/(\w+)\.md", table)), name
        for family in ("Damiao", "RobStride", "Dynamixel", "Feetech", "CiA 402", "Modbus"):
            assert family in table, (name, family)
