"""Sub-chains of URDF files: what lies beside the path is held, and weighs on what carries it."""

from __future__ import annotations

import random
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tautwave.config.inputs.urdf import read_urdf
from tautwave.errors import ConfigError
from tautwave.models.chain.build import build_chain
from tautwave.models.chain.inertia import BASE, chain_screws, mass_matrix
from tautwave.models.chain.kinematics import chain_frames

GREATEST = 1e-12  # of the largest entry


def tree(rng: random.Random, count: int) -> tuple[str, dict[str, str]]:
    """Return a URDF with a tree of joints, and the parent of each link."""

    def numbers(size: float, many: int = 3) -> str:
        return " ".join(f"{rng.uniform(-size, size):.6f}" for _ in range(many))

    parents: dict[str, str] = {}
    parts = []
    for k in range(count + 1):
        a, b, c = (rng.uniform(0.01, 0.02) for _ in range(3))
        parts.append(
            f'<link name="l{k}"><inertial><origin xyz="{numbers(0.2)}" rpy="{numbers(2.0)}"/>'
            f'<mass value="{rng.uniform(0.1, 2.0):.6f}"/><inertia ixx="{a:.6f}" iyy="{b:.6f}" '
            f'izz="{c:.6f}" ixy="0.001" ixz="0" iyz="-0.001"/></inertial></link>'
        )
        if k:
            parent = f"l{rng.randrange(k)}"
            parents[f"l{k}"] = parent
            kind = rng.choice(["revolute", "revolute", "prismatic", "fixed"])
            parts.append(
                f'<joint name="j{k}" type="{kind}"><parent link="{parent}"/>'
                f'<child link="l{k}"/><origin xyz="{numbers(0.4)}" rpy="{numbers(3.0)}"/>'
                f'<axis xyz="{numbers(1.0)}"/>'
                '<limit lower="-3" upper="3" effort="9" velocity="9"/></joint>'
            )
    return f'<robot name="t">{"".join(parts)}</robot>', parents


def near(found: Any, wanted: Any) -> None:
    wanted = np.asarray(wanted)
    scale = max(float(np.abs(wanted).max()), 1e-9)
    assert float(np.abs(np.asarray(found) - wanted).max()) <= GREATEST * scale


@pytest.mark.parametrize("seed", range(25))
def test_a_sub_chain_is_the_reduced_model_of_pinocchio(seed: int, tmp_path: Path) -> None:
    pin: Any = pytest.importorskip("pinocchio")
    rng = random.Random(seed)
    text, parents = tree(rng, rng.randint(3, 9))
    path = tmp_path / "tree.urdf"
    path.write_text(text)
    tip = rng.choice(list(parents))
    up = [tip]
    while up[-1] in parents:
        up.append(parents[up[-1]])
    base = rng.choice(up[1:])
    kinds = dict(re.findall(r'joint name="(\w+)" type="(\w+)"', text))
    inside = [f"j{link[1:]}" for link in up[: up.index(base)]]
    moving = [name for name in inside[::-1] if kinds[name] != "fixed"]
    beside = [name for name, kind in kinds.items() if kind != "fixed" and name not in inside]
    held = {name: rng.uniform(-1.0, 1.0) for name in beside if rng.random() < 0.5}
    if not moving:
        with pytest.raises(ConfigError, match="no moving joint"):
            read_urdf(path, tip, base)
        return
    found = read_urdf(path, tip, base, held)
    assert [one.name for one in found.limits] == moving

    model = pin.buildModelFromXML(text)
    posture = pin.neutral(model)
    for name, at in held.items():
        posture[model.joints[model.getJointId(name)].idx_q] = at
    lock = [model.getJointId(name) for name in beside]
    reduced = pin.buildReducedModel(model, lock, posture)
    data = reduced.createData()
    q = np.array([rng.uniform(-1.5, 1.5) for _ in moving])
    assert list(reduced.names)[1:] == moving
    pin.framesForwardKinematics(reduced, data, q)
    stands = data.oMf[reduced.getFrameId(base)].rotation
    gravity = np.array([rng.uniform(-9.0, 9.0) for _ in range(3)])
    reduced.gravity.linear = gravity
    chain = build_chain(found.links, tuple(float(x) for x in stands.T @ gravity))
    frames = chain_frames(chain, q.tolist())
    weight, matrix = [0.0] * len(moving), [0.0] * len(moving) ** 2
    mass_matrix(chain, q.tolist(), frames, chain_screws(frames), BASE, matrix, weight)
    near(weight, pin.computeGeneralizedGravity(reduced, data, q))
    upper = np.triu(pin.crba(reduced, data, q))
    near(matrix, (upper + np.triu(upper, 1).T).ravel())


LINK = (
    '<link name="{}"><inertial><origin xyz="0.1 0 0"/><mass value="0.5"/>'
    '<inertia ixx="1e-3" iyy="2e-3" izz="2e-3" ixy="0" ixz="0" iyz="0"/></inertial></link>'
)
JOINT = (
    '<joint name="{}" type="{}"><parent link="{}"/><child link="{}"/><origin xyz="0.2 0 0"/>'
    '<axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="7" velocity="3"/>{}</joint>'
)


