"""What is guaranteed of a scene: the published limits from the very steps that run."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tautwave.analysis.walls.passivity import needed_damping
from tautwave.analysis.walls.sampled import PulseTransfer
from tautwave.certificate import certify
from tautwave.certificate.picture import certificate_figure, draw_certificate
from tautwave.config import load_rig
from tautwave_scenes.certificate.maps import leak_over, needed, own_radius
from tautwave_scenes.networks.network import Link, Mass, Network
from tautwave_scenes.networks.sampled import LinearScene, linear_scene, loop_poles, seen_states
from tests.lab.papers.resonator_sampled import sampled_law
from tests.scene.networks import RESONATOR

CONFIGS = Path(__file__).parents[2] / "configs"
HAND = (0.143, 5.0, 538.0)


def coupled(stiffness: float) -> Network:
    spring, coupling = RESONATOR.links
    return RESONATOR._replace(links=(spring, coupling._replace(stiffness=stiffness)))


@pytest.mark.parametrize(
    ("scheme", "period", "delay", "limit"),
    [
        ("exact", 1e-3, 0, 6319.753),
        ("exact", 1e-3, 1, 5274.678),
        ("exact", 1e-4, 0, 9492.788),
        ("exact", 1e-4, 1, 6222.682),
        ("symplectic", 1e-3, 0, 1779.968),  # so it cannot run the seed's own 3000 N/m
        ("symplectic", 1e-4, 0, 15025.919),
    ],
)
def test_d9_greatest_couplings(scheme, period, delay, limit):
    for share in (1.0 - 1e-5, 1.0 + 1e-5):
        scene = linear_scene(coupled(limit * share), scheme, period, "hand")
        radius = np.abs(loop_poles(scene, *HAND, delay)).max()
        assert (radius < 1.0) == (share < 1.0)


def test_what_is_certified_of_rk4_is_the_exponential_up_to_its_fourth_term():
    period = 1e-3
    scene = linear_scene(RESONATOR, "rk4", period, "hand")
    rate = np.array([[0.0, 1.0], [-(14200.0 + 3000.0) / 0.004, -0.01 / 0.004]]) * period
    want, term = np.eye(2), np.eye(2)
    for at in range(1, 5):
        term = term @ rate / at
        want = want + term
    assert scene.a[:2, :2] == pytest.approx(want, rel=1e-12)
    assert scene.d == pytest.approx(3000.0 - 3000.0 * scene.b[0])


@pytest.mark.parametrize("period", [1e-3, 1e-4])
def test_needed_damping_is_that_of_the_analysis(period):
    num, den = sampled_law(period, "zoh")
    want = needed_damping(PulseTransfer(tuple(num), tuple(den)), period)
    found = needed(linear_scene(RESONATOR, "exact", period, "hand"), 0.0)
    assert found.proved
    assert found.damping == pytest.approx(want.damping, rel=1e-6)
    assert found.frequency == pytest.approx(want.frequency, rel=1e-6)


def test_a_scaled_port_is_a_scaled_impedance():
    one = linear_scene(RESONATOR, "exact", 1e-3, "hand")
    two = linear_scene(RESONATOR, "exact", 1e-3, "hand", 3.0)
    assert needed(two, 0.0).damping == pytest.approx(9.0 * needed(one, 0.0).damping)
    assert np.abs(loop_poles(two, *HAND, 1)).max() == pytest.approx(
        np.abs(loop_poles(linear_scene(coupled(27_000.0)._replace(
            masses=(RESONATOR.masses[0]._replace(mass=0.036, damping=0.09),),
            links=(RESONATOR.links[0]._replace(stiffness=127_800.0),
                   RESONATOR.links[1]._replace(stiffness=27_000.0)),
        ), "exact", 1e-3, "hand"), *HAND, 1)).max(), abs=1e-9)  # fmt: skip


def test_the_grid_agrees_with_the_proof(monkeypatch):
    scene = linear_scene(RESONATOR, "discrete_gradient", 1e-3, "hand")
    exact = needed(scene, 0.0)
    monkeypatch.setattr("tautwave_scenes.certificate.maps.EXACT_ORDER", 0)
    found = needed(scene, 0.0)
    assert not found.proved
    assert found.damping == pytest.approx(exact.damping, rel=5e-3)


def test_what_rings_for_ever_needs_more_than_any_device_has_and_says_at_which_frequency(
    monkeypatch,
):
    monkeypatch.setattr("tautwave_scenes.certificate.maps.EXACT_ORDER", 0)
    free = RESONATOR._replace(masses=(Mass("object", 0.004),))
    found = needed(linear_scene(free, "exact", 1e-4, "hand"), 0.0)
    hertz = math.sqrt((14_200.0 + 3_000.0) / 0.004) / (2.0 * math.pi)
    assert found == (math.inf, pytest.approx(hertz), False)


def test_a_damper_at_the_port_is_probed_with_its_rate():
    network = Network(
        (Mass("m", 0.1),),
        (
            Link("a", "spring", "hand", "ground", stiffness=1000.0, damping=0.2),
            Link("b", "spring", "m", "ground", stiffness=50.0, damping=1.0),
            Link("c", "damper", "hand", "m", damping=1e-9),
        ),
        ("hand",),
    )
    # D1: K = 1000, B = 0.2 at T = 1 ms need 0.7.
    found = needed(linear_scene(network, "symplectic", 1e-3, "hand"), 0.0)
    assert found.damping == pytest.approx(0.7, abs=1e-5)


def test_the_resonator_is_stable_but_not_passive_and_says_so():
    reported = certify(load_rig(CONFIGS / "scene-resonator.yaml"))
    assert reported.passed
    assert reported.verdicts["coupled_stable"].state == "passed"
    assert not reported.verdicts["passive"].passed
    assert "needs 2.392 N s/m of the device" in reported.verdicts["passive"].reason
    assert "positive real in exact arithmetic" in reported.elements[0].passive.reason
    damped = ["master.axes.stylus.damping={value: 3, lower: 2.4, source: data sheet}"]
    damped += ["simulation.axes.master.stylus.damping=3"]
    assert certify(load_rig(CONFIGS / "scene-resonator.yaml", damped)).verdicts["passive"].passed
    hard = ["scene.ports.stylus.stiffness=20000"]
    reported = certify(load_rig(CONFIGS / "scene-resonator.yaml", hard))
    assert not reported.passed
    assert "unstable with" in reported.sentences()[0]


@pytest.mark.parametrize("hertz", [7.0, 450.0])
def test_a_mode_is_told_in_hertz(monkeypatch, hertz):
    """In a period T a mode of f Hz turns by 2 pi f T, whatever else there is."""
    rig = load_rig(CONFIGS / "scene-resonator.yaml")
    turned = 0.9 * np.exp(2j * math.pi * hertz * rig.period_s)
    poles = np.array([0.1, turned, turned.conjugate()])
    monkeypatch.setattr("tautwave_scenes.certificate.verdict.loop_poles", lambda *_: poles)
    (loop,) = certify(rig).loops
    assert [case.frequency for case in loop.cases] == pytest.approx([hertz] * len(loop.cases))
    assert f"is at {hertz:.4g} Hz" in loop.verdict.reason


def test_nonlinear_links_are_named_as_conditions():
    for name in ("granular", "string", "drum"):
        reported = certify(load_rig(CONFIGS / f"scene-{name}.yaml"))
        verdict = reported.verdicts["coupled_stable"]
        assert verdict.state == "conditional"
        assert "no theorem bounds it; a run measures it" in verdict.conditions[0]


@pytest.mark.parametrize(
    "link",
    [
        "{type: negative_damper, between: [object, ground], damping: 0.001}",
        "{type: energy_source, between: [object, ground], power: 0.001}",
    ],
)
def test_what_feeds_energy_is_not_certified(link):
    overrides = [f"scene.links.feeding={link}", "scene.scheme=discrete_gradient"]
    reported = certify(load_rig(CONFIGS / "scene-resonator.yaml", overrides))
    for verdict in reported.verdicts.values():
        assert not verdict.passed
        assert "feeding" in verdict.reason


def test_a_scheme_that_cannot_run_the_scene_is_refused():
    """w T = 2.07 for the seed's resonator at 1 kHz: the standard scheme grows by itself."""
    scene = linear_scene(RESONATOR, "symplectic", 1e-3, "hand")
    assert own_radius(scene) > 1.1
    overrides = ["scene.scheme=symplectic", "rate_hz=1000"]
    reported = certify(load_rig(CONFIGS / "scene-resonator.yaml", overrides))
    assert not reported.passed
    assert "symplectic cannot run the scene at 1000 Hz" in reported.sentences()[0]


