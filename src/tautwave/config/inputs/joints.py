"""Which axis is which joint of an arm: by names, or by an order that the rig states."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

from tautwave.config.inputs.arm_places import ArmPlace, arm_places
from tautwave.config.inputs.chains import chain_links
from tautwave.config.keys.arm import Arm, Chain
from tautwave.config.messages import salvage
from tautwave.config.text.document import Document
from tautwave.config.text.yaml12 import KeyPath
from tautwave.errors import ConfigError

Axes = Mapping[str, Any]


def order_axes(document: Document) -> None:
    """Put the axes of each side with an arm in the order of its joints, base first.

    An axis is the joint that its `joint` names, or that of its own name; of several arms one comes
    after the other. A later one may count on the order; before, no order of a file has a meaning,
    as that of URDF has none.
    """
    for side, places in itertools.groupby(arm_places(document), lambda place: place.side):
        axes = document.get((side, "axes"))
        if isinstance(axes, dict) and axes:
            own = [(place, {name: axes[name] for name in place.axes}) for place in places]
            order = [name for place, some in own if some for name in _order(document, place, some)]
            left = [name for name in axes if name not in order]
            document.get((side,))["axes"] = {name: axes[name] for name in (*order, *left)}


def _order(document: Document, place: ArmPlace, axes: Axes) -> tuple[str, ...]:
    """Return the names of an arm's axes in the order of its joints, noting what is wrong."""
    side = place.side
    chains: tuple[tuple[KeyPath, type[Chain]], ...] = ((place.path, Arm), (place.truth, Chain))
    readable = [
        (path, keys) for path, model in chains if (keys := salvage(model, document.get(path)))
    ]
    if not readable and document.get(place.path) is None:
        for name in _stated(axes):
            document.report(
                (side, "axes", name, "joint"), f"the {side} has no arm; remove it, or add `arm`"
            )
    if not readable:
        return tuple(axes)
    (path, keys), *others = readable
    order = _of_chain(document, place, path, keys, axes) or tuple(axes)
    for path, keys in others:  # the simulated truth of the same arm
        joints = _joints(keys)
        wanted = [_wanted(axes, name, place, joints) for name in order]
        if sorted(wanted) == sorted(joints) and wanted != joints:
            document.report(
                (*path, "urdf"),
                f"its joints, {', '.join(joints)} from base to tip, are not in the order of those "
                f"of {'.'.join(map(str, place.path))}",
            )
    return order


def _of_chain(
    document: Document, place: ArmPlace, path: KeyPath, keys: Chain, axes: Axes
) -> tuple[str, ...] | None:
    """Return the axes in the order of a chain's joints, None where that is not known."""
    side, joints, stated = place.side, _joints(keys), _stated(axes)
    wanted = {name: _wanted(axes, name, place, joints) for name in axes}
    if keys.urdf is None:
        for name in stated:
            document.report(
                (side, "axes", name, "joint"),
                "names a joint of a URDF; rows of dh are in the order of the axes; remove it",
            )
        return None
    if len(joints) != len(axes):
        return None  # noted where a chain is checked, as one that cannot be read
    listed = f"its joints from base to tip are {', '.join(joints)}"
    strange = [name for name in axes if wanted[name] not in joints]
    if not stated and len(strange) == len(axes):
        if keys.order is None and len(axes) > 1:
            document.report(
                (*path, "urdf"),
                f"no axis has the name of a joint; give each its `joint`, or state `order: "
                f"base_to_tip` where the axes are listed so; {listed}",
            )
        return None
    for name in strange:
        at = (side, "axes", name)
        document.report(
            (*at, "joint") if name in stated else at,
            f"there is no joint {wanted[name]!r} in the arm; {listed}"
            if name in stated
            else f"the arm has no joint of this name; give its `joint`; {listed}",
        )
    known = [name for name in axes if name not in strange]
    order = sorted(known, key=lambda name: joints.index(wanted[name]))
    for one, two in itertools.pairwise(order):
        if wanted[one] == wanted[two]:
            document.report(
                (side, "axes", two, "joint"), f"axis {one!r} is joint {wanted[two]!r} too"
            )
    return None if strange else tuple(order)


def _joints(keys: Chain) -> list[str]:
    """Return the names of a chain's moving joints, none where its file cannot be read."""
    try:
        links, _ = chain_links(keys)
    except ConfigError:
        return []
    return [link.name for link in links if link.kind != "fixed"]


def _stated(axes: Axes) -> list[str]:
    return [
        name
        for name, axis in axes.items()
        if isinstance(axis, dict) and isinstance(axis.get("joint"), str)
    ]


def _wanted(axes: Axes, name: str, place: ArmPlace, joints: Sequence[str]) -> str:
    """Return the joint that an axis is to be: as stated, or of its name, which may have its arm's.

    So `left_j1` of arm `left` is joint `left_j1` or, where its chain has none, joint `j1`.
    """
    axis = axes[name]
    stated = axis.get("joint") if isinstance(axis, dict) else None
    if isinstance(stated, str):
        return stated
    short = name.removeprefix(place.prefix)
    return short if name not in joints and short in joints else name
