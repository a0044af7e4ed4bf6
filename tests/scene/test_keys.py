"""A scene in a rig file: what is wrong is said with its place, what is right comes back."""

from __future__ import annotations

from pathlib import Path

import jsonschema
import numpy as np
import pytest
import yaml

from tautwave.config import load_rig, parse_rig, resolved_yaml, rig_schema
from tautwave.errors import ConfigError
from tautwave_scenes.networks.compiling import compile_network
from tautwave_scenes.networks.network import Link, Mass, String
from tautwave_scenes.networks.sampled import linear_part
from tautwave_scenes.networks.schemes.exact import linear_matrices
from tautwave_scenes.rig.network import pruned_network, scene_forces, whole_network

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


@pytest.mark.slow
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


def test_a_link_of_required_keys_alone_has_nothing_beside_them():
    """No damping, no loss, slack and touching at 0; dry friction full at 1 mm/s, a bow's at 50."""
    given = {
        "spring": "stiffness: 100",
        "damper": "damping: 2",
        "contact": "stiffness: 1e4",
        "nonlinear": "stiffness: 1e6, exponent: 3",
        "plastic": "stiffness: 200, yield_force: 3",
        "friction": "force: 0.5",
        "bow": "force: 0.7",
        "negative_damper": "damping: 0.1",
        "energy_source": "power: 0.3",
    }
    links = [
        f"scene.links.{kind}={{type: {kind}, between: [object, ground], {keys}}}"
        for kind, keys in given.items()
    ]
    more = ["scene.scheme=discrete_gradient", "scene.masses.object={mass: 0.004}", *links]
    network = whole_network(load_rig(CONFIGS / "scene-resonator.yaml", more))
    assert network.masses == (Mass("object", 0.004, 0.0, 0.0, 0.0),)
    assert network.gravity == 0.0
    expected = {
        "spring": {"stiffness": 100.0, "damping": 0.0, "rest": 0.0},
        "damper": {"damping": 2.0},
        "contact": {"stiffness": 1e4, "exponent": 1.0, "loss": 0.0, "rest": 0.0},
        "nonlinear": {"stiffness": 1e6, "exponent": 3.0, "rest": 0.0},
        "plastic": {"stiffness": 200.0, "limit": 3.0, "damping": 0.0},
        "friction": {"limit": 0.5, "scale": 1e-3},
        "bow": {"limit": 0.7, "scale": 0.05},
        "negative_damper": {"damping": 0.1},
        "energy_source": {"limit": 0.3, "scale": 0.01},
    }
    found = {link.kind: link for link in network.links if link.name == link.kind}
    assert found == {
        kind: Link(kind, kind, "object", "ground", **numbers) for kind, numbers in expected.items()
    }


def test_ports_strings_and_forces_of_required_keys_alone():
    """A string is touched at a tenth and loses half a percent; noise has the audible band's middle.

    At 10 kHz a string of 200 Hz has halves of 25 samples.
    """

    def made(port: str = "", string: str = "", noise: str = "", taps: str = ""):
        rig = parse_rig(
            RESONATOR,
            "rig.yaml",
            [
                f"scene.ports.stylus={{to: object, stiffness: 10{port}}}",
                f"scene.strings={{g: {{impedance: 1, frequency_hz: 200{string}}}}}",
                "scene.links.bridge={type: spring, between: [object, g], stiffness: 1}",
                f"scene.forces={{hiss: {{type: noise, on: object, amplitude: 1{noise}}}, "
                f"rain: {{type: taps, on: object, amplitude: 1, per_second: 50{taps}}}}}",
                "scene.scheme=discrete_gradient",
            ],
        )
        network = whole_network(rig)
        return network, scene_forces(rig, network, 2000)

    network, forces = made()
    assert network.strings == (String("g", 1.0, 1, 22, 0.995, 1.0),)
    assert network.links[-1] == Link(
        "coupling of stylus", "spring", "stylus", "object", stiffness=10.0
    )
    assert made(
        ", damping: 0, position_scale: 1, offset: 0",
        ", position: 0.1, reflection: 0.995, brightness_hz: null",
        ", low_hz: 20, high_hz: 2000",
        ", length_s: 0.002",
    ) == (network, forces)
    assert made(", damping: 0.1")[0] != network
    for other in (", low_hz: 30", ", high_hz: 1900"):
        assert made(noise=other)[1] != forces
    assert made(taps=", length_s: 0.003")[1] != forces


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
