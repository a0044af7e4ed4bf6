"""The two verdicts of a wave port agree: contracting on its class, stable with what is stated."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest

from tautwave.certificate import certify
from tautwave.config import Rig, parse_rig
from tautwave.couplings.wave.device_port import DevicePort
from tests.certificate.rigs import element, rig

NAME = "bench-1dof-2khz"


def draw(rng: np.random.Generator) -> list[str]:
    """Return changes that make the rig any other: port, beliefs, delays, hand, environment."""
    pole = ["plain", 0.0, 0.3, 0.5, 0.7][rng.integers(5)]
    other = ["plain", 0.3, 0.5][rng.integers(3)]
    impedance = 0.05 * math.exp(rng.uniform(-3.0, 1.0))
    damping = 1e-3 * math.exp(rng.uniform(-3.0, 3.0))
    stiffness = 200.0 * math.exp(rng.uniform(-4.0, 3.0))
    late = 0.0005 * int(rng.integers(3))
    line = 0.0005 * int(rng.choice([0, 1, 7, 40, 80]))
    return [
        f"coupling.pairs.lever.pole_master={pole}",
        f"coupling.pairs.lever.pole_slave={other}",
        f"coupling.pairs.lever.wave_impedance={impedance!r}",
        f"coupling.pairs.lever.wave_filter_hz={float(rng.choice([30.0, 100.0, 200.0, 600.0]))}",
        f"coupling.delay_s={line!r}",
        f"buses.bench.options={{command_delay_s: {late!r}}}",
        *(
            f"{side}.axes.lever.damping={{value: {2 * damping!r}, lower: {damping!r}, source: x}}"
            for side in ("master", "slave")
        ),
        f"simulation.environment.lever={{type: wall, position: 0.1, stiffness: {stiffness!r}, "
        f"damping: {damping!r}}}",
    ]


def agree(seed: int, rigs: int) -> int:
    """Certify random rigs; return how many were passive."""
    rng = np.random.default_rng(seed)
    passed = 0
    for _ in range(rigs):
        changes = draw(rng)
        verdicts = certify(rig(*changes, name=NAME)).verdicts
        if verdicts["passive"].passed:
            passed += 1
            assert verdicts["coupled_stable"].passed, changes
    return passed


@pytest.mark.usefixtures("without_advice")
def test_a_passive_pair_is_stable_with_what_is_stated() -> None:
    assert agree(21, 2) == 1


@pytest.mark.slow
@pytest.mark.usefixtures("without_advice")
@pytest.mark.nightly
def test_more_passive_pairs_are_stable_with_what_is_stated() -> None:
    assert agree(10, 60) > 15


@pytest.mark.slow
def test_what_stands_in_the_way_of_a_stiffer_contact_is_named() -> None:
    port = element(
        certify(rig("coupling.pairs.lever.pole_slave=0.3", name=NAME)), "slave.lever port"
    )
    assert port.numbers["stiffest"] == pytest.approx(4437.0, rel=0.01)
    assert any("springs up to 4437" in text and "inertia.lower" in text for text in port.sentences)


@pytest.mark.slow
def test_a_better_belief_brings_what_was_promised() -> None:
    port = element(
        certify(rig("coupling.pairs.lever.pole_slave=0.3", name=NAME)), "slave.lever port"
    )
    [text] = [one for one in port.sentences if "springs up to 4437" in one]
    [promised] = re.findall(r"10 % more inertia\.lower raises that by (\d+) %", text)
    lower = 1.1 * rig(name=NAME).slave.axes["lever"].inertia.lower
    heavier = (
        "coupling.pairs.lever.pole_slave=0.3",
        f"slave.axes.lever.inertia={{value: {2.0 * lower!r}, lower: {lower!r}, source: x}}",
    )
    better = element(certify(rig(*heavier, name=NAME)), "slave.lever port").numbers["stiffest"]
    gained = 100.0 * (better / port.numbers["stiffest"] - 1.0)
    assert gained == pytest.approx(float(promised), abs=5.0)  # what is proved lags the grid


IDEAL = """name: ideal
rate_hz: {rate}
duration_s: 0.1
loop: {{missing_limit: 3, overrun_limit: 3}}
buses: {{hand: {{driver: loopback}}, arm: {{driver: loopback}}}}
master:
  axes: {{lever: {{bus: hand, id: 1, {axis}}}}}
