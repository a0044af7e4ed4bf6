"""`coupling.law: auto`: a law that is named, with its reason, before any key is read."""

from __future__ import annotations

from pathlib import Path

import pytest

from tautwave.certificate import certify
from tautwave.config import Rig, parse_rig, resolved_yaml
from tautwave.config.defaults import expand_defaults
from tautwave.config.law import PROMPT_S, choose_law
from tautwave.config.text.document import open_document
from tautwave.config.text.overrides import apply_overrides
from tautwave.errors import ConfigError
from tests.rigs.test_wave_choices import FIRST

LAW = "coupling.law=auto"
SIDES = "master", "slave"


def first(*settings: str) -> Rig:
    return parse_rig(FIRST, Path("first.yaml"), settings)


def test_auto_is_a_law_with_its_gains() -> None:
    rig = first(LAW)
    assert rig == first()
    assert rig.coupling.law == "wave"
    assert rig.choices == first().choices
    assert rig.law is not None
    assert rig.law.value == "wave"
    assert first().law is None
    assert parse_rig(resolved_yaml(rig)) == rig
    assert "auto" not in resolved_yaml(rig).partition("coupling:")[2].partition("simulation:")[0]


@pytest.mark.parametrize(
    ("settings", "said", "silent"),
    [
        (["coupling.delay_s=0.0"], "no other follows much closer", "mediated"),
        ([f"coupling.delay_s={PROMPT_S}"], "no other follows much closer", "mediated"),
        (["coupling.delay_s=0.02", "rate_hz=400"], "over 20 ms costs F tau / b", "no other"),
        (["coupling.delay_s=0.02", "rate_hz=400"], "but needs 500 Hz", "no other"),
        (["coupling.delay_s=0.02", "rate_hz=500"], "mediated", "but needs"),
        (["link={}"], "over any network", "mediated"),
    ],
)
def test_the_reason_says_what_the_delay_costs(settings: list[str], said: str, silent: str) -> None:
    law = first(LAW, *settings).law
    assert law is not None
    assert said in law.reason
    assert silent not in law.reason


def test_keys_of_other_laws_are_refused_beside_it() -> None:
    with pytest.raises(ConfigError, match=r"stiffness=3: only for law .*, but this is law wave"):
        first(LAW, "coupling.pairs.lever.stiffness=3")
    with pytest.raises(ConfigError, match="law wave keeps its own accounts"):
        first(LAW, "coupling.account={}")


LATE = "coupling.delay_s=0.02"


def test_over_a_longer_line_it_is_law_mediated_in_an_account() -> None:
    rig = first(LAW, LATE)
    assert rig.coupling.law == "mediated"
    assert rig.coupling.account is not None
    assert rig.law is not None
    assert "over 20 ms it follows" in rig.law.reason
    assert parse_rig(resolved_yaml(rig)) == rig
    own = first(LAW, LATE, "coupling.account={tank: 0.1}")
    assert own.coupling.account is not None
    assert own.coupling.account.tank == 0.1


@pytest.mark.parametrize(
    ("settings", "missing"),
    [
        (
            ["coupling.pairs.lever.wave_impedance=0.05"],
            "is not chosen for a pair with wave_impedance",
        ),
        (["coupling.defaults={pole_slave: 0.3}"], "is not chosen for a pair with pole_slave"),
        (["coupling.pairs.lever.force_gain=0.5"], "is not chosen for a pair with force_gain"),
        (["require=coupled_stable"], "is not certified as coupled_stable"),
        (["buses.bench.divisor=2"], "needs both sides at the same rate"),
        (
            ["slave.axes.lever.causality=admittance", "slave.axes.lever.inertia=null"],
            "drives axes that take effort only",
        ),
    ],
)
def test_where_law_mediated_cannot_be_it_is_law_wave(settings: list[str], missing: str) -> None:
    document = open_document(FIRST, "first.yaml", Path())
    apply_overrides(document, [LAW, LATE, *settings])
    expand_defaults(document)
    law = choose_law(document)
    assert law is not None
    assert law.choice.value == document.get(("coupling", "law")) == "wave"
    assert law.choice.reason.endswith(f"law mediated follows closer, but {missing}")
    assert not law.other


