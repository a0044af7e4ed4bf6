"""`scene.discretise: with_device`: the numbers that a rig's scene runs with."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING

from tautwave.config import Rig
from tautwave.errors import ConfigError
from tautwave.rig.hands import stated_hand
from tautwave.rig.ways import command_delays
from tautwave_scenes.config.keys import Scene
from tautwave_scenes.networks.network import Network

if TYPE_CHECKING:  # only such a scene loads the mathematics
    from tautwave_scenes.networks.with_device import Held, Tuned


def tuned_scene(rig: Rig, network: Network) -> Tuned | None:
    """Return a scene's network with the numbers it runs with; None if it keeps its own.

    Raises
    ------
    ConfigError
        The network is of another kind, or there are no such numbers at the rig's rate.
    """
    scene = rig.scene
    if not isinstance(scene, Scene) or scene.discretise == "alone":
        return None
    from tautwave_scenes.networks.with_device import Held, why_not

    reason = why_not(network)
    name = next(iter(scene.ports))
    delay = command_delays(rig)[f"master.{name}"]
    if reason is None and delay.remainder_s > 0.0:
        reason = "its device's command delay must be a whole number of periods"
    if reason is not None:
        raise ConfigError(f"scene.discretise: with_device: {reason}; remove the key")
    axis, hand = rig.axes[f"master.{name}"], stated_hand(rig, name).hand
    assert axis.inertia is not None
    held = Held(
        axis.inertia.value + hand.mass,
        axis.damping.value + hand.damping,
        hand.stiffness,
        delay.periods,
        scene.ports[name].position_scale,
    )
    return _tuned(network, scene.scheme, rig.period_s, held)


@functools.lru_cache(maxsize=16)  # a rig's network is asked for in many places
def _tuned(network: Network, scheme: str, period: float, held: Held) -> Tuned:
    from tautwave_scenes.networks.with_device import tune

    try:
        return tune(network, scheme, period, held)
    except ValueError as err:
        raise ConfigError(f"scene.discretise: with_device: {err}") from err
