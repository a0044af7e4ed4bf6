"""Several ports and their motors' limits: what slow rounds give, against the certificate."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from tautwave import Rig, Stepper
from tautwave.certificate import certify
from tautwave.config import parse_rig, resolved_yaml
from tests.commands import keep_in_one_process, tautwave

DAMPING = 0.6
AXIS: dict[str, Any] = {
    "bus": "x", "kind": "linear", "inertia": {"value": 0.5, "lower": 0.5, "source": "x"},
    "damping": {"value": DAMPING, "lower": DAMPING, "source": "x"}, "velocity_limit": 10,
    "position_range": [-10, 10],
}  # fmt: skip


def rig(limits: dict[str, float], **scene: Any) -> Rig:
    ports = {name: {"to": "o", "stiffness": 1000} for name in limits}
    axes = {
        name: AXIS | {"id": number + 1, "effort_limit": limit}
        for number, (name, limit) in enumerate(limits.items())
    }
    hand = {"mass": 0.01, "damping": 1, "stiffness": 100,
            "reference": {"type": "hold", "position": 0}}  # fmt: skip
    whole = {
        "name": "ports", "rate_hz": 1000, "duration_s": 60, "require": "passive",
        "buses": {"x": {"driver": "loopback"}}, "master": {"axes": axes},
        "scene": {"masses": {"o": {"mass": 0.05, "damping": 1.0}}, "ports": ports,
                  "hold_limit_j": 1e6, **scene},
        "simulation": {"axes": {}, "hand": dict.fromkeys(limits, hand)},
    }  # fmt: skip
    text = yaml.dump(whole, Dumper=_Plain)
    return parse_rig(text)


class _Plain(yaml.SafeDumper):
    """YAML without aliases, which a rig does not have."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


def passive(found: Rig) -> tuple[bool, str]:
    verdict = certify(found).verdicts["passive"]
    return verdict.passed, verdict.reason


def given(found: Rig, path: dict[str, list[float]], rounds: int = 1, slots: int = 800) -> float:
    """Return what the motors gave on closed paths less what the bearings could take [J]."""
    ease = np.linspace(0.0, 1.0, slots, endpoint=False)
    ease = ease**3 * (10.0 - 15.0 * ease + 6.0 * ease**2)
    names = list(path)
    corners = np.array([path[name] for name in names]).T
    after = np.roll(corners, -1, 0)
    legs = [a + (b - a) * ease[:, None] for a, b in zip(corners, after, strict=True)]
    places = np.concatenate([*legs] * rounds + [corners[:1].repeat(400, 0)])
    net, before = 0.0, None
    with Stepper(found, outside=("master",)) as stepper:
        for place in places:
            if before is not None:
                moved = place - before[0]
                net += float(before[1] @ moved - DAMPING * (moved @ moved) / 1e-3)
            sent = stepper.step({f"master.{n}": x for n, x in zip(names, place, strict=True)})
            before = place, np.array([sent[f"master.{name}"] for name in names])
    return net


ROUND = {"a": [0.0, 0.0, 0.5, 0.5], "c": [0.0, 0.06, 0.56, 0.5]}
"""Carry a stretched spring, and go back with it loose."""


@pytest.mark.slow
@pytest.mark.parametrize(("one", "two"), [(20.0, 1.0), (9.0, 1.0), (1.0, 20.0)])
def test_unequal_limits_give_each_round_and_are_not_certified(one: float, two: float) -> None:
    found = rig({"a": one, "c": two})
    good, why = passive(found)
    assert not good
    assert f"{one:g} N at a, {two:g} N at c" in why
    path = ROUND if one > two else {"a": ROUND["c"], "c": ROUND["a"]}
    once, often = (given(found, path, rounds) for rounds in (1, 2))
    assert once > 1.0
    assert often == pytest.approx(2.0 * once, rel=0.1)  # without end


@pytest.mark.slow
@pytest.mark.parametrize("limit", [1.0, 5.0, 20.0])
def test_equal_limits_are_certified_and_no_slow_round_gives(limit: float) -> None:
    found = rig({"a": limit, "c": limit})
    assert passive(found)[0]
    rng = np.random.default_rng(int(limit))
    paths = [ROUND, {"a": ROUND["c"], "c": ROUND["a"]}]
    paths += [
        {name: [0.0, *rng.uniform(-0.2, 0.2, 4)] for name in ("a", "c")} for _ in range(2)
    ]  # fmt: skip
    for path in paths:
        assert given(found, path) < 1e-3


def test_a_scale_counts_as_the_scene_s_force() -> None:
    scaled = {"a": {"to": "o", "stiffness": 1000}, "c": {"to": "o", "stiffness": 1000,
              "position_scale": 0.5}}  # fmt: skip
    assert passive(rig({"a": 20.0, "c": 10.0}, ports=scaled))[0]
    assert not passive(rig({"a": 20.0, "c": 20.0}, ports=scaled))[0]


@pytest.mark.slow
def test_a_ground_between_two_ports_is_not_certified_and_gives_at_the_edge() -> None:
    links = {"g": {"type": "spring", "between": ["o", "ground"], "stiffness": 400}}
    found = rig({"a": 20.0, "c": 20.0}, links=links)
    good, why = passive(found)
    assert not good
    assert "joins them with a ground" in why
    loop = {"a": [0.02, 0.12, 0.12, 0.02], "c": [-0.02, -0.02, 0.02, 0.02]}
    found_j = []
    for way in (1, -1):
        path = {name: [0.0, *places[::way] * 3] for name, places in loop.items()}
        found_j.append(given(found, path))
    assert max(found_j) > 0.1


def test_three_ports_and_weight_are_not_certified_and_ports_apart_are() -> None:
    three = rig({"a": 20.0, "b": 20.0, "c": 20.0})
    assert "joins more than two ports" in passive(three)[1]
    heavy = rig({"a": 20.0, "c": 20.0}, gravity=9.81)
    assert "have weight" in passive(heavy)[1]
    apart = rig(
        {"a": 20.0, "c": 1.0},
        masses={"o": {"mass": 0.05, "damping": 1.0}, "p": {"mass": 0.05, "damping": 1.0}},
        ports={"a": {"to": "o", "stiffness": 1000}, "c": {"to": "p", "stiffness": 1000}},
        links={name: {"type": "spring", "between": [name[0], "ground"], "stiffness": 400}
               for name in ("og", "pg")},
    )  # fmt: skip
    assert passive(apart)[0]


@pytest.mark.slow
@pytest.mark.parametrize(("limit", "broken"), [(20.0, 0), (0.02, 1)])
def test_a_run_with_a_motor_at_its_limit_did_not_keep_its_condition(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, limit: float, broken: int
) -> None:
    keep_in_one_process(monkeypatch)
    found = rig({"a": limit})
    assert certify(found).verdicts["passive"].conditions
    (tmp_path / "rig.yaml").write_text(resolved_yaml(found))
    moved = "simulation.hand.a.reference={type: minimum_jerk, waypoints: [[0.1, 0], [0.3, 0.05]]}"
    words = "--clock", "fake", "--out", "out", "--duration", "0.5", "--set", moved
    done = tautwave("run", "rig.yaml", *words, cwd=tmp_path)
    assert done.exit_code == 0, done.output
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    said = summary["certificate"]["after_run"]["broken_conditions"]
    assert len(said) == broken
    assert all("if the motor of master.a is not at its effort_limit while" in one for one in said)
