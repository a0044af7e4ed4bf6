"""Keys of a scene of three dimensions: what is wrong is said with its place, what is right runs."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import jsonschema
import pytest
import yaml

from tautwave.config import load_rig, parse_rig, resolved_yaml, rig_schema
from tautwave.config.text.yaml12 import parse_yaml
from tautwave.errors import ConfigError
from tautwave_scenes.rig.network3d import forces3d, pruned_network3d, whole_network3d

CONFIGS = Path(__file__).parents[2] / "configs"
NET = (CONFIGS / "scene-net.yaml").read_text()
RESONATOR = (CONFIGS / "scene-resonator.yaml").read_text()


def problems(*overrides: str, text: str = NET) -> str:
    with pytest.raises(ConfigError) as caught:
        parse_rig(text, "rig.yaml", overrides)
    return "\n".join(caught.value.problems)


def test_the_net_comes_back_from_its_resolved_text():
    rig = load_rig(CONFIGS / "scene-net.yaml")
    again = parse_rig(resolved_yaml(rig))
    assert again == rig
    assert whole_network3d(again) == whole_network3d(rig)
    assert yaml.safe_load(resolved_yaml(rig))["scene"]["dimension"] == 3


def test_a_scene_of_one_dimension_resolves_as_ever():
    assert "dimension" not in resolved_yaml(load_rig(CONFIGS / "scene-resonator.yaml"))
    assert parse_rig(RESONATOR, "rig.yaml", ["scene.dimension=1"]) == parse_rig(RESONATOR)


@pytest.mark.slow
def test_one_dimension_loads_nothing_of_three():
    code = (
        "import sys, json\n"
        "from tautwave.config import load_rig\nfrom tautwave.rig import build_rig\n"
        "build_rig(load_rig(sys.argv[1]), clock='fake', duration_s=0.01)\n"
        "print(json.dumps([m for m in sys.modules if 'space' in m and m.startswith('tautwave')]))"
    )
    words = [sys.executable, "-c", code, str(CONFIGS / "scene-resonator.yaml")]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    loaded = json.loads(done.stdout)
    assert [name for name in loaded if not name.startswith("tautwave.config.")] == []


@pytest.mark.parametrize(
    ("override", "sentence"),
    [
        ("scene.masses.knot.position=[0, 0]",
         "scene.masses.knot.position=[0, 0]: Input should have 3 items or more (got 2)"),
        ("scene.masses.knot.position=[0, 0, 0, 0]", "at most 3 items (got 4)"),
        ("scene.masses.knot.position=0.1", "Input should be a list (got 0.1)"),
        ("scene.masses.knot.mass=0", "Input should be greater than 0 (got 0)"),
        ("scene.dimension=2", "a scene has dimension 1 or 3"),
        ("scene.scheme=exact", "'symplectic', 'discrete_gradient' or 'linearly_implicit'"),
        ("scene.strings.g={impedance: 1, frequency_hz: 100}", "unknown key 'strings'"),
        ("scene.ports.finger.axes=[right, away, upp]",
         "there is no master axis 'upp'; did you mean 'up'?"),
        ("scene.ports.finger.axes=[right, away]",
         "master.axes.up: not used by the scene; add it to the axes of a port, or remove it"),
        ("scene.ports.finger.axes=[right, right, up]",
         "axis 'right' is already used by another port"),
        ("scene.ports.finger.directions=[[1, 0, 0]]", "one for each of its axes: 3 (got 1)"),
        ("scene.ports.finger.directions=[[1, 0, 0], [0, 0, 1], [1, 0, 1]]",
         "directions must be nonzero and linearly independent"),
        ("scene.ports.finger.directions=[[1, 0, 0], [0, 0, 0], [0, 0, 1]]", "must be nonzero"),
        ("scene.links.ball.gap=0", "the sum of both radii; or give a plane its normal"),
        ("scene.links.ball.normal=[0, 0, 0]", "a direction must not be zero"),
        ("scene.links.ball.between=[finger, know]",
         "unknown node 'know'; did you mean 'knot'? Nodes: knot, finger, ground"),
        ("scene.links.thread.between=[knot, ground]", "name the same group twice"),
        ("scene.masses.lonely={mass: 1}", "scene.masses.lonely={mass: 1}: no link ends at it"),
        ("scene.masses.knot12={mass: 1}", "another node is already named 'knot12'"),
        ("scene.grounds={finger: [0, 0, 0]}", "another node is already named 'finger'"),
        ("scene.output.port=finger", "no port has an axis 'finger'. Axes: right, away, up"),
        ("scene.record=[ghost]", "no mass is named 'ghost'"),
        ("scene.forces={hum: {type: sine, 'on': knot, amplitude: 1, frequency_hz: 50, "
         "direction: [0, 0, 0]}}", "a direction must not be zero"),
        ("scene.ports.finger={axes: [right, away, up], to: knot}", "(coupling spring k_c)"),
        ("buses.hand.divisor=2", "a scene runs at a single rate"),
        ("simulation.hand.finger={}", "unknown axis 'finger'"),
        ("simulation.environment.up={type: free}", "a scene has no slave"),
        ("slave={axes: {}}", "not allowed in a rig with a scene"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_said(override, sentence):
    assert sentence in problems(override)


@pytest.mark.parametrize(
    ("override", "place"),
    [
        ("scene.masses.object.position=[0, 0, 0]", "masses.object.position"),
        ("scene.grounds={wall: [0, 0, 1]}", "grounds.wall"),
        ("scene.gravity=[0, 0, -9.81]", "gravity"),
        ("scene.ports.stylus.axes=[stylus]", "ports.stylus.axes"),
        ("scene.masses.object.rows=2", "masses.object.rows"),
    ],
)
def test_keys_of_three_dimensions_in_one_are_reported(override, place):
    reported = problems(override, text=RESONATOR)
    assert f"{place} belongs to a scene of points: add dimension: 3, or remove it" in reported


def test_the_schema_knows_both():
    validator = jsonschema.Draft202012Validator(rig_schema())
    right = json.loads(json.dumps(parse_yaml(NET).value))
    assert validator.is_valid(right)
    assert validator.is_valid(json.loads(json.dumps(parse_yaml(RESONATOR).value)))
    right["scene"]["masses"]["knot"]["position"] = [0.0, 0.0]
    assert not validator.is_valid(right)


def test_a_net_is_spelled_out_row_by_row_and_clamped_at_its_rim():
    network = whole_network3d(load_rig(CONFIGS / "scene-net.yaml"))
    assert network.gravity == (0.0, 0.0, -9.81)
    assert [mass.name for mass in network.masses][:6] == [
        "knot9", "knot10", "knot11", "knot12", "knot13", "knot16"
    ]  # fmt: skip
    assert len(network.masses) == 25
    assert len(network.grounds) == 25  # ground, and 24 of the rim
    middle = {mass.name: mass.position for mass in network.masses}["knot25"]
    assert middle == pytest.approx((0.0, 0.0, 0.0), abs=1e-15)
    threads = [(link.a, link.b) for link in network.links if link.kind == "spring"]
    assert len(threads) == 60
    assert ("knot26", "knot25") in threads
    assert ("knot32", "knot25") in threads
    assert ("knot2", "knot1") not in threads
    assert ("knot15", "knot14") not in threads


def test_a_row_is_clamped_at_its_ends():
    text = NET.replace("count: 7\n      rows: 7", "count: 7")
    network = whole_network3d(parse_rig(text))
    assert [mass.name for mass in network.masses] == [f"knot{i}" for i in range(2, 7)]


def test_forces_have_directions_and_follow_the_seed():
    hums = [
        "scene.forces={hum: {type: noise, 'on': knot, amplitude: 1, direction: [0, 3, 4]}, "
        "other: {type: sine, 'on': knot, amplitude: 2, frequency_hz: 50}}"
    ]
    rig = load_rig(CONFIGS / "scene-net.yaml", hums)
    network = pruned_network3d(rig).network
    assert len(network.forced) == 50
    assert network.forced[0] == ("knot9", (0.0, 0.6, 0.8))
    assert network.forced[25] == ("knot9", (0.0, 0.0, 1.0))
    forces = forces3d(rig, network, 500)
    assert forces == forces3d(rig, network, 500)
    assert forces[0] != forces[1]
    assert max(forces[25]) == pytest.approx(2.0, rel=1e-6)


def test_weight_may_point_anywhere():
    rig = load_rig(CONFIGS / "scene-net.yaml", ["scene.gravity=[1.0, 0.0, 2.0]"])
    assert whole_network3d(rig).gravity == (1.0, 0.0, 2.0)


def test_a_node_of_a_group_may_be_named_by_itself():
    one = [
        "scene.ports.finger={axes: [right, away, up], to: knot25, stiffness: 100}",
        "scene.links.ball={type: spring, between: [knot11, knot4], stiffness: 10}",
        "scene.forces={hum: {type: sine, 'on': knot12, amplitude: 1, frequency_hz: 50}}",
        "scene.record=[knot13]",
    ]
    network = whole_network3d(load_rig(CONFIGS / "scene-net.yaml", one))
    ends = {link.name: (link.a, link.b) for link in network.links}
    assert ends["coupling of finger"] == ("finger", "knot25")
    assert ends["ball"] == ("knot11", "knot4")
    assert network.forced == (("knot12", (0.0, 0.0, 1.0)),)
    assert network.recorded == ("knot13",)
    more = ["scene.masses.k2={mass: 1, count: 12}"]
    more += ["scene.links.k={type: spring, between: [k2, k2], chain: true, stiffness: 1}"]
    scene = load_rig(CONFIGS / "scene-net.yaml", more).scene
    assert [scene.group_of(name) for name in ("k25", "k212", "k213", "k2", "k20")] == [
        "k2", "k2", "k213", "k2", "k20",
    ]  # fmt: skip
    for wrong in ("knot50", "knot0", "knot025", "knots"):
        reported = problems(f"scene.links.ball.between=[finger, {wrong}]")
        assert f"unknown node '{wrong}'" in reported
    assert "neither end can move" in problems("scene.links.ball.between=[ground, knot1]")
