"""The generated reference covers the program: keys, commands, columns, exit codes, names."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import click
import pytest

import tautwave
from tautwave import cli, errors, registry
from tautwave.columns import names
from tautwave.config import Rig, load_rig, rig_schema
from tautwave.config.shipped import examples
from tautwave.link.columns import ALIGNED, LINK_COLUMNS
from tautwave.rig import build_rig
from tautwave.session.operating import with_operation
from tautwave.session.viewing.tuning import tuning_of
from tautwave.sweep.file import MEASURES, Case, Figure, Panel, Sweep
from tests.arms.motions import FOLLOWING
from tests.docs.blocks import pages
from tests.view.browser import CHROMIUM, Browser

DOCS = Path(__file__).parents[2] / "docs"
CONFIGS = DOCS.parent / "configs"
NAMES = sorted(path.name for path in CONFIGS.glob("*.yaml"))


@pytest.fixture(autouse=True)
def _tools(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(DOCS)


def test_every_key_says_what_it_means() -> None:
    from _tools.keys import described

    silent = [f"{block}.{key}" for block, key, meaning in described() if not meaning]
    assert not silent


def test_every_key_is_on_the_page() -> None:
    from _tools.keys import described, keys_pages

    text = "".join(keys_pages().values())
    assert all(f"| `{key}` |" in text for block, key, _ in described() if block != "Coupling")


def test_every_measure_and_key_of_a_sweep_file_is_on_its_page() -> None:
    from _tools import sweeps

    assert tuple(sweeps.MEASURES) == MEASURES
    text = sweeps.sweeps_page()
    keys = {key for block in (Sweep, Case, Figure, Panel) for key in block.model_fields}
    assert all(f"| `{key}` |" in text for key in {*keys, *MEASURES})


def test_every_block_has_one_page_and_every_page_its_keys() -> None:
    from _tools.keys import assigned, keys_pages

    blocks = {name for name, node in rig_schema()["$defs"].items() if node.get("properties")}
    named = [block for page in assigned().values() for block in page]
    assert sorted(named) == sorted({"", *blocks} - {"Coupling"})
    folder = DOCS / "reference/rig"
    shown = {
        name: re.findall(r"generated/keys/([\w-]+)\.md", (folder / f"{name}.md").read_text())
        for name in {path.stem for path in folder.glob("*.md")} - {"index", "reading"}
    }
    assert shown == {name: [name] for name in keys_pages()}


def test_every_command_is_on_the_page() -> None:
    from _tools.commands import commands_page, walk
    from tautwave.cli import main

    page = commands_page()
    for words, _ in walk(main, ("tautwave",)):
        assert f"\n## {' '.join(words)}\n" in page


def _options(words: list[str]) -> tuple[set[str], list[str]]:
    """Return the options that a command knows, and its words from there on; none of a group."""
    from tautwave.cli import main

    command: Any = main
    at = 1
    while isinstance(command, click.Group):
        found = command.get_command(click.Context(command), words[at]) if at < len(words) else None
        if found is None:
            return set(), []
        command, at = found, at + 1
    known = {"--help", *(o for p in command.params for o in (*p.opts, *p.secondary_opts))}
    parts = {
        "sim": (registry.load_simulator, "bench_options"),
        "scan": (registry.load_driver, "scan_options"),
    }
    driver = words[at] if at < len(words) else ""
    if command.name in parts and driver in (*registry.driver_names(), "network"):
        load, options = parts[command.name]
        fields = getattr(load(driver), options).model_fields
        known |= {"--" + name.replace("_", "-") for name in fields}
    return known, words[at:]


def pages_of_now() -> list[Path]:
    """Pages but for the one of former names."""
    return [page for page in pages() if page.name != "renamed.md"]


def test_every_command_and_example_that_a_page_names_exists() -> None:
    """In backticks, in blocks and on lines of their own."""
    commands = set(cli.main.list_commands(click.Context(cli.main)))
    known = {example.name for example in examples()}
    seen = 0
    for page in pages_of_now():
        text = page.read_text(encoding="utf-8")
        for word, name in re.findall(
            r"(?:`|^\$ |^    )tautwave ([a-z][\w-]*)(?:[ \n]([\w./-]+))?", text, flags=re.M
        ):
            assert word in commands, f"{page.name}: tautwave {word}"
            if word == "example" and name not in {"", "NAME"}:
                assert name in known, f"{page.name}: tautwave example {name}"
            seen += 1
    assert seen > 200


def test_every_option_that_a_page_names_exists() -> None:
    """Also within a line, where no test runs the command."""
    seen = 0
    for page in pages_of_now():
        text = page.read_text(encoding="utf-8")
        for found in re.findall(r"(?<![\w./-])tautwave [a-z][^`\n]*", text):
            plain = re.sub(r"'[^']*'|\"[^\"]*\"", "_", found)
            words = re.split(r" #| [|&>;] ", plain)[0].split()
            known, rest = _options(words)
            named = {word.split("=")[0] for word in rest if re.match(r"--[a-z]", word)}
            seen += len(named)
            assert not known or named <= known, f"{page.name}: {found}: {named - known}"
    assert seen > 100


def test_every_exit_code_is_on_the_page() -> None:
    from _tools.commands import exit_codes_page

    rows = re.findall(r"^\| ([\d, ]+) \|", exit_codes_page(), re.MULTILINE)
    assert rows == ["0", "1", "2", "3", "4", "5", "6", "7", "129, 130, 143", "141"]
    for name in ("ConfigError", "NotCertifiedError", "SafetyStop", "WritingError"):
        code = getattr(errors, name).exit_code
        assert re.search(rf"^\| {code} \|.*`{name}`", exit_codes_page(), re.MULTILINE)


def _columns(rig: Rig) -> list[str]:
    return list(build_rig(rig, clock="fake", duration_s=10 / rig.rate_hz).columns)


@pytest.mark.slow
def test_columns_of_the_shipped_rigs_are_explained() -> None:
    from tautwave.report.columns import sections

    kinds = [kind for section in sections().values() for kind in section]
    parts = [
        part
        for name in NAMES
        if (rig := load_rig(CONFIGS / name)).simulation is not None
        for part in _columns(rig)
    ]
    parts += _columns(
        load_rig(CONFIGS / "bench-foam-loopback.yaml", ["coupling.pairs.lever.matched_slave=true"])
    )
    ranges = "p_max: 12.5, v_max: 30, t_max: 10, damping: 0.01, velocity_filter_hz: 500"
    motors = ", ".join(f"{{id: {one}, feedback_id: {16 + one}, {ranges}}}" for one in (1, 2))
    damped = [f"buses.can.options.motors=[{motors}]"]
    parts += _columns(load_rig(CONFIGS / "bench-mit-virtual.yaml", damped))
    operated = load_rig(CONFIGS / "bench-1dof-loopback.yaml", ["operate={}"])
    parts += with_operation(operated, build_rig(operated, clock="fake"), (), ()).columns
    led = load_rig(CONFIGS / "bench-1dof-loopback.yaml", ["operate={policy: {}}"])
    parts += with_operation(led, build_rig(led, clock="fake"), (), ()).columns
    with tuning_of(operated, build_rig(operated, clock="fake"), allowed=True) as tuning:
        assert tuning is not None
        parts += tuning.columns
    kept = [
        "coupling={law: four_channel, delay_s: 0.01, account: {}, pairs: {lever: {}}}",
        *(
            f"{side}.axes.lever.compensation={{viscous: 0.5, inertia: 0.5}}"
            for side in ("master", "slave")
        ),
    ]
    parts += _columns(load_rig(CONFIGS / "bench-1dof-2khz.yaml", kept))
    kept = ["coupling={law: mediated, account: {}, pairs: {lever: {}}}"]
    parts += _columns(load_rig(CONFIGS / "bench-1dof-2khz.yaml", kept))
    parts += _columns(load_rig(CONFIGS / "arms" / "planar.yaml"))
    parts += _columns(load_rig(CONFIGS / "arms" / "planar.yaml", list(FOLLOWING)))
    payloads = ["operate={}", "slave.arm.payloads={box: {mass: 0.3}}"]
    parts += _columns(load_rig(CONFIGS / "arms-loopback.yaml", payloads))
    parts += [
        "slave.lever.target",
        *names(LINK_COLUMNS),
        *(f"lever.{name}.absorbed" for name in ALIGNED.values()),
    ]
    # of elements, the page spells out the three columns of the first only
    plain = {
        re.sub(r"\.(stored|dissipated)$", ".absorbed", part)
        if re.fullmatch(r"\w+\.(?!port_)\w+\.(stored|dissipated)", part)
        and not part.startswith("scene.")
        else part
        for part in parts
    }
    unexplained = [part for part in plain if not any(kind.matches(part) for kind in kinds)]
    assert not unexplained
    idle = [kind.name for kind in kinds if not any(kind.matches(part) for part in plain)]
    assert not idle


def test_every_public_name_has_an_entry() -> None:
    text = (DOCS / "reference" / "api.md").read_text()
    assert all(re.search(rf"\btautwave\.{name}\b", text) for name in tautwave.__all__)


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_the_site_builds_fetches_nothing_and_fits_a_phone(tmp_path: Path) -> None:
    pytest.importorskip("sphinx")
    pytest.importorskip("furo")
    out = Path(os.environ.get("TAUTWAVE_SITE", tmp_path / "html"))  # `.ci/run` has built it
    if out.exists():
        assert not _foreign(out)
        assert not _too_wide(out)
        return
    done = subprocess.run(
        [sys.executable, "-m", "sphinx", "-W", "-n", "-q", "-d", str(tmp_path / "trees"),
         str(DOCS), str(out)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert not _foreign(out)
    assert not _too_wide(out)


def _too_wide(out: Path) -> list[tuple[int, str]]:
    """Return the pages that scroll sideways at the width of a screen or a phone [px]."""
    if CHROMIUM is None:
        return []
    pages = [page for page in out.rglob("*.html") if page.parent.name != "decisions"]
    wide = []
    with Browser() as browser:
        for width in (1400, 420):
            browser.look(width, 1000, dark=False)
            for page in pages:
                browser.open(page.as_uri())
                loaded = f"document.readyState == 'complete' && location.href == {page.as_uri()!r}"
                assert browser.wait(loaded), page
                if browser.run("document.documentElement.scrollWidth") > width:
                    wide.append((width, page.name))
    return wide


def _foreign(out: Path) -> list[str]:
    """Return what pages of a site would load from elsewhere."""
    loads = re.compile(
        r"<(?:script|img|iframe|source)\b[^>]*\bsrc=\"(?:https?:)?//"
        r"|<link\b[^>]*rel=\"(?:stylesheet|icon|preload|preconnect)\"[^>]*href=\"(?:https?:)?//"
        r"|@import\s+(?:url\()?[\"']?(?:https?:)?//|url\([\"']?(?:https?:)?//"
    )
    pages = [*out.rglob("*.html"), *out.rglob("*.css")]
    assert len(pages) > 50
    found = {path: loads.search(path.read_text(encoding="utf-8")) for path in pages}
    return [f"{path.relative_to(out)}: {one[0]}" for path, one in found.items() if one]


def test_the_calls_of_a_cycle_are_those_of_its_phases_in_order() -> None:
    from _tools.cycle import traced, walked

    calls = [one for _, one in walked(traced())]
    assert all(one.meaning for one in calls), "a function without a docstring"
    modules = [one.module for one in calls]
    names = [one.name.rpartition(".")[2] for one in calls]
    phases = ["sense", "pass_slot", "close_axis", "exchange", "decide_axis", "write", "fill"]
    assert [names.index(phase) for phase in phases] == sorted(map(names.index, phases))
    assert {"tautwave.laws.port", "tautwave.laws.limit", "tautwave.laws.wall"} <= set(modules)
    assert {one.times for one in calls if one.name == "close_axis"} <= {1, 2}


def test_calls_in_a_row_are_counted_alone_and_in_groups() -> None:
    from _tools.cycle import Call, _folded

    one, two = Call("m", "one", "", ()), Call("m", "two", "", ())
    assert _folded([one, one, two]) == (one._replace(times=2), two)
    assert _folded([one, two, one, two]) == (one._replace(times=2), two._replace(times=2))
    assert _folded([one, two, one]) == (one, two, one)