def arms(folder: Path, sides: tuple[str, ...], gripper: str = "<mimic joint='open'/>") -> Path:
    """Write one or two arms of two joints, each with a gripper, on one base."""
    parts = [LINK.format("base")]
    for side in sides:
        names = [f"{side}{name}" for name in ("upper", "wrist", "thumb", "finger")]
        parts += [LINK.format(name) for name in names]
        parts += [
            JOINT.format(f"{side}lift", "revolute", "base", names[0], ""),
            JOINT.format(f"{side}bend", "revolute", names[0], names[1], ""),
            JOINT.format(f"{side}open", "prismatic", names[1], names[2], ""),
            JOINT.format(f"{side}close", "prismatic", names[1], names[3], gripper),
        ]
    path = folder / "arms.urdf"
    path.write_text(f'<robot name="a">{"".join(parts)}</robot>')
    return path


def proposed(path: Path) -> list[str]:
    """Return the tips that a file without a tip proposes."""
    with pytest.raises(ConfigError) as caught:
        read_urdf(path)
    return re.findall(r"\w+", str(caught.value).partition("`tip:")[2].partition(";")[0])


def test_a_gripper_is_held_and_its_mimic_joint_ignored(tmp_path: Path) -> None:
    for gripper in ("<mimic joint='open'/>", ""):
        path = arms(tmp_path, ("",), gripper)
        (tip,) = proposed(path)
        assert tip == "wrist"
        found = read_urdf(path, tip)  # what is proposed works
        assert [one.name for one in found.limits] == ["lift", "bend"]
        assert found.links[-1].body.mass == 1.5
    path = arms(tmp_path, ("",))
    with pytest.raises(ConfigError, match="joint 'close' mimics another"):
        read_urdf(path, "finger")
    assert len(read_urdf(path, "thumb").limits) == 3


def test_a_file_with_two_arms_has_two_chains(tmp_path: Path) -> None:
    path = arms(tmp_path, ("left_", "right_"))
    tips = [tip for tip in proposed(path) if tip != "or"]
    assert [tip.rstrip("`") for tip in tips] == ["left_wrist", "right_wrist"]
    for side in ("left_", "right_"):
        found = read_urdf(path, f"{side}wrist")
        assert [one.name for one in found.limits] == [f"{side}lift", f"{side}bend"]
    with pytest.raises(ConfigError, match="'left_upper' does not carry the tip, 'right_wrist'"):
        read_urdf(path, "right_wrist", "left_upper")
    with pytest.raises(ConfigError, match="there is no link 'stand'"):
        read_urdf(path, "right_wrist", "stand")


@pytest.mark.parametrize(
    ("held", "said"),
    [
        ("bend", "is part of the chain"),
        ("wing", "is no joint of the file that moves"),
        ("close", "mimics another"),
    ],
)
def test_what_is_held_is_beside_the_chain(tmp_path: Path, held: str, said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        read_urdf(arms(tmp_path, ("",)), "wrist", held={held: 0.1})


BAD = {
    "inertia": (
        '<mass value="0.2"/><inertia ixx="1" iyy="-1" izz="1" ixy="0" ixz="0" iyz="0"/>',
        1,
    ),
    "not a number": ('<mass value="0.2"/><inertia ixx="nan" iyy="1" izz="1"/>', 1),
    "negative mass": ('<mass value="-0.2"/>', 0),
    "no mass": ("", 0),
}


@pytest.mark.parametrize("kind", BAD)
def test_one_bad_body_refuses_the_file_on_the_chain_only(tmp_path: Path, kind: str) -> None:
    """Beside it the mass stays, or the body is left out; that is said with file, line and link."""
    body, kept = BAD[kind]
    path = arms(tmp_path, ("",))
    whole = read_urdf(path, "wrist")
    text = path.read_text()
    bad = f'<inertial><origin xyz="0.1 0 0"/>{body}</inertial>'
    finger = re.search(r'<link name="finger">.*?</link>|<link name="finger"/>', text)
    assert finger is not None
    path.write_text(text.replace(finger[0], f'<link name="finger">{bad}</link>'))
    found = read_urdf(path, "wrist")
    (note,) = found.notes
    assert "link 'finger'" in note or kind == "not a number"
    assert f"taken as {'a point at its centre of mass' if kept else 'massless'}" in note
    lighter = whole.links[-1].body.mass - found.links[-1].body.mass
    own = 0.5  # of the finger
    assert lighter == pytest.approx(own - 0.2 * kept)
    # the same body on the chain, or as its tip, is refused
    wrist = re.search(r'<link name="wrist">.*?</link>', text)
    assert wrist is not None
    path.write_text(text.replace(wrist[0], f'<link name="wrist">{bad}</link>'))
    with pytest.raises(ConfigError, match="urdf:"):
        read_urdf(path, "wrist")
