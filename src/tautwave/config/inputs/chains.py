"""From the keys of a chain, and the URDF file that they may name, to its links and constants."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from tautwave.config.inputs.arm_places import arm_places
from tautwave.config.inputs.recordings import find_recording
from tautwave.config.keys.arm import Arm, Chain, DhRow
from tautwave.config.text.document import Document
from tautwave.models.chain.build import (
    Body,
    Link,
    Matrix,
    about_z,
    build_chain,
    roll_pitch_yaw,
)
from tautwave.models.chain.params import ChainParams

if TYPE_CHECKING:
    from tautwave.config.inputs.urdf import JointLimits


def chain_links(keys: Chain) -> tuple[tuple[Link, ...], tuple[JointLimits, ...]]:
    """Return the links of a chain and the limits of its moving joints.

    Raises
    ------
    ConfigError
        Its URDF file cannot be read, or holds no serial chain.
    """
    from tautwave.config.inputs.urdf import JointLimits, read_urdf

    if keys.urdf is not None:
        urdf = read_urdf(Path(keys.urdf), keys.tip, keys.base, keys.held)
        return urdf.links, urdf.limits
    links: list[Link] = []
    for number, row in enumerate(keys.dh or ()):
        links += _row_links(f"row {number + 1}", row)
    return tuple(links), tuple(JointLimits(link.name) for link in links if link.kind != "fixed")


def chain_notes(keys: Chain) -> tuple[str, ...]:
    """Return what was odd in a chain's URDF file beside the chain, and what was taken instead.

    Raises
    ------
    ConfigError
        As for `chain_links`.
    """
    if keys.urdf is None:
        return ()
    from tautwave.config.inputs.urdf import read_urdf

    return read_urdf(Path(keys.urdf), keys.tip, keys.base, keys.held).notes


def _row_links(name: str, row: DhRow) -> tuple[Link, Link]:
    """Return the joint, without a body, and the link behind it, which is fixed to it."""
    kind = "turns" if row.kind == "revolute" else "slides"
    xx, yy, zz, xy, xz, yz = row.inertia
    inertia: Matrix = ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))
    behind = roll_pitch_yaw(row.alpha, 0.0, 0.0)
    return (
        Link(name, kind, turn=about_z(row.theta)),
        Link("", "fixed", (row.a, 0.0, row.d), behind, body=Body(row.mass, row.centre, inertia)),
    )


def chain_constants(keys: Chain) -> ChainParams:
    """Return the constants of a chain with its payload.

    Raises
    ------
    ConfigError
        As for `chain_links`.
    """
    links, _ = chain_links(keys)
    return build_chain(links, keys.gravity, held_at_tip(keys))


def weighs(keys: Chain) -> bool:
    """Return whether a moving link of a chain, or anything that its tip may hold, has a mass."""
    payloads = keys.payloads.values() if isinstance(keys, Arm) else ()
    bodies = [one for one in (keys.payload, *payloads) if one is not None]
    links, _ = chain_links(keys)
    return any(one.mass > 0.0 for one in (*bodies, *(link.body for link in links)))


def held_at_tip(keys: Chain) -> Body:
    """Return the payload of a chain, a body without mass where there is none."""
    load = keys.payload
    return Body() if load is None else Body(load.mass, load.centre)


def name_chains(document: Document) -> None:
    """Replace the paths of URDF files by absolute ones; relative ones start at the rig file."""
    for block in (path for place in arm_places(document) for path in (place.path, place.truth)):
        path = (*block, "urdf")
        name = document.get(path)
        if isinstance(name, str):
            absolute = find_recording(document, path, name)
            document.get(block)["urdf"] = str(absolute or (document.folder / name).resolve())
