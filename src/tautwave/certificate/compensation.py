"""How the friction of the devices is spent: what is compensated is no longer there for others."""

from __future__ import annotations

from collections.abc import Iterator

from tautwave.certificate.belief import assumed, broken_coulomb, broken_damping
from tautwave.certificate.data import Element, Verdict
from tautwave.config import Axis, Rig


def spent_coulomb(rig: Rig, axis_name: str) -> float:
    """Return the Coulomb friction that is compensated [N m or N]."""
    axis = rig.axes[axis_name]
    return 0.0 if axis.compensation is None else axis.compensation.coulomb * axis.coulomb.lower


def left_of_friction(rig: Rig) -> Rig:
    """Return the rig as walls, ports and couplings may believe it: without what is compensated."""
    sides = {}
    for side in ("master", "slave"):
        whole = getattr(rig, side)
        if whole is None:
            continue
        axes = {name: _left(axis) for name, axis in whole.axes.items()}
        sides[side] = whole.model_copy(update={"axes": axes})
    if all(axis.compensation is None for axis in rig.axes.values()):
        return rig
    return rig.model_copy(update=sides)


def _left(axis: Axis) -> Axis:
    keys = axis.compensation
    if keys is None:
        return axis
    lower = (1.0 - keys.viscous) * axis.damping.lower
    return axis.model_copy(update={"damping": axis.damping.model_copy(update={"lower": lower})})


def compensation_elements(rig: Rig) -> Iterator[Element]:
    """Yield the compensation of each axis, with the budget of its friction."""
    for name, axis in rig.axes.items():
        keys = axis.compensation
        if keys is None:
            continue
        coulomb, viscous = keys.coulomb * axis.coulomb.lower, keys.viscous * axis.damping.lower
        effort, damping = ("N m", "N m s/rad") if axis.kind == "rotary" else ("N", "N s/m")
        head = f"compensation of {name}"
        reason = (
            f"{head}: passive by proof with the device's own friction, of which it takes "
            f"{coulomb:.3g} of {axis.coulomb.lower:.3g} {effort} and {viscous:.3g} of "
            f"{axis.damping.lower:.3g} {damping}; walls, ports and couplings have the rest."
        )
        conditions = assumed(axis, name, damping=viscous > 0.0, coulomb=coulomb > 0.0)
        verdict = Verdict(True, reason, tuple(conditions))
        broken = (broken_coulomb(rig, name), broken_damping(rig, name))
        for text in broken:
            if text is not None:
                verdict = Verdict(False, f"{head}: {text}")
        numbers = {
            "coulomb": [coulomb, axis.coulomb.lower],
            "damping": [viscous, axis.damping.lower],
            "holds": "by proof",
        }
        yield Element(head, "compensation", name, verdict, verdict, numbers, (verdict.reason,))