@pytest.mark.sparse(2)
@pytest.mark.parametrize("name", ["resonator", "granular"])
def test_the_certificate_is_drawn(name, tmp_path):
    draw_certificate(load_rig(CONFIGS / f"scene-{name}.yaml"), tmp_path / "certificate.png")
    with Image.open(tmp_path / "certificate.png") as image:
        assert image.width > 800
        assert len(image.convert("RGB").getcolors(1 << 16) or ()) > 20


def test_the_drawn_curve_is_the_proved_one():
    scene = linear_scene(RESONATOR, "exact", 1e-4, "hand")
    whole = needed(scene, 1.0)
    everywhere = np.linspace(1e-3, np.pi, 2000)
    assert leak_over(scene, everywhere, 1.0).max() <= whole.damping * (1.0 + 1e-9)
    near = 2.0 * np.pi * whole.frequency * 1e-4 * (1.0 + 1e-5 * np.linspace(-1.0, 1.0, 401))
    assert leak_over(scene, near, 1.0).max() == pytest.approx(whole.damping, rel=1e-4)


def test_the_drawn_curve_begins_where_nothing_moves_yet():
    rig = load_rig(CONFIGS / "scene-resonator.yaml")
    curves = [line.get_xdata() for line in certificate_figure(rig).axes[0].lines]
    lowest = min(x[0] for x in curves if len(x) > 2)
    assert lowest == pytest.approx(1e-4 * rig.rate_hz / (2.0 * np.pi))


