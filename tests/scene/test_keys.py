"""A scene in a rig file: what is wrong is said with its place, what is right comes back."""

from __future__ import annotations

from pathlib import Path

import jsonschema
import numpy as np
import pytest
import yaml

from tautwave.config import load_rig, parse_rig, resolved_yaml, rig_schema
from tautwave.errors import ConfigError
from tautwave.rig.scene.network import pruned_network, scene_forces, whole_network
from tautwave.scene.compiling import compile_network
from tautwave.scene.sampled import linear_part
from tautwave.scene.schemes.exact import linear_matrices

CONFIGS = Path(__file__).parents[2] / "configs"
RESONATOR = (CONFIGS / "scene-resonator.yaml").read_text()
SHIPPED = ("resonator", "granular", "string", "drum")


def problems(*overrides: str, text: str = RESONATOR) -> str:
    with pytest.raises(ConfigError) as caught:
        parse_rig(text, "rig.yaml", overrides)
    return "\n".join(caught.value.problems)


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_scenes_come_back_from_their_resolved_text(name):
    rig = load_rig(CONFIGS / f"scene-{name}.yaml")
    again = parse_rig(resolved_yaml(rig))
    assert again == rig
    assert "slave" not in yaml.safe_load(resolved_yaml(rig))
    assert whole_network(again) == whole_network(rig)


def test_unknown_nodes_are_named_with_their_place():
    reported = problems(text=RESONATOR.replace("[object, ground]", "[objekt, ground]"))
    assert "scene.links.spring.between.0" in reported
    assert "unknown node 'objekt'; did you mean 'object'? Nodes: object, stylus, ground" in reported
    reported = problems(text=RESONATOR.replace("to: object", "to: thing"))
    line = RESONATOR[: RESONATOR.index("to: object")].count("\n") + 1
    assert f"rig.yaml:{line}: scene.ports.stylus.to: unknown node 'thing'" in reported
    assert "no mass is named 'nobody'" in problems("scene.forces.strikes.on=nobody")
    assert "no mass is named 'ghost'" in problems("scene.record=[ghost]")


def test_zero_masses_are_refused_with_their_place():
    reported = problems(text=RESONATOR.replace("{mass: 0.004", "{mass: 0"))
    assert "scene.masses.object.mass: Input should be greater than 0 (got 0)" in reported


def test_disconnected_parts_are_named():
    reported = problems(text=RESONATOR.replace("  masses:", "  masses:\n    lonely: {mass: 1}"))
    assert "scene.masses.lonely: no link ends at it; add one, or remove it" in reported
    reported = problems("scene.ports.stylus={}")
    assert "no link ends at it" in reported


@pytest.mark.parametrize(
    ("override", "sentence"),
    [
        (["scene.links.spring.between=[object, object]"], "both ends are at 'object'"),
        (["scene.links.spring.between=[ground, ground]"], "neither end can move"),
        (
            ["scene.ports.stylus={to: object}"],
            "stiffness: required key is missing (coupling spring k_c)",
        ),
        (["scene.ports.stylus={stiffness: 1}"], "to: required key is missing"),
        (
            ["scene.ports.hand={to: object, stiffness: 1}"],
            "there is no master axis 'hand'",
        ),
        (
            ["scene.links.c={type: contact, between: [object, ground], stiffness: 1}"],
            "exact is for springs and dampers; links.c needs discrete_gradient",
        ),
        (
            [
                "scene.scheme=rk4",
                "scene.links.c={type: plastic, between: [object, ground], stiffness: 1, "
                "yield_force: 1}",
            ],
            "rk4 does not support plastic links; links.c needs discrete_gradient",
        ),
        (["scene.masses.object.count=3", "scene.masses.b={mass: 1, count: 2}",
          "scene.links.c={type: spring, between: [object, b], stiffness: 1}"],
         "groups of 3 and 2 cannot be linked one to one"),
        (["scene.output.port=nose"], "there is no port 'nose'"),
        (["buses.hand.divisor=2"], "a scene runs at a single rate"),
        (["slave={axes: {}}"], "not allowed in a rig with a scene"),
        (["simulation.environment.stylus={type: free}"], "a scene has no slave; remove it"),
        (["simulation.axes.slave.x={}"], "simulation.axes"),
        (["scene.strings.g={impedance: 1, frequency_hz: 5000}"], "a 12th of the rate"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_said(override, sentence):
    assert sentence in problems(*override)


def test_without_a_scene_slave_and_coupling_are_required():
    reported = problems(text="\n".join(RESONATOR.split("scene:\n")[0].splitlines()))
    assert "slave: required key is missing" in reported
    assert "coupling: required key is missing" in reported


def test_the_schema_takes_either_a_scene_or_a_slave():
    schema = rig_schema()
    right = yaml.safe_load(RESONATOR)
    jsonschema.validate(right, schema)
    for wrong in (
        {**right, "slave": {"axes": {}}},
        {k: v for k, v in right.items() if k != "scene"},
    ):
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate(wrong, schema)


def test_groups_are_spelled_out():
    rig = load_rig(CONFIGS / "scene-granular.yaml")
    network = whole_network(rig)
    assert [mass.name for mass in network.masses] == [f"grain{i}" for i in range(1, 11)]
    assert network.masses[3].position == pytest.approx(-0.0194)
    assert {(link.a, link.b) for link in network.links if link.exponent == 2.0} == {
        ("bar", f"grain{i}") for i in range(1, 11)
    }
    chain = "scene.links.row={type: spring, between: [grain, grain], chain: true, stiffness: 1}"
    network = whole_network(load_rig(CONFIGS / "scene-granular.yaml", [chain]))
    row = [(link.a, link.b) for link in network.links if link.name.startswith("row")]
    assert row == [(f"grain{i + 1}", f"grain{i}") for i in range(1, 10)]


def test_forces_follow_the_seed_and_no_other_force():
    rig = load_rig(CONFIGS / "scene-granular.yaml")
    network = pruned_network(rig).network
    forces = scene_forces(rig, network, 4000)
    assert len(forces) == 10
    assert forces[0] != forces[1]
    assert scene_forces(rig, network, 4000) == forces
    other = load_rig(CONFIGS / "scene-granular.yaml", ["seed=8"])
    assert scene_forces(other, network, 4000) != forces
    rms = (sum(x * x for x in forces[0]) / 4000) ** 0.5
    assert 0.04 < rms < 1.0


def test_the_drum_is_tuned():
    """Its rings ring where the membrane's J0 does, but for how coarse they are."""
    rig = load_rig(CONFIGS / "scene-drum.yaml")
    arrays = compile_network(linear_part(whole_network(rig))).arrays
    mass, _, stiffness = linear_matrices(arrays, range(6))
    w = np.sqrt(np.linalg.eigvals(np.linalg.solve(mass, stiffness)).real.min())
    assert w / (2.0 * np.pi) == pytest.approx(110.0, rel=0.02)


def test_the_string_is_tuned():
    (string,) = whole_network(load_rig(CONFIGS / "scene-string.yaml")).strings
    samples = 2 * (string.near + string.far) + 4
    assert 22_050 / samples == pytest.approx(196.0, rel=0.01)
