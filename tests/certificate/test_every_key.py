"""Every number of a law is in its verdict, or stands here with why it need not be.

A verdict is computed, and again with one number changed: where nothing that it says or states has
changed, it has not read it. A new key or constant that is neither read nor listed fails.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from typing import Any

import pytest

from tautwave import registry
from tautwave.certificate import certify
from tautwave.config import Rig
from tautwave.rig import controller, end_constants
from tautwave.rig.parts import coupling_part
from tautwave.types import CommandDelay
from tests.rigs.running import Tree, rig_of, tree

SPRING = {"stiffness": 20.0, "damping": 0.1}
LAWS: Mapping[str, Tree] = {
    "position": SPRING,
    "pd_damping": {**SPRING, "injection": 0.2},
    "position_force": SPRING,
    "four_channel": SPRING,
    "mediated": {},
    "wave": {"wave_impedance": 5.0, "wave_filter_hz": 60.0},
}
WALL = {"position": 0.1, "stiffness": 50.0}
OTHERS: Mapping[str, Any] = {
    "sign": -1,
    "offset": 0.01,
    "engage_tolerance": 0.02,
    "wall_master": WALL,
    "wall_slave": WALL,
    "force_scale": 1.3,
    "account": {},
}
"""Values of keys that are no numbers by default."""

MIRRORED = "a mirrored slave has the same energies"
WITH_OFFSET = "read with a fixed offset: what one engagement may supply"
RELEASE = "while it is released an axis has its own damping alone"
RAMP = "a port is in its account from its first period on"
KEYS: Mapping[str, Mapping[str, str]] = {
    "position": {"engage_tolerance": WITH_OFFSET, "release_ramp_s": RELEASE, "sign": MIRRORED},
    "pd_damping": {"engage_tolerance": WITH_OFFSET, "release_ramp_s": RELEASE, "sign": MIRRORED},
    "wave": {
        "engage_ramp_s": RAMP,
        "offset": "a line begins without waves, wherever its ends are",
        "engage_tolerance": "a line begins without waves, wherever its ends are",
        "observer_hz": "of the augmentation, off by default, which shares the port's account",
    },
}
REFUSED = {
    "position_force": "its two ends are not those of one spring",
    "four_channel": "its two ends are not those of one spring",
    "mediated": "what it renders is learnt",
}
"""Refused whatever their gains are, without an account."""

EVERYWHERE = {
    "law": "another law",
    "pairs": "looked at one by one",
    "defaults": "keys of pairs",
    "part_sha256": "of a part that is a file",
}


def rig_with(law: str, pair: Tree, coupling: Tree) -> Rig:
    """A pair with a line, between levers of which everything is declared."""
    axes: Tree = {}
    for side in ("master", "slave"):
        for key, value in {
            "damping": 2.0, "coulomb": 0.1, "effort_limit": 10.0, "effort_rate_limit": 1e4,
            "velocity_limit": 2.0, "position_noise": 1e-6, "encoder_quantum": 1e-6,
        }.items():  # fmt: skip
            axes[f"{side}.axes.a.{key}"] = value
    keys = {"law": law, "delay_s": 0.004, "pairs": {"a": {**LAWS[law], **pair}}}
    return rig_of(tree(axes, {"coupling": {**keys, **coupling}}))


def said(rig: Rig) -> str:
    return json.dumps(certify(rig).as_dict(), default=str)


def leaves(value: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Yield the numbers of nested records, by path."""
    if not hasattr(value, "_fields"):
        yield path, value
        return
    for name in value._fields:
        yield from leaves(getattr(value, name), (*path, name))


def with_other(value: Any, path: tuple[str, ...]) -> Any:
    """Return nested records with another number at a path."""
    if path:
        return value._replace(**{path[0]: with_other(getattr(value, path[0]), path[1:])})
    if isinstance(value, bool):
        return not value
    return value + 1 if isinstance(value, int) else 0.7 * value or 0.01


CONSTANTS: Mapping[str, Mapping[str, str]] = {
    "position": {},
    "pd_damping": {
        "rejection": "of law four_channel",
        "observes": "of laws that use an external effort; its gains are 0 here",
        "measures": "of laws that use an external effort; its gains are 0 here",
        "outside": "of laws that use an external effort; its gains are 0 here",
    },
}
"""Of laws that are passive by their tuning, whose verdict asks the law itself."""


@pytest.mark.parametrize("law", sorted(CONSTANTS))
def test_every_constant_of_a_tuned_law_is_asked_for(
    law: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig = rig_with(law, {}, {})
    before = said(rig)
    unread = set()
    for path, value in leaves(end_constants(rig, "master.a", CommandDelay(0, 0.0))):
        assert not isinstance(value, float) or math.isfinite(value)

        def patched(some: Rig, path: tuple[str, ...] = path) -> Any:
            part = coupling_part(some)
            make = registry.load_named(part.end_constants)
            return part._replace(end_constants=lambda *given: with_other(make(*given), path))

        with monkeypatch.context() as patch:
            patch.setattr(controller, "coupling_part", patched)
            if said(rig_with(law, {}, {})) == before:
                unread.add(path[0])
    assert unread == CONSTANTS[law].keys()


def other(name: str, value: Any, annotation: Any) -> Any:
    """Return another value of a key."""
    if name in OTHERS:
        return OTHERS[name]
    if isinstance(value, bool):
        return not value
    if isinstance(value, int | float):
        return 1.5 * value or 0.05
    choices = [one for one in getattr(annotation, "__args__", ()) if isinstance(one, str)]
    return next((one for one in choices if one != value), 0.3)


def unread_keys(law: str) -> set[str]:
    """Return the keys of a law that change nothing in its certificate."""
    rig = rig_with(law, {}, {})
    before, found = said(rig), set()
    for model, of_pair in ((rig.coupling, False), (rig.coupling.pairs["a"], True)):
        for name, field in type(model).model_fields.items():
            if name in EVERYWHERE or (law == "wave" and name == "account"):
                continue
            change = {name: other(name, getattr(model, name), field.annotation)}
            if name == "offset":
                change["engage_tolerance"] = 0.02
            changed = rig_with(law, change if of_pair else {}, {} if of_pair else change)
            if said(changed) == before:
                found.add(name)
    return found


@pytest.mark.slow
@pytest.mark.parametrize("law", sorted(KEYS))
def test_every_key_of_a_law_is_in_its_verdict(law: str) -> None:
    unread = unread_keys(law)
    assert unread <= KEYS[law].keys()
    assert KEYS[law].keys() - unread <= {"sign"}  # rounding may tell it


@pytest.mark.parametrize("law", sorted(REFUSED))
def test_a_law_without_a_proof_is_refused_with_any_keys(law: str) -> None:
    changes = [{}, {"stiffness": 0.001, "damping": 0.0}]
    for change in changes:
        found = certify(rig_with(law, change, {"delay_s": 0.0})).verdicts["passive"]
        assert not found.passed


def test_every_law_is_looked_at() -> None:
    """Laws of this distribution: another's own suite looks at its own."""
    assert set(LAWS) == set(registry.coupling_names()) == {*KEYS, *REFUSED}
