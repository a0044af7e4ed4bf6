"""Keys of law mediated: their values where a rig leaves them to it, and what it asks of a rig.

[rad | m] reads "rad for a rotary axis, m for a linear one".
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal

from pydantic import Field

from tautwave.config import Rig
from tautwave.config.keys.common import AUTO, Name, NonNegative, Positive
from tautwave.config.keys.coupling import AnyPair, Coupling, Gain, Pair
from tautwave.config.text.document import Document
from tautwave.types import Choice


class MediatedPair(Pair):
    """A slave axis that follows a master axis, which renders what the slave touches."""

    stiffness: Gain = Field(
        default="auto",
        description="[N m/rad | N/m] Stiffness of the spring by which the slave follows, in "
        "master units. auto: the slave on it resonates at 16 Hz, or at a hundredth of "
        "the rate if that is lower.",
    )
    damping: Gain = Field(
        default="auto",
        description="[N m s/rad | N s/m] Damping of that spring, in master "
        "units. auto: 0.7 of critical.",
    )
    force_gain: NonNegative = Field(
        default=1.0,
        description="Share of the effort rendered at the master that the slave applies in "
        "addition to following; 1: both apply the same effort.",
    )
    effort: Literal["observed", "measured"] = Field(
        default="observed",
        description="External effort on the slave: observed from position and command, or "
        "measured by its `effort_sensor`.",
    )
    observer_hz: Positive = Field(
        default=80.0,
        description="[Hz] Bandwidth of the observer of that effort, and of the filter on all "
        "signals of the estimate; identified friction (`value`) is subtracted.",
    )
    touch: Gain = Field(
        default="auto",
        description="[N m | N, slave] External effort at which a contact begins; it ends at half "
        "of it. auto: 2 % of the slave's effort limit and its Coulomb friction.",
    )
    memory_s: Positive = Field(
        default=0.5,
        description="[s] Time after which a sample's weight in the estimate has fallen to 1/e.",
    )
    sure: Annotated[float, Field(gt=0, le=1)] = Field(
        default=0.2,
        description="Maximum half-width of the stiffness' 95 % interval, relative to the "
        "stiffness, for an estimate to be used.",
    )
    stiffest: Gain = Field(
        default="auto",
        description="[N m/rad | N/m] Maximum stiffness that the master renders. auto: m / (7 T)^2 "
        "of the master. The leak that `check` states grows with it.",
    )
    adopt_s: Positive = Field(
        default=0.05,
        description="[s] Time constant with which a surface in contact adapts to the estimate.",
    )


class MediatedCoupling(Coupling):
    """The slave follows; the master renders what it touches."""

    law: Literal["mediated"] = Field(description="Model-mediated.")
    pairs: Mapping[Name, MediatedPair] = Field(
        description="The pairs by name: one per axis of each side."
    )


FASTEST = 100.0
"""[rad/s] 16 Hz: beyond what a hand moves by will."""

PER_RATE = 2.0 * math.pi / 100.0
DAMPED = 0.7
SLOWEST_PERIODS = 7.0
TOUCH = 0.02


def resolve(rig: Rig) -> dict[str, Choice]:
    """Return what each `auto` of a rig is, by its path in the coupling."""
    choices: dict[str, Choice] = {}
    for name, pair in rig.coupling.pairs.items():
        assert isinstance(pair, MediatedPair)
        for key, choice in _chosen(rig, name, pair).items():
            if getattr(pair, key) == AUTO:
                choices[f"pairs.{name}.{key}"] = choice
    return choices


def _chosen(rig: Rig, name: str, pair: MediatedPair) -> dict[str, Choice]:
    master, slave = rig.master.axes[name], rig.slave.axes[name]
    assert master.inertia is not None
    assert slave.inertia is not None
    mass = slave.inertia.value / pair.in_device_units("slave", 1.0)
    bounds = {"16 Hz": FASTEST, "a hundredth of the rate": PER_RATE * rig.rate_hz}
    which = min(bounds, key=lambda it: bounds[it])
    stiffness = pair.stiffness
    if isinstance(stiffness, str):
        stiffness = float(f"{mass * bounds[which] ** 2:.4g}")
    damping = 2.0 * DAMPED * math.sqrt(stiffness * mass)
    touch = TOUCH * slave.effort_limit + slave.coulomb.value
    stiffest = master.inertia.lower / (SLOWEST_PERIODS * rig.period_s) ** 2
    return {
        "stiffness": Choice(stiffness, f"the slave oscillates at {which} with {mass:.3g}"),
        "damping": Choice(float(f"{damping:.4g}"), "0.7 of critical"),
        "touch": Choice(
            float(f"{touch:.4g}"), "2 % of the slave's effort limit and its Coulomb friction"
        ),
        "stiffest": Choice(float(f"{stiffest:.4g}"), "the master on it has a period of 44 samples"),
    }


SLOWEST_HZ = 500.0
"""Rate below which its estimate of a contact takes longer than a hand's press."""

SHARED = frozenset(AnyPair.model_fields)
"""Keys that pairs of all laws have."""


def missing(document: Document) -> Iterator[str]:
    """Yield what a rig has that law mediated does not do, or lacks that it needs in an account.

    Each is the end of a sentence whose subject is the law. Blocks that are none are reported where
    the rig is read.
    """
    rate = document.get(("rate_hz",))
    if not isinstance(rate, int | float) or rate < SLOWEST_HZ:
        yield f"needs {SLOWEST_HZ:g} Hz"
    if document.get(("require",)) == "coupled_stable":
        yield "is not certified as coupled_stable"
    if document.get(("operate", "scales")):
        yield "does not change its scale while it runs"
    if document.get(("arms",)):
        yield "joins no tips of arms"
    for pair in _blocks(document.get(("coupling", "pairs"))):
        own = sorted(set(pair) - SHARED)
        if own:
            yield f"is not chosen for a pair with {own[0]}"
    for bus in _blocks(document.get(("buses",))):
        if bus.get("divisor", 1) != 1:
            yield "needs both sides at the same rate"
    for side in ("master", "slave"):
        for axis in _blocks(document.get((side, "axes"))):
            if axis.get("causality", "impedance") != "impedance":
                yield "drives axes that take effort only"
            for key in ("inertia", "velocity_limit", "effort_rate_limit"):
                if axis.get(key) is None:
                    yield f"needs {key}"


def _blocks(value: Any) -> list[dict[str, Any]]:
    """Return the blocks of a mapping by name."""
    return [it for it in value.values() if isinstance(it, dict)] if isinstance(value, dict) else []
