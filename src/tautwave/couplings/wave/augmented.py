"""A wave port that says more of what its slave touches: force augmentation, paid by the tank.

A port sends (b v + R) / sqrt(2b), with R the effort of its motor. The device lies between motor and
environment: of an impact R is the late and low-passed part. With a force gain k the slave's leaving
wave gets

    k (F - R) / sqrt(2b)

on top, F the effort from outside as observed. At rest F is R and nothing is added. The addition
goes the way of a wave that was cut before: out of what the tank has above half its reserve, and
what it makes of the line's integral is given back within the drift time, so that positions agree.
`law_close` is that of the law inside.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from tautwave.contracts import CoupledAxis, CouplingPlugin
from tautwave.controller.records import AxisParams, AxisState, PairView
from tautwave.controller.steps import Law, no_close, no_start
from tautwave.controller.wrapping import bound, params_with, record_with
from tautwave.couplings.outside import outside_effort
from tautwave.couplings.wave.from_keys import end_constants
from tautwave.couplings.wave.keys import WaveCoupling, WavePair
from tautwave.errors import ConfigError
from tautwave.laws.observer import ReactionParams, observe, reaction
from tautwave.registry import load_named


class AugmentedParams(NamedTuple):
    """Observer of the external effort, and the gap of the waves that a force stands for.

    `share` [W**0.5 s per N m or N]: k / sqrt(2b), over what the port repays in a second.
    """

    outside: ReactionParams
    share: float


@dataclass(slots=True)
class Augmented:
    """Observed position, velocity and acceleration from outside; the gap that was added."""

    at: float = 0.0
    velocity: float = 0.0
    push: float = 0.0
    added: float = 0.0


law_start = no_start
law_close = no_close


def start(pair: PairView, gap: float) -> None:
    """Start the law inside, with nothing acting from outside."""
    one, two = pair.one, pair.two
    law_start(pair, gap)
    forget(one)
    forget(two)


def forget(s: AxisState) -> None:
    """Begin at rest."""
    e = s.end.augmented
    e.at = s.position
    e.velocity = 0.0
    e.push = 0.0
    e.added = 0.0


def close(
    s: AxisState, p: AxisParams, displacement: float, count: float, span: float, port: float
) -> None:
    """Observe what acts from outside; let the port owe it for this period."""
    k = p.end.augmented
    added = 0.0
    if k.share > 0.0:
        e = s.end.augmented
        at, velocity, push = observe(
            k.outside.observer, e.at, e.velocity, e.push, s.position, s.effort_sum / count, count
        )
        e.at = at
        e.velocity = velocity
        e.push = push
        if not s.stopping:
            added = k.share * (reaction(k.outside, velocity, push) - port)
    s.end.gap += added
    law_close(s, p, displacement, count, span, port)
    s.end.gap -= added


def with_augmentation(plugin: CouplingPlugin, coupling: WaveCoupling) -> CouplingPlugin:
    """Return law wave for a rig: itself, or with force augmentation where a pair asks for it."""
    if not any(pair.force_gain for pair in coupling.pairs.values()):
        return plugin
    return plugin._replace(
        law=augmented_law(load_named(plugin.law)),
        over_link=augmented_law(load_named(plugin.over_link)),
        at_sites={
            side: site._replace(law=augmented_law(site.law))
            for side, site in load_named(plugin.at_sites).items()
        },
        end_constants=augmented_constants,
        linear="",
    )


def augmented_law(law: Law) -> Law:
    """Return a law of wave ports whose slave's end may say more."""
    inside: Mapping[str, Any] = {"law_start": law.steps.start, "law_close": law.steps.close}
    return law._replace(
        name=f"{law.name} with force augmentation",
        steps=law.steps._replace(start=bound(start, inside), close=bound(close, inside)),
        end=record_with(law.end, "augmented", Augmented),
        rescaling=None,
    )


def augmented_constants(pair: WavePair, side: str, axis: CoupledAxis) -> Any:
    """Return the constants of one end: the port's, and `augmented`.

    Raises
    ------
    ConfigError
        The axis takes velocity, and its port sends what it measures.
    """
    if axis.inertia is None:
        raise ConfigError(
            f"law wave: force_gain needs axes that take effort, and the {side}'s takes velocity; "
            "leave it out"
        )
    given = end_constants(pair, side, axis)
    gain = pair.force_gain if side == "slave" else 0.0
    share = gain / given.port.root * axis.period / given.port.repay
    return params_with(
        given, "augmented", AugmentedParams(outside_effort(axis, pair.observer_hz), share)
    )