slave:
  axes: {{lever: {{bus: arm, id: 1, {axis}}}}}
coupling: {{law: wave, delay_s: {delay}, pairs: {{lever: {{{pair}}}}}}}
simulation: {{}}
"""
"""Axes whose encoder has neither a step nor noise."""


def ideal(pair: str, rate: int, inertia: float, damping: float, delay: float) -> Rig:
    axis = (
        "kind: rotary, effort_limit: 20, effort_rate_limit: 10000, velocity_limit: 10, "
        f"position_range: [-3, 3], inertia: {{value: {2 * inertia}, lower: {inertia}, source: x}}, "
        f"damping: {{value: {2 * damping}, lower: {damping}, source: x}}"
    )
    return parse_rig(IDEAL.format(rate=rate, axis=axis, delay=delay, pair=pair))


@pytest.mark.sparse(6)
@pytest.mark.parametrize("rate", [500, 2000])
@pytest.mark.parametrize("delay", [0.0, 0.02])
@pytest.mark.parametrize(("inertia", "damping"), [(0.01, 0.005), (0.002, 0.02), (0.1, 0.01)])
def test_an_ideal_encoder_is_certified_as_it_comes_and_by_what_a_refusal_names(
    rate: int, delay: float, inertia: float, damping: float
) -> None:
    device = (rate, inertia, damping, delay)
    chosen = certify(ideal("", *device))
    assert chosen.verdicts["passive"].passed, chosen.verdicts["passive"].reason
    # a lossless line of one's own is refused, with a key that passes or none at all
    port = element(certify(ideal("wave_filter_hz: null", *device)), "slave.lever port")
    if port.passive.passed:
        return
    said = re.findall(r"(\w+) to ([\w.e-]+)", port.passive.reason.rpartition("; ")[2])
    assert said, port.passive.reason
    keys = {"wave_filter_hz": "null"} | dict(said)
    text = ", ".join(f"{key}: {value}" for key, value in keys.items())
    assert element(certify(ideal(text, *device)), "slave.lever port").passive.passed


@pytest.mark.sparse(3)
@pytest.mark.parametrize(
    "changes",
    [
        ("coupling.pairs.lever.pole_slave=0.8",),
        ("coupling.pairs.lever.wave_impedance=0.5",),
        ("slave.axes.lever.inertia.lower=1e-6", "coupling.pairs.lever.wave_impedance=0.02"),
    ],
)
def test_the_remedy_of_a_refused_port_passes(changes: tuple[str, ...]) -> None:
    changes = ("coupling.pairs.lever.pole_slave=0.3", "loop.overrun_limit=4", *changes)
    port = element(certify(rig(*changes, name=NAME)), "slave.lever port")
    assert not port.passive.passed
    said = re.findall(r"(?:set|lower) (\w+) to ([\w.e-]+)", port.passive.reason)
    assert said, port.passive.reason
    better = [*changes, *(f"coupling.pairs.lever.{key}={value}" for key, value in said)]
    assert element(certify(rig(*better, name=NAME)), "slave.lever port").passive.passed


def test_a_brief_certificate_has_the_same_verdicts_and_computes_nothing_else(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The whole one adds the stiffest spring of each port, and a sentence on it."""
    whole = certify(rig(name=NAME)).as_dict()
    monkeypatch.setattr(DevicePort, "stiffest", lambda _: pytest.fail("sought"))
    brief = certify(rig(name=NAME), brief=True).as_dict()
    found = 0
    for one in whole["elements"]:
        if one["numbers"].pop("stiffest", None):
            assert "tolerates springs" in one["sentences"].pop()
            found += 1
    assert found == 2
    assert brief == whole
