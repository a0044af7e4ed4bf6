"""Arms in rig files: URDF files read or refused by name, Denavit-Hartenberg rows, loads."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
import yaml

from tautwave.config import load_rig, parse_rig, resolved_yaml
from tautwave.config.inputs.chains import chain_constants
from tautwave.config.inputs.urdf import read_urdf
from tautwave.config.keys.arm import Chain
from tautwave.errors import ConfigError
from tautwave.models.chain.build import build_chain
from tautwave.models.chain.gravity import chain_gravity
from tautwave.models.chain.kinematics import chain_frames, tip_pose
from tautwave.rig import command_delays
from tautwave.rig.arms import greatest_loads
from tautwave.session.facts import load_facts, pair_facts

SHIPPED = Path(__file__).parents[2] / "configs" / "bench-1dof-loopback.yaml"
URDF = """<?xml version="1.0"?>
<robot name="two">
  <link name="base"/>
  <link name="upper">
    <inertial><origin xyz="0.15 0 0"/><mass value="0.5"/>
      <inertia ixx="1e-4" iyy="4e-3" izz="4e-3" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <link name="lower"><inertial><origin xyz="0.1 0 0"/><mass value="0.3"/></inertial></link>
  <link name="tool"><inertial><mass value="0.1"/></inertial></link>
  <link name="sticker"><inertial><mass value="0.2"/></inertial></link>
  <joint name="shoulder" type="revolute">
    <parent link="base"/><child link="upper"/><axis xyz="0 2 0"/>
    <limit lower="-1" upper="1.5" effort="10" velocity="3"/>
  </joint>
  <joint name="elbow" type="continuous">
    <origin xyz="0.3 0 0"/><parent link="upper"/><child link="lower"/><axis xyz="0 1 0"/>
  </joint>
  <joint name="flange" type="fixed">
    <origin xyz="0.2 0 0"/><parent link="lower"/><child link="tool"/>
  </joint>
  <joint name="glue" type="fixed">
    <origin xyz="0.3 0 0"/><parent link="upper"/><child link="sticker"/>
  </joint>
