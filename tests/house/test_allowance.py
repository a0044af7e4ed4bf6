"""What an axis has is read from its allowance; who may read the keys themselves is listed here."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

from tautwave.allowance import AxisAllowance

ROOT = Path(__file__).parents[2]
PACKAGES = ("src/tautwave", "src/tautwave_scenes", "drivers/tautwave_drivers", "sim/tautwave_sim")

KEYS = {"effort_limit", "effort_rate_limit"}
BELIEFS = {"damping", "coulomb"}
"""Whose `lower` is sure."""
SUSPECT = re.compile(r"\.(?:effort_limit|effort_rate_limit|(?:damping|coulomb)\.lower)\b")

OWNERS = {
    "src/tautwave/rig/allowance/": "fills the allowance",
    "src/tautwave/config/": "the keys and their own ranges; the truth that they are the default of",
    "drivers/": "write the limits into the hardware, which they own",
    "sim/": "are the hardware",
    "src/tautwave/simulation/kernel/": "is the hardware, compiled: limits of the simulated truth",
}
ALLOWED = {
    "src/tautwave/rig/truth.py": "hands the limits of the simulated truth to the hardware",
    "src/tautwave/rig/arms.py": "of a load, before it is shared; and the keys of a gentle rig",
    "src/tautwave/rig/clips.py": "the key is a wall's own share, not its motor's limit",
    "src/tautwave/rig/led.py": "makes a key of a key: what a policy's hand may press with",
    "src/tautwave_scenes/rig/network.py": "a speed to choose a scheme for, without a limit",
    "src/tautwave/certificate/belief.py": "compares what is believed with the simulated truth",
    "src/tautwave/certificate/buses.py": "the limit is that of a policy's hand, not of a motor",
    "src/tautwave/couplings/account/steps.py": "of a `CoupledAxis`, which the allowance fills",
    "src/tautwave/couplings/wave/from_keys.py": "of a `CoupledAxis`, which the allowance fills",
    "src/tautwave/couplings/wave/messages.py": "text: how long a follower's spring gets",
    "src/tautwave/couplings/mediated/keys.py": "chooses a default before an axis is built",
    "src/tautwave_scenes/report/inputs.py": "text: what the rig states",
    "src/tautwave/view/facts.py": "text: what the rig states",
    "src/tautwave/session/plan.py": "text: what is in and what is left out",
    "src/tautwave/session/checking.py": "text: what the rig states",
    "src/tautwave/session/facts.py": "text: what the rig states",
    "src/tautwave/session/acceptance/guides.py": "asks for a share; the controller limits it",
    "src/tautwave/session/acceptance/motion.py": "asks for a share; the controller limits it",
    "src/tautwave/session/acceptance/sensors.py": "an upper bound of friction: the motor's effort",
    "src/tautwave/session/identification/exciting.py": "asks for a share; the controller limits it",
    "src/tautwave/session/identification/identifying.py": "of a fit, from which keys are made",
    "src/tautwave/session/identification/lever.py": "of a fit, from which keys are made",
    "src/tautwave/session/calibration/identify.py": "of a fit, from which keys are made",
}


def raw_reads(source: str) -> list[str]:
    """Return what of an axis a source reads past its allowance, by name."""
    if not SUSPECT.search(source):
        return []
    return sorted(name for node in ast.walk(ast.parse(source)) if (name := _raw(node)))


def _raw(node: ast.AST) -> str:
    if not isinstance(node, ast.Attribute) or not isinstance(node.ctx, ast.Load):
        return ""
    if node.attr in KEYS:
        return node.attr
    held = node.value
    if node.attr == "lower" and isinstance(held, ast.Attribute) and held.attr in BELIEFS:
        return f"{held.attr}.lower"
    return ""


def readers() -> Iterator[str]:
    """Yield the modules that read the keys, without their owners."""
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            name = str(path.relative_to(ROOT))
            if not name.startswith(tuple(OWNERS)) and raw_reads(path.read_text()):
                yield name


def test_nobody_else_reads_what_an_axis_has() -> None:
    found = set(readers())
    assert not found - ALLOWED.keys(), "read `tautwave.rig.axis_allowance` instead"
    assert not ALLOWED.keys() - found, "these read no key any more"


def test_a_planted_reader_is_noticed() -> None:
    source = """
def greatest(axis):
    axis.effort_limit = 3.0
    return min(axis.effort_limit, axis.damping.lower, axis.inertia.lower, axis.coulomb.lower)
"""
    assert raw_reads(source) == ["coulomb.lower", "damping.lower", "effort_limit"]
    assert raw_reads("allowance.damping - allowance.load_damping") == []


def test_every_share_has_a_reader() -> None:
    """A share that nobody reads is a number that nobody keeps to."""
    shares = {*AxisAllowance._fields} | {
        name for name, kind in vars(AxisAllowance).items() if isinstance(kind, property)
    }
    read = {
        node.attr
        for package in PACKAGES
        for path in (ROOT / package).rglob("*.py")
        if not str(path.relative_to(ROOT)).startswith("src/tautwave/allowance/")
        and "allowance" in (source := path.read_text())
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Load)
    }
    assert not shares - read
