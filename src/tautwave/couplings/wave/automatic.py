"""Keys of a wave pair that the rig leaves to the law: `auto`; the door to `choice`.

A module of its own between `keys`, which `choice` needs, and `choice`, which asks the certificate:
a rig that gives its numbers does not load that.
"""

from __future__ import annotations

from tautwave.config import Rig
from tautwave.config.keys.common import AUTO
from tautwave.types import Choice

KEYS = ("wave_filter_hz", "wave_impedance", "pole_master", "pole_slave")


def resolve(rig: Rig) -> dict[str, Choice]:
    """Return what each `auto` of a rig is, by its path in the coupling."""
    choices: dict[str, Choice] = {}
    for name, pair in rig.coupling.pairs.items():
        if any(getattr(pair, key) == AUTO for key in KEYS):
            from tautwave.couplings.wave.choice import choose_pair

            chosen = choose_pair(rig, name)
            choices |= {f"pairs.{name}.{key}": chosen[key] for key in KEYS if key in chosen}
    return choices
