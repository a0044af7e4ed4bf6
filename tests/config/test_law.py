"""`coupling.law: auto`: a law that is named, with its reason, before any key is read."""

from __future__ import annotations

from pathlib import Path

import pytest

from tautwave.config import Rig, parse_rig, resolved_yaml
from tautwave.config.law import PROMPT_S
from tautwave.errors import ConfigError
from tests.rigs.test_wave_choices import FIRST

LAW = "coupling.law=auto"


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
        (["coupling.delay_s=0.0"], "no other follows closer", "mediated"),
        ([f"coupling.delay_s={PROMPT_S}"], "no other follows closer", "mediated"),
        (["coupling.delay_s=0.02"], "20 ms cost F tau / b", "no other"),
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
