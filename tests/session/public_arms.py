"""Small URDF files with the traits of public arms; no vendor's file, no vendor's numbers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

INERTIAL = (
    '<inertial><origin xyz="{centre} 0 0"/><mass value="{mass}"/>'
    '<inertia ixx="{i}" iyy="{i}" izz="{i}" ixy="0" ixz="0" iyz="0"/></inertial>'
)
MESH = (
    '<visual><geometry><mesh filename="package://arm/{name}.stl" scale="0.001 0.001 0.001"/>'
    "</geometry></visual>"
)


def link(name: str, mass: float = 0.3, centre: float = 0.05) -> str:
    body = INERTIAL.format(mass=mass, centre=centre, i=mass * 1e-3) if mass else ""
    return f'<link name="{name}">{MESH.format(name=name)}{body}</link>'


def joint(
    name: str, kind: str, parent: str, child: str, axis: str = "0 0 1", more: str = ""
) -> str:
    limit = '<limit lower="-2" upper="2" effort="20" velocity="3"/>' if kind == "revolute" else ""
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0.12 0 0.02"/><axis xyz="{axis}"/>{limit}{more}</joint>'
    )


def serial(prefix: str, root: str, kinds: Sequence[str]) -> str:
    """Return links PREFIX1 ... and the joints to them, axes by turns upright and level."""
    text, parent = "", root
    for number, kind in enumerate(kinds, 1):
        name, axis = f"{prefix}{number}", "0 0 1" if number % 2 else "0 1 0"
        text += link(name) + joint(f"{prefix}_joint{number}", kind, parent, name, axis)
        parent = name
    return text


SPEED = '<limit effort="1" velocity="3"/>'
FINGERS = '<limit lower="0" upper="0.04" effort="10" velocity="0.2"/>'
MIMIC = FINGERS + '<mimic joint="{prefix}_finger1" multiplier="1" offset="0"/>'


def gripper(prefix: str, at: str) -> str:
    """Return a hand behind a fixed link with a mass, with a finger and one that mimics it."""
    flange, hand, mimic = f"{prefix}_flange", f"{prefix}_hand", MIMIC.format(prefix=prefix)
    return (
        link(flange, 0.05) + joint(f"{prefix}_to_flange", "fixed", at, flange)
        + link(hand, 0.4) + joint(f"{prefix}_to_hand", "fixed", flange, hand)
        + link(f"{prefix}_left", 0.02) + link(f"{prefix}_right", 0.02)
        + joint(f"{prefix}_finger1", "prismatic", hand, f"{prefix}_left", "0 1 0", FINGERS)
        + joint(f"{prefix}_finger2", "prismatic", hand, f"{prefix}_right", "0 -1 0", mimic)
        + link(f"{prefix}_tcp", 0.0) + joint(f"{prefix}_to_tcp", "fixed", hand, f"{prefix}_tcp")
    )  # fmt: skip


class PublicArm(NamedTuple):
    """What a file is like, its text, the tip, and the joints that the rig has from base to tip."""

    like: str
    text: str
    tip: str
    joints: int
    base: str | None = None


def robot(*parts: str, head: str = "") -> str:
    return f'<?xml version="1.0"?>\n<robot name="arm" {head}>\n' + "\n".join(parts) + "\n</robot>\n"


TURNS = ("revolute",)
XACRO = 'xmlns:xacro="http://ros.org/wiki/xacro"'
LEFTOVERS = (
    '<xacro:property name="unused" value="1"/>'
    '<transmission name="t"><type>SimpleTransmission</type></transmission>'
    '<gazebo reference="arm1"><material>Gazebo/Grey</material></gazebo>'
)
WORLD = '<link name="world"/>' + link("base", 1.5) + joint("world_joint", "fixed", "world", "base")
TORSO = link("torso", 5.0)
PUBLIC_ARMS = (
    PublicArm(
        "a 7-joint arm on a world link, hand with a finger that mimics the other",
        robot(WORLD, serial("arm", "base", TURNS * 7), gripper("arm", "arm7")),
        "arm_tcp",
        7,
    ),
    PublicArm(
        "6 joints, a continuous gripper motor and two fingers beside each other",
        robot(
            link("base", 1.0),
            serial("arm", "base", TURNS * 6),
            link("prop", 0.01)
            + joint("gripper", "continuous", "arm6", "prop", "1 0 0", SPEED),
            gripper("arm", "arm6"),
            LEFTOVERS,
            head=XACRO,
        ),
        "arm_hand",
        6,
    ),
    PublicArm(
        "wrists that are continuous, without limits",
        robot(
            link("base"),
            serial("arm", "base", (*TURNS * 2, "continuous", "continuous")),
        ),
        "arm4",
        4,
    ),
    PublicArm(
        "a gripper that is the last joint of the chain",
        robot(
            link("base"),
            serial("arm", "base", TURNS * 5),
            link("jaw", 0.02) + joint("jaw_joint", "revolute", "arm5", "jaw", "0 0 1"),
        ),
        "jaw",
        6,
    ),
    PublicArm(
        "an arm on a lift, whose base is stated",
        robot(
            link("foot", 3.0),
            link("carriage", 2.0)
            + joint(
                "lift", "prismatic", "foot", "carriage", "0 0 1",
                '<limit lower="0" upper="0.3" effort="300" velocity="0.1"/>',
            ),
            serial("arm", "carriage", TURNS * 6),
            gripper("arm", "arm6"),
        ),
        "arm_flange",
        6,
        "carriage",
    ),
    PublicArm(
        "the left of two arms on a torso",
        robot(
            TORSO,
            serial("left", "torso", TURNS * 6), gripper("left", "left6"),
            serial("right", "torso", TURNS * 6), gripper("right", "right6"),
        ),
        "left_tcp",
        6,
    ),
    PublicArm(
        "a slide in the chain",
        robot(
            link("base"),
            serial("arm", "base", TURNS * 2),
            link("quill", 0.2)
            + joint(
                "slide", "prismatic", "arm2", "quill", "0 0 1",
                '<limit lower="-0.1" upper="0.1" effort="80" velocity="0.3"/>',
            ),
        ),
        "quill",
        3,
    ),
)  # fmt: skip