@pytest.mark.parametrize("key", ["inertia", "velocity_limit", "effort_rate_limit"])
def test_a_limit_that_law_mediated_needs_is_named(key: str) -> None:
    document = open_document(FIRST, "first.yaml", Path())
    apply_overrides(document, [LAW, LATE])
    del document.value["slave"]["axes"]["lever"][key]
    law = choose_law(document)
    assert law is not None
    assert law.choice.reason.endswith(f"but needs {key}")


@pytest.mark.parametrize("delay", [0.006, 0.02, 0.1, 0.3])
def test_what_it_takes_over_a_long_line_is_certified(delay: float) -> None:
    assert certify(first(LAW, f"coupling.delay_s={delay}")).passed


def test_a_misspelt_auto_is_recognised() -> None:
    with pytest.raises(ConfigError, match="unknown law 'autoo'; did you mean 'auto'"):
        first("coupling.law=autoo")


@pytest.mark.parametrize("side", SIDES)
def test_where_only_law_wave_is_certified_it_is_law_wave(side: str) -> None:
    slow = (LATE, f"{side}.axes.lever.effort_rate_limit=5", "coupling.engage_ramp_s=0.3")
    named = first("coupling.law=mediated", "coupling.account={}", *slow)
    refused = certify(named)
    assert not refused.passed
    said = " ".join(refused.as_dict()["sentences"])
    assert "; give the actual limits of device and motor" in said
    assert "wave_impedance" not in said
    rig = first(LAW, *slow)
    assert certify(rig).passed
    assert rig == first(*slow)
    assert rig.choices == first(*slow).choices
    assert rig.law is not None
    assert rig.law.value == "wave"
    assert rig.law.reason.endswith("law mediated follows closer, but is not certified for this rig")
    assert parse_rig(resolved_yaml(rig)) == rig


WALL = "coupling.pairs.lever.wall_slave={position: 0.5, stiffness: 50, damping: 0.1}"


@pytest.mark.parametrize(("delay", "law"), [(0.002, "wave"), (0.02, "mediated")])
def test_where_none_is_certified_it_is_by_the_delay_and_says_so(delay: float, law: str) -> None:
    rig = first(LAW, f"coupling.delay_s={delay}", WALL)
    assert not certify(rig).passed
    assert rig.law is not None
    assert rig.law.value == rig.coupling.law == law
    other = {"wave": "mediated", "mediated": "wave"}[law]
    assert rig.law.reason.endswith(
        f"; neither it nor law {other} is certified for this rig (below)"
    )


def test_where_the_only_law_it_can_be_is_not_certified_it_says_so() -> None:
    rig = first(LAW, "coupling.pairs.lever.wave_impedance=0.05", WALL)
    assert not certify(rig).passed
    assert rig.law is not None
    assert rig.law.reason.endswith("; it is not certified for this rig (below)")


@pytest.mark.parametrize("delay", [0.0, 0.002])
def test_where_only_law_mediated_is_certified_it_is_that_over_a_short_line(delay: float) -> None:
    bare = (f"coupling.delay_s={delay}", *(f"{it}.axes.lever.damping.lower=0" for it in SIDES))
    assert not certify(first(*bare)).passed
    rig = first(LAW, *bare)
    assert certify(rig).passed
    assert rig == first(*bare, "coupling.law=mediated", "coupling.account={}")
    assert rig.law is not None
    assert rig.law.value == rig.coupling.law == "mediated"
    assert rig.law.reason.endswith("law wave is not certified for this rig")
    assert parse_rig(resolved_yaml(rig)) == rig


def test_an_account_that_is_set_to_nothing_is_one_with_its_defaults() -> None:
    rig = first(LAW, LATE, "coupling.account=null")
    assert rig == first(LAW, LATE)
    assert certify(rig).passed