@pytest.mark.parametrize(
    ("last", "felt", "kept"),
    [(0.0, 0.0, 2), (0.5, 0.0, 3), (0.0, 0.5, 3)],
    ids=["no damper at the port", "it moves a mass", "it is felt"],
)
def test_the_ports_last_position_is_a_state_where_a_damper_is_at_it(
    last: float, felt: float, kept: int
) -> None:
    a = np.array([[1.0, 1e-3, 0.0], [-0.2, 0.9, last], [0.0, 0.0, 0.0]])
    scene = LinearScene(a, np.array([0.0, 0.2, 1.0]), np.array([-30.0, 0.0, felt]), 30.0, 1e-3)
    found = seen_states(scene)
    assert [part.shape for part in found] == [(kept, kept), (kept,), (kept,)]
    assert np.array_equal(found[0], a[:kept, :kept])


def test_a_mass_that_moves_nothing_of_the_port_is_no_state() -> None:
    a = np.array([[0.5, 0.1, 0.0, 0.0], [0.2, 0.9, 0.0, 0.0], [0.3, 0.0, 0.8, 0.0], [0.0] * 4])
    c = np.array([-30.0, 0.0, 0.0, 0.0])
    found = seen_states(LinearScene(a, np.array([0.0, 0.2, 0.1, 1.0]), c, 30.0, 1e-3))
    assert np.array_equal(found[0], a[:2, :2])
    assert found[1].tolist() == [0.0, 0.2]
    assert found[2].tolist() == [-30.0, 0.0]
