"""What an axis without account supplies to a prompt host, where no term says it by itself."""

from __future__ import annotations

import math
import re
from typing import Any

import pytest

from tautwave.certificate import certify
from tautwave.certificate.data import Certificate, Element
from tautwave.certificate.tuning.prompt import Term, judge_sum
from tautwave.config import Rig
from tautwave.rig import command_delays, kinetic_energy
from tautwave.session import check
from tautwave.session.claims import claims_of
from tests.rigs.running import rig_of, tree

BOTH = ("master", "slave")
LIMITS = {
    "inertia": {"value": 0.5, "lower": 0.5, "source": "test"},
    "velocity_limit": 5.0,
    "effort_limit": 300.0,
    "position_range": [-1.5, 1.5],
    "damping": 30.0,
}
CHANGE = re.compile(r"(coupling\.engage_ramp_s|wall_master\.stiffness) of ([\d.e+-]+)")
NAMES = {"wall_master.stiffness": "coupling.pairs.a.wall_master.stiffness"}


def spring(ramp: float, seconds: float, **changes: Any) -> Rig:
    """A spring with a wall under noise: 4.4 mW for ever, and what its ends are moved apart."""
    keys: dict[str, Any] = {f"{side}.axes.a.{key}": LIMITS[key] for side in BOTH for key in LIMITS}
    wall = {"position": 0.5, "side": "above", "stiffness": 10e3, "damping": 0.0}
    keys |= {
        "coupling.law": "position",
        "coupling.engage_ramp_s": ramp,
        "coupling.pairs.a": {"stiffness": 1000.0, "damping": 0.0, "wall_master": wall},
        "master.axes.a.position_noise": 1e-4,
        "duration_s": seconds,
        "loop": {"overrun_limit": 2, "missing_limit": 2},
        **changes,
    }
    return rig_of(tree(keys))


def sums(certificate: Certificate) -> list[Element]:
    return [one for one in certificate.elements if one.kind == "claim"]


def terms(rig: Rig) -> dict[str, float]:
    """Engagement and noise over twice the kinetic energy of the master's device."""
    elements = {one.kind: one.numbers for one in certify(rig).elements if "slave" not in one.axis}
    most = 2.0 * kinetic_energy(rig, "master.a")
    return {
        "engage": elements["coupling"].get("engage_j", 0.0) / most,
        "noise": elements["wall"]["noise_w"] * rig.claimed_s / most,
    }


@pytest.mark.parametrize(
    ("ramp", "seconds", "changed"),
    [
        (0.014, 900.0, ["coupling.engage_ramp_s"]),
        (0.008, 2500.0, ["wall_master.stiffness"]),
        pytest.param(
            0.019,
            3000.0,
            ["coupling.engage_ramp_s", "wall_master.stiffness"],
            marks=pytest.mark.slow,
        ),
    ],
)
def test_a_sum_names_its_terms_and_what_makes_it_less(
    ramp: float, seconds: float, changed: list[str]
) -> None:
    rig = spring(ramp, seconds)
    [element] = sums(certify(rig))
    [said] = element.passive.conditions
    assert element.passive.passed
    parts = terms(rig)
    assert sum(parts.values()) > 1.0
    of_kinetic = 2.0 * sum(parts.values())
    assert f"{of_kinetic:.1f} times" in said
    assert "moved apart while it engages" in said
    assert "by noise at its wall" in said
    found = dict(CHANGE.findall(said))
    assert sorted(found) == sorted(changed)
    assert "would do" in said
    less = {NAMES.get(key, key): float(value) for key, value in found.items()}
    assert not sums(certify(spring(ramp, seconds, **less))), "a remedy that is named is enough"


def test_noise_of_a_wall_alone_is_a_condition() -> None:
    """Without an engagement's share: 4 mW for half an hour and more."""
    rig = spring(0.0, 3000.0)
    assert terms(rig)["noise"] > 1.0
    [element] = sums(certify(rig))
    assert "by noise at its wall in 3000 s" in element.passive.conditions[0]
    assert not sums(certify(spring(0.0, 100.0)))


def fixed(energy: float, words: str, *, lasting: bool = False) -> Term:
    return Term(energy, words, lasting, lambda left: "")


def test_what_is_supplied_at_once_in_all_may_be_refused() -> None:
    """Neither alone is more than ten times the kinetic energy, both are."""
    rig = spring(0.0, 1.0)
    half = [fixed(6.0, "by one"), fixed(5.0, "by another")]
    refused = judge_sum(rig, "master.a", half, 1.0)
    assert refused is not None
    assert not refused.passed
    assert "11 J at once" in refused.reason
    assert "6 J by one, 5 J by another" in refused.reason
    lasting = [half[0], fixed(5.0, "by noise", lasting=True)]
    depends = judge_sum(rig, "master.a", lasting, 1.0)
    assert depends is not None
    assert depends.passed
    assert judge_sum(rig, "master.a", half, math.inf) is None
    assert judge_sum(rig, "master.a", [fixed(3.0, "by one")], 1.0) is None, "said by its element"


def test_a_claim_that_is_refused_is_said_where_another_verdict_is_required() -> None:
    """The law is passive all the same: what an engagement supplies is a number, not no bound."""
    refused = {"coupling.engage_ramp_s": 0.5}
    rig = spring(0.5, 1.0)
    assert check(rig, brief=True).exit_code == 3
    allowed = spring(0.5, 1.0, require="coupled_stable", **refused)
    done = check(allowed, brief=True)
    assert done.exit_code == 0
    claims = {one.axis: one for one in done.claims}
    for name in ("master.a", "slave.a"):
        assert claims[name].judged == "refused"
        assert claims[name].stated is not None
        assert claims[name].stated.prompt_j < math.inf
        assert "coupling.engage_ramp_s of" in claims[name].refusal
        assert claims[name].as_dict()["refusal"] == claims[name].refusal
    elements = [one.as_dict() for one in certify(allowed).elements]
    again = claims_of(allowed, command_delays(allowed), elements)
    assert [one.judged for one in again] == ["refused", "refused"]