</robot>
"""


def written(folder: Path, text: str = URDF) -> Path:
    path = folder / "arm.urdf"
    path.write_text(text)
    return path


def test_a_chain_is_read_with_all_that_is_fixed_to_it(tmp_path: Path) -> None:
    found = read_urdf(written(tmp_path), "tool")
    assert [link.name for link in found.links] == ["shoulder", "elbow", "flange"]
    assert [(x.lower, x.upper, x.effort) for x in found.limits] == [
        (-1.0, 1.5, 10.0),
        (-math.inf, math.inf, math.inf),
    ]
    chain = build_chain(found.links, (0.0, 0.0, -9.81))
    frames = chain_frames(chain, (0.0, 0.0))
    weight = [0.0, 0.0]
    chain_gravity(chain, frames, weight)
    elbow = 0.3 * 0.1 + 0.1 * 0.2
    shoulder = 0.5 * 0.15 + 0.2 * 0.3 + 0.3 * 0.4 + 0.1 * 0.5
    assert weight == pytest.approx([-9.81 * shoulder, -9.81 * elbow], rel=1e-12)
    assert tip_pose(chain, frames)[:3] == pytest.approx((0.5, 0.0, 0.0), abs=1e-15)


WRONG = (
    ("robot", "robots", "has no <robot>; a URDF file is required (run xacro first)"),
    ("</robot>", "", "is not XML: no element found"),
    (
        '<robot name="two">',
        '<!DOCTYPE robot [<!ENTITY a "b">]><robot name="two">',
        ":2: declares a document type, which URDF does not have; remove it",
    ),
    ('<link name="base"/>', 32 * "<a>" + 32 * "</a>", ":3: nested deeper than 32 levels"),
    ('value="0.5"', 'value="-0.5"', ":5: link 'upper': its mass is negative (got -0.5)"),
    ('value="0.5"', 'value="nan"', ":5: value of <mass> should be a finite number (got 'nan')"),
    ('xyz="0.1 0 0"', 'xyz="0.1 0"', "xyz of <origin> should be 3 finite numbers (got '0.1 0')"),
    ('<mass value="0.3"/>', "", "link 'lower': <inertial> has no <mass>"),
    ('ixx="1e-4"', 'ixx="-1e-4"', ":6: link 'upper': not physically possible for a rigid body"),
    ('type="continuous"', 'type="floating"', "joint 'elbow' is floating; a chain has revolute,"),
    ('type="continuous"', "", "<joint> has no type"),
    (
        '<axis xyz="0 1 0"/>\n  </joint>',
        '<mimic joint="shoulder"/></joint>',
        ":15: joint 'elbow' mimics another, which a joint of the chain cannot; choose a tip",
    ),
    ('name="elbow"', 'name="shoulder"', "a second joint 'shoulder' (line 11)"),
    ('<link name="tool">', '<link name="lower">', ":9: a second link 'lower' (line 8)"),
    ('<child link="tool"/>', '<child link="hand"/>', "joint 'flange': there is no link 'hand'"),
    ('<child link="tool"/>', "", "joint 'flange' has no <child>"),
    (
        '<child link="sticker"/>',
        '<child link="tool"/>',
        "joint 'glue': link 'tool' is also the child of joint 'flange' (line 18): closed chains",
    ),
    (
        '<parent link="base"/><child link="upper"/>',
        '<parent link="lower"/><child link="upper"/>',
        "closes a loop; only serial chains are supported",
    ),
    (
        'type="fixed">\n    <origin xyz="0.3 0 0"/>',
        'type="revolute">\n    <origin xyz="0.3 0 0"/>',
        ":21: joint 'glue' branches off at link 'upper'; state the chain's end, such as `tip:",
    ),
    ('xyz="0 2 0"', 'xyz="0 2_0 0"', ":12: xyz of <axis> should be 3 finite numbers"),
    ('xyz="0 2 0"', 'xyz="0 0 0"', ":12: joint 'shoulder': its axis vector is zero or not finite"),
    (
        'xyz="0 2 0"',
        'xyz="0 1.7e308 1.7e308"',
        "joint 'shoulder': its axis vector is zero or not finite",
    ),
    ('lower="-1"', 'lower="2"', "joint 'shoulder': its lower limit 2 is above its upper 1.5"),
    (
        '<link name="base"/>',
        '<link name="base"/><link name="spare"/>',
        "link 'spare' is not connected to",
    ),
)


@pytest.mark.parametrize(("old", "new", "said"), WRONG, ids=[w[2][-40:] for w in WRONG])
def test_what_is_no_serial_chain_is_refused_by_name(
    tmp_path: Path, old: str, new: str, said: str
) -> None:
    assert old in URDF
    path = written(tmp_path, URDF.replace(old, new, -1 if old == "robot" else 1))
    with pytest.raises(ConfigError) as caught:
        read_urdf(path)
    (problem,) = caught.value.problems
    assert problem.startswith(f"{path}:")
    assert said in problem
    assert "\n" not in problem


def test_a_file_of_thousands_of_links_is_read_at_once(tmp_path: Path) -> None:
    """In a fraction of a second: searched with its square it took ten."""
    count = 30_000
    links = "".join(f'<link name="l{n}"/>' for n in range(count + 1))
    joints = "".join(
        f'<joint name="j{n}" type="{"revolute" if n == 0 else "fixed"}">'
        f'<parent link="l{n}"/><child link="l{n + 1}"/></joint>'
        for n in range(count)
    )
    found = read_urdf(written(tmp_path, f'<robot name="long">{links}{joints}</robot>'))
    assert [link.name for link in found.links] == ["j0"]


def test_a_chain_that_does_not_move_and_a_tip_that_is_missing(tmp_path: Path) -> None:
    still = URDF.replace('"revolute"', '"fixed"').replace('"continuous"', '"fixed"')
    with pytest.raises(ConfigError, match="no moving joint"):
        read_urdf(written(tmp_path, still))
    with pytest.raises(ConfigError, match=r"there is no link 'hand'\. Links: base, upper"):
        read_urdf(written(tmp_path), "hand")
    assert [link.name for link in read_urdf(written(tmp_path), "sticker").links] == [
        "shoulder", "glue",
    ]  # fmt: skip
    with pytest.raises(ConfigError, match=r"nowhere\.urdf: no such file"):
        read_urdf(tmp_path / "nowhere.urdf")


def test_rows_of_denavit_and_hartenberg_are_the_textbooks() -> None:
    keys = Chain.model_validate_json(
        '{"dh": [{"theta": 0.3, "d": 0.1, "a": 0.2, "alpha": 1.1},'
        ' {"kind": "prismatic", "theta": -0.4, "d": 0.05, "a": 0.3, "alpha": -0.7}]}'
    )
    chain = chain_constants(keys)
    q = (0.5, 0.2)

    def step(theta: float, d: float, a: float, alpha: float, place: list[list[float]]) -> None:
        ct, st, ca, sa = math.cos(theta), math.sin(theta), math.cos(alpha), math.sin(alpha)
        row = [
            [ct, -st * ca, st * sa, a * ct],
            [st, ct * ca, -ct * sa, a * st],
            [0.0, sa, ca, d],
            [0.0, 0.0, 0.0, 1.0],
        ]
        place[:] = [
            [sum(place[i][k] * row[k][j] for k in range(4)) for j in range(4)] for i in range(4)
        ]

    place = [[float(i == j) for j in range(4)] for i in range(4)]
    step(0.3 + q[0], 0.1, 0.2, 1.1, place)
    step(-0.4, 0.05 + q[1], 0.3, -0.7, place)
    pose = tip_pose(chain, chain_frames(chain, q))
    assert pose[:3] == pytest.approx([place[i][3] for i in range(3)], abs=1e-15)
    for axis in range(3):
        column = pose[3 + 3 * axis : 6 + 3 * axis]
        assert column == pytest.approx([place[i][axis] for i in range(3)], abs=1e-15)


ONE = "{dh: [{a: 0.1, mass: 0.2}], gravity: [0.0, -9.81, 0.0]}"
ARM = f"arm={ONE}"


def test_a_rig_with_an_arm_says_what_its_load_costs() -> None:
    rig = load_rig(SHIPPED, [f"slave.{ARM}", "master.axes.lever.load.constant=0.05"])
    loads = greatest_loads(rig, "slave")
    assert loads == {"slave.lever": pytest.approx(9.81 * 0.2 * 0.1, rel=1e-3)}
    delays = command_delays(rig)
    facts = dict(load_facts(rig, delays))
    offset = float(facts["load of slave.lever"].split("apart")[0].split()[-2])
    assert offset == pytest.approx(pair_facts(rig, "lever", delays).offset_per_effort, rel=5e-3)
    assert "up to 0.05 N m" in facts["load of master.lever"]
    assert parse_rig(resolved_yaml(rig), SHIPPED) == rig


def test_the_offset_of_a_scaled_slave_is_in_its_own_units() -> None:
    scaled = ["coupling.pairs.lever.position_scale=0.5", "coupling.pairs.lever.force_scale=4"]
    rig = load_rig(SHIPPED, [f"slave.{ARM}", *scaled])
    delays = command_delays(rig)
    facts = dict(load_facts(rig, delays))
    offset = float(facts["load of slave.lever"].split("apart")[0].split()[-2])
    pair = pair_facts(rig, "lever", delays).offset_per_effort
    assert offset == pytest.approx(pair * 0.5 / 4.0, rel=5e-3)


def test_a_urdf_file_starts_at_the_rig_files_folder(tmp_path: Path) -> None:
    one = URDF.replace('"continuous"', '"fixed"')
    written(tmp_path, one)
    text = SHIPPED.read_text()
    values = yaml.safe_load(text)
    values["slave"]["arm"] = {"urdf": "arm.urdf"}
    path = tmp_path / "rig.yaml"
    path.write_text(yaml.safe_dump(values))
    rig = load_rig(path)
    assert rig.slave.arm is not None
    assert rig.slave.arm.urdf == str((tmp_path / "arm.urdf").resolve())
    written(tmp_path, URDF)
    with pytest.raises(ConfigError, match=r"slave\.arm\.urdf: 2 joints \(shoulder, elbow\) for 1"):
        load_rig(path)
    (tmp_path / "arm.urdf").unlink()
    with pytest.raises(ConfigError, match=r"rig\.yaml:\d+: slave\.arm\.urdf: .*no such file"):
        load_rig(path)


REFUSED = (
    ("slave.arm={}", "give either urdf, or dh with one row for each axis"),
    ("slave.arm={dh: [{a: 0.1}], tip: tool}", "tip applies to a URDF only; remove it"),
    ("slave.arm={dh: [{mass: -1.0}]}", "slave.arm.dh.0.mass: Input should be greater than"),
    (
        "slave.arm={dh: [{inertia: [1.0, 1.0, 1.0, 2.0, 0.0, 0.0]}]}",
        "slave.arm.dh.0.inertia: not physically possible for a rigid body",
    ),
    (
        "slave.arm={dh: [{kind: prismatic, mass: 0.1}]}",
        "joint 'row 1' of the arm slides, so this should be",
    ),
    ("slave.arm={dh: []}", "give either urdf, or dh with one row for each axis"),
)


@pytest.mark.parametrize(("override", "said"), REFUSED)
def test_a_wrong_arm_is_refused_with_its_place(override: str, said: str) -> None:
    with pytest.raises(ConfigError) as caught:
        load_rig(SHIPPED, [override])
    assert len(caught.value.problems) == 1
    assert said in caught.value.problems[0]


def test_a_load_is_refused_where_a_chain_or_a_drive_carries_it() -> None:
    with pytest.raises(
        ConfigError, match=r"the chain of the slave's arm already " r"defines the weight"
    ):
        load_rig(SHIPPED, [f"slave.{ARM}", "slave.axes.lever.load.sine=0.1"])
    linear = SHIPPED.with_name("bench-2axis-loopback.yaml")
    rig = load_rig(linear)
    slides = next(name for name, axis in rig.slave.axes.items() if axis.kind == "linear")
    with pytest.raises(ConfigError, match="a linear one takes constant"):
        load_rig(linear, [f"slave.axes.{slides}.load.sine=0.1"])
    driven = SHIPPED.with_name("bench-admittance-loopback.yaml")
    slave = next(iter(load_rig(driven).slave.axes))
    with pytest.raises(ConfigError, match="compensates for the load itself"):
        load_rig(driven, [f"slave.axes.{slave}.load.constant=0.1"])
