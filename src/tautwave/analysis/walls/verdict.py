"""One wall on one device: passive or not, why, what would help, and whether a hand holds it.

Passivity is judged on the device's own damping, for every user; coupled stability on the device
with the hand that is stated. The two are never mixed.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

from tautwave.analysis.walls.limits import TIGHT, greatest_damping, greatest_stiffness, least_rate
from tautwave.analysis.walls.passivity import Leak, wall_leak
from tautwave.analysis.walls.rules import quantised_stiffness, quantum_activity, quantum_force
from tautwave.analysis.walls.sampled import SampledWall
from tautwave.analysis.walls.stability import StableRange, held_device, stable_stiffness, wall_mode
from tautwave.models.hand import Hand


class WallDevice(NamedTuple):
    """What a wall acts on; SI, linear or rotary. `damping` is what is certainly there.

    mass [kg or kg m^2]; damping [N s/m or N m s/rad]; coulomb friction [N or N m]; encoder
    quantum [m or rad].
    """

    mass: float
    damping: float = 0.0
    coulomb: float = 0.0
    quantum: float = 0.0


class Blame(NamedTuple):
    """Parts of the needed damping [N s/m or N m s/rad]; they add up to it.

    sampling: K T / 2 of the hold; delay: what the delay adds to the spring; damping: what the
    wall's B adds to both; filter: what its filter adds. Below 0: it helps.
    """

    sampling: float
    delay: float
    damping: float
    filter: float


class Remedies(NamedTuple):
    """Each alone makes the wall passive. 0 stiffness, -inf damping, inf rate: cannot.

    stiffness [N/m or N m/rad] and damping B [N s/m or N m s/rad] to lower to; rate [Hz] to raise
    to, the delay in periods shrinking along; added device damping [N s/m or N m s/rad].
    """

    stiffness: float
    damping: float
    rate: float
    added: float


class WallVerdict(NamedTuple):
    """All about one wall.

    Attributes
    ----------
    wall, device : SampledWall, WallDevice
        The wall and the device.
    leak : Leak
        Required damping and its frequency.
    passive : bool
        Colgate and Schenkel's condition holds with the device's own damping.
    margin : float
        Device damping less the needed one [N s/m or N m s/rad].
    passive_stiffness, prompt_stiffness : float
        Greatest passive K, and the same without the delay [N/m or N m/rad].
    blame, remedies : Blame, Remedies
        Why, and what to do.
    hand : Hand or None
        Hand of the coupled loop.
    stable : StableRange
        Stiffnesses at which device and hand are stable at the wall.
    coupled_stable : bool
        The wall's K is one of them.
    decay : float
        Of the least damped mode with the hand, ln|z| / T [1/s]; negative: it dies out.
    passive_quantised : bool
        Abbott and Okamura's condition, with delay and damping: friction exceeds the error of
        the encoder's step, and `passive`.
    quantised_stiffness : float
        min(2 b / T, 2 c / Q) [N/m or N m/rad]: of a prompt spring.
    activity : float
        Energy that the quantum lets out per two samples, at most [J]; 0, or inf.
    """

    wall: SampledWall
    device: WallDevice
    leak: Leak
    passive: bool
    margin: float
    passive_stiffness: float
    prompt_stiffness: float
    blame: Blame
    remedies: Remedies
    hand: Hand | None
    stable: StableRange
    coupled_stable: bool
    decay: float
    passive_quantised: bool
    quantised_stiffness: float
    activity: float


@functools.lru_cache(maxsize=256)  # the same wall is assessed before a run and after it
def assess_wall(wall: SampledWall, device: WallDevice, hand: Hand | None = None) -> WallVerdict:
    """Return the verdicts on a wall.

    Raises
    ------
    ConfigError
        A number is out of range.
    """
    leak = wall_leak(wall)
    passive = leak.damping <= device.damping * (1.0 + TIGHT)
    limit = greatest_stiffness(wall, device.damping)
    prompt = limit
    if wall.delay > 0.0:
        prompt = greatest_stiffness(wall._replace(delay=0.0), device.damping)
    held = held_device(device.mass, device.damping, hand)
    stable = stable_stiffness(wall, held)
    decay = wall_mode(wall, held).growth if wall.stiffness > 0.0 else 0.0
    force = quantum_force(wall, device.quantum)
    return WallVerdict(
        wall=wall,
        device=device,
        leak=leak,
        passive=passive,
        margin=device.damping - leak.damping,
        passive_stiffness=limit,
        prompt_stiffness=prompt,
        blame=blame_of(wall, leak),
        remedies=remedies_of(wall, device, leak, limit),
        hand=hand,
        stable=stable,
        coupled_stable=any(low <= wall.stiffness <= high for low, high in stable.bands),
        decay=decay,
        passive_quantised=passive and force <= device.coulomb * (1.0 + TIGHT),
        quantised_stiffness=quantised_stiffness(
            device.damping, device.coulomb, wall.period, device.quantum
        ),
        activity=quantum_activity(
            wall, device.damping, device.coulomb, device.quantum, needed=leak.damping
        ),
    )


def blame_of(wall: SampledWall, leak: Leak) -> Blame:
    """Return the parts of the needed damping, put on one after the other."""
    sampling = 0.5 * wall.stiffness * wall.period
    lagged = wall_leak(wall._replace(damping=0.0)).damping
    damped = leak.damping
    if wall.filter_s > 0.0:
        damped = wall_leak(wall._replace(filter_s=0.0)).damping
    return Blame(sampling, lagged - sampling, damped - lagged, leak.damping - damped)


def remedies_of(wall: SampledWall, device: WallDevice, leak: Leak, limit: float) -> Remedies:
    """Return what makes the wall passive, `limit` being its greatest passive K."""
    if leak.damping <= device.damping * (1.0 + TIGHT):
        return Remedies(wall.stiffness, wall.damping, 1.0 / wall.period, 0.0)
    return Remedies(
        min(limit, wall.stiffness),
        min(greatest_damping(wall, device.damping), wall.damping),
        least_rate(wall, device.damping),
        leak.damping - device.damping,
    )
