"""A rig whose master a policy takes over: virtual devices, held by virtual hands that it leads."""

from __future__ import annotations

import math
from collections.abc import Mapping

from tautwave.config import Axis, Hand, Pointer, Policy, Rig
from tautwave.config.keys.devices import Bus
from tautwave.config.keys.operate import Operate
from tautwave.config.keys.simulation import Simulation
from tautwave.errors import ConfigError

BUS = "policy"
SPEED_SHARE = 0.25
"""Speed of a hand whose rig gives none, as a share of its axis' velocity limit."""
LEVER_ARM = 0.075
"""[m] Of a light grip on a rotary axis, as where nothing is stated."""
POINTER_SHARE = 0.15
"""The same of a hand that a pointer leads; a mouse jumps."""
INSIDE = 0.8
"""Share of an axis' range inside which a pointer leads it, so that it does not run out of it."""
GRIP_N = 20.0
"""[N] Of a hand on a master that takes velocity."""
SENSED = {
    "encoder_quantum": 0.0,
    "encoder_nonlinearity": 0.0,
    "position_noise": 0.0,
    "position_noise_autocorrelation": None,
    "effort_quantum": 0.0,
    "effort_sensor": None,
    "compensation": None,
    "load": None,
}
"""What a virtual device has not."""


def pointed_hands(rig: Rig) -> list[str]:
    """Return the pairs, or axes of a scene, whose hands follow the pointer of a page."""
    hands = {} if rig.simulation is None else rig.simulation.hand
    return [
        name
        for name, hand in hands.items()
        if isinstance(getattr(hand, "reference", None), Pointer)
    ]


def led_by_policy(rig: Rig, fps: float = 30.0) -> Rig:
    """Return the rig with virtual devices in place of its masters; the slaves stay what they are.

    Each has the inertia and damping that are believed of the master, and a hand of the simulation's
    grip or a light one. A rig with hands that a policy leads already keeps them, and one with
    `operate.policy` its masters.

    Parameters
    ----------
    rig : Rig
        Any rig with masters that take effort.
    fps : float
        Actions a second.

    Raises
    ------
    ConfigError
        A master takes velocity, or the rig has none.
    """
    if rig.scene is not None:
        raise ConfigError(f"{rig.name}: a rig with a scene has no master that a policy could drive")
    if rig.operate is not None and (policy := rig.operate.policy) is not None:
        keys = policy.model_copy(update={"fps": fps})
        return rig.model_copy(update={"operate": rig.operate.model_copy(update={"policy": keys})})
    operated = rig.model_copy(update={"operate": rig.operate or Operate()})
    hands = {} if rig.simulation is None else dict(rig.simulation.hand)
    if any(isinstance(getattr(hand, "reference", None), Policy) for hand in hands.values()):
        return operated
    axes = {}
    for number, (name, axis) in enumerate(rig.master.axes.items()):
        if axis.inertia is None:
            raise ConfigError(
                f"master.axes.{name}: velocity-controlled; a policy can only "
                "drive effort-controlled masters"
            )
        axes[name] = axis.model_copy(update={**SENSED, "bus": BUS, "id": number})
        hands[name] = _hand(axis, hands.get(name), fps)
    used = {axis.bus for axis in rig.slave.axes.values()}
    buses = {name: bus for name, bus in rig.buses.items() if name in used}
    buses[BUS] = Bus(driver="loopback")
    master = rig.master.model_copy(update={"axes": axes, "arm": None, "arms": None})
    return operated.model_copy(
        update={
            "buses": buses,
            "master": master,
            "simulation": _simulation(rig, hands),
            "calibration": _slaves_only(rig),
        }
    )


def led_by_pointer(rig: Rig) -> Rig:
    """Return the rig with hands that follow the pointer of its page, at every simulated master.

    Each keeps its grip, or has a light one, and the reach of the motion that it would have made.

    Raises
    ------
    ConfigError
        The rig simulates nothing.
    """
    if rig.simulation is None:
        raise ConfigError(
            f"{rig.name}: nothing is simulated, and a pointer moves no hardware; add a "
            "`simulation` block, or leave --pointer out"
        )
    hands = dict(rig.simulation.hand)
    for name, axis in rig.master.axes.items():
        given = hands.get(name)
        lever = LEVER_ARM if axis.kind == "rotary" else None
        reference = getattr(given, "reference", None)
        if isinstance(reference, Pointer):
            continue
        lead = Pointer(
            type="pointer",
            range=_reach(axis, reference),
            velocity_limit=POINTER_SHARE * (axis.velocity_limit or 1.0 / POINTER_SHARE),
            effort_limit=axis.effort_limit or GRIP_N * (lever or 1.0),
        )
        if isinstance(given, Hand):
            hands[name] = given.model_copy(update={"reference": lead})
        else:
            hands[name] = Hand(lever_arm=lever, reference=lead)
    simulation = rig.simulation.model_copy(update={"hand": hands})
    return rig.model_copy(update={"simulation": simulation})


def _reach(axis: Axis, reference: object) -> tuple[float, float] | None:
    """Return half as far again as a motion goes, well inside the axis' range; None: unknown."""
    low, high = axis.position_range or (-math.inf, math.inf)
    if math.isfinite(high - low):
        inside = 0.5 * (1.0 - INSIDE) * (high - low)
        low, high = low + inside, high - inside
    places = [place for _, place in getattr(reference, "waypoints", ())]
    if places and min(places) < max(places):
        spare = 0.25 * (max(places) - min(places))
        low, high = max(low, min(places) - spare), min(high, max(places) + spare)
    return (low, high) if math.isfinite(high - low) else None


def _hand(axis: Axis, given: object, fps: float) -> Hand:
    speed = 1.0 if axis.velocity_limit is None else SPEED_SHARE * axis.velocity_limit
    reference = Policy(type="policy", fps=fps, velocity_limit=speed, effort_limit=axis.effort_limit)
    if isinstance(given, Hand):
        return given.model_copy(update={"reference": reference})
    return Hand(lever_arm=LEVER_ARM if axis.kind == "rotary" else None, reference=reference)


def _simulation(rig: Rig, hands: Mapping[str, object]) -> Simulation:
    old = rig.simulation or Simulation()
    slaves = {name: one for name, one in old.axes.items() if name.startswith("slave.")}
    arms = {name: arm for name, arm in old.arms.items() if name.partition(".")[0] == "slave"}
    return old.model_copy(update={"axes": slaves, "hand": hands, "arms": arms})


def _slaves_only(rig: Rig) -> object:
    calibration = rig.calibration
    if calibration is None:
        return None
    axes = {name: one for name, one in calibration.axes.items() if name.startswith("slave.")}
    return calibration.model_copy(update={"axes": axes}) if axes else None
