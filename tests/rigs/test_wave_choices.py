"""What a wave pair takes for its `auto` keys, and that everything after sees numbers."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tautwave.certificate import certify
from tautwave.certificate.__main__ import certify_text
from tautwave.config import Rig, load_rig, parse_rig, resolved_yaml
from tautwave.config.load import choose_again
from tautwave.couplings.wave import choice
from tautwave.couplings.wave.choice import Asked, choose_pair, least_bound, two_digits
from tautwave.errors import ConfigError
from tautwave.rig import command_delays, standing_offset
from tautwave.session import check
from tautwave.session.certified import certificate_of, certified_rig
from tautwave.simulation import simulate
from tautwave.sweep.grid import Choice as Varied
from tautwave.sweep.grid import Recipe
from tautwave.sweep.points import Points
from tests.commands import keep_in_one_process, tautwave
from tests.examples import tried

LAW = "wave"
AXIS = """{bus: bench, id: %d, kind: rotary, inertia: {value: 1.6e-3, lower: 1.1e-3, source: maker},
      damping: {value: 2.0e-3, lower: 1.0e-3, source: maker}, effort_limit: 1.1,
      effort_rate_limit: 1000, velocity_limit: 15, position_noise: 9.0e-5, %s}"""
FIRST = f"""name: first
rate_hz: 2000
duration_s: 1.6
loop: {{missing_limit: 5, overrun_limit: 40}}
buses: {{bench: {{driver: loopback}}}}
master: {{axes: {{lever: {AXIS % (1, "encoder_quantum: 2.1e-5")}}}}}
slave: {{axes: {{lever: {AXIS % (2, "encoder_quantum: 2.1e-5")}}}}}
coupling: {{law: {LAW}, pairs: {{lever: {{}}}}}}
simulation:
  hand:
    lever:
      lever_arm: 0.075
      reference: {{type: minimum_jerk, waypoints: [[0.05, 0.0], [0.3, 0.1]]}}
  environment: {{lever: {{type: wall, position: 0.05, stiffness: 250.0}}}}
"""
"""A newcomer's rig: devices, limits and noise, and nothing about the coupling but its law."""

SIDES = ("master", "slave")
KEYS = ("wave_filter_hz", "wave_impedance", "pole_master", "pole_slave")
PAIR = "coupling.pairs.lever"
LIGHT = "slave.axes.lever.inertia={value: 2e-4, lower: 2e-4, source: maker}"
AXES = ("master.axes.lever", "slave.axes.lever")


def first(*settings: str, choose: bool = True) -> Rig:
    return parse_rig(FIRST, Path("first.yaml"), settings, choose=choose)


def both(key: str, value: object) -> list[str]:
    return [f"{axis}.{key}={value}" for axis in AXES]


def chosen(rig: Rig) -> list[Any]:
    return [rig.choices[f"pairs.lever.{key}"].value for key in KEYS]


def bound_of(rig: Rig) -> float:
    """What bounds the impedance, but for the certificate, with the quietest poles."""
    quiet = {"wave_filter_hz": 200.0, "pole_master": 0.5, "pole_slave": 0.5}
    pair: Any = rig.coupling.pairs["lever"].model_copy(update=quiet)
    asked = Asked(rig, "lever", command_delays(rig), {"master": 1.0, "slave": 1.0})
    return least_bound(asked, pair).impedance


@pytest.mark.slow
def test_a_first_rig_is_certified_firm_and_quiet() -> None:
    """Pressed against a wall its levers stay together, and chatter is what it was said to be."""
    rig = first()
    assert chosen(rig) == [50.0, 0.079, 0.5, 0.5]
    assert certify(rig).passed
    run = simulate(rig, engine="python")
    assert run.error is None
    still = slice(2000, 2700)  # the knock has died out; before the release
    for side in SIDES:
        effort = run[f"{side}.lever.commanded"][still]
        assert abs(float(np.mean(effort))) > 0.1
        slow = np.convolve(effort, np.full(41, 1.0 / 41), "valid")  # below 40 Hz
        rough = float(np.std(effort[20:-20] - slow))
        assert 0.6 < rough / (choice.NOISE_SHARE * 1.1) < 1.0
    assert float(np.max(np.abs(run["lever.position_error"][still]))) < 7e-3


@pytest.mark.sparse(2)
@pytest.mark.parametrize("spent", ["compensation={viscous: 0.8}", "load={cosine: -9.0}"])
def test_auto_counts_with_the_damping_that_friction_and_loads_leave(spent: str) -> None:
    """What it takes without them is refused with them, and what it takes with them passes."""
    shared = ["rate_hz=1000", "coupling.delay_s=0.01", *both("effort_limit", 20.0)]
    # So strong a motor would be refused for what it may do in a stall, or while its effort falls.
    shared += [*both("effort_rate_limit", 1e5), "loop.missing_limit=2", "loop.overrun_limit=2"]
    shared += ["coupling.pairs={lever: {wave_filter_hz: auto, wave_impedance: auto}}"]
    own = [f"{axis}.{spent}" for axis in AXES]
    path = Path(__file__).parents[2] / "configs" / "bench-1dof-2khz.yaml"
    bare, rig = load_rig(path, shared), load_rig(path, [*shared, *own])
    assert certify(rig).passed
    assert not certify(rig.model_copy(update={"coupling": bare.coupling})).passed


def test_a_choice_is_the_number_itself_to_the_bit() -> None:
    rig = first()
    number = [f"{PAIR}.{key}={value}" for key, value in zip(KEYS, chosen(rig), strict=True)]
    given_numbers = first(*number)
    assert given_numbers == rig
    assert not given_numbers.choices
    assert resolved_yaml(given_numbers) == resolved_yaml(rig)
    rows = [simulate(one, duration_s=0.05, engine="python").data for one in (rig, given_numbers)]
    np.testing.assert_array_equal(*rows)


def test_what_is_saved_holds_numbers_and_chooses_nothing() -> None:
    rig = first()
    again = parse_rig(resolved_yaml(rig))
    assert again == rig
    assert not again.choices


@pytest.mark.slow
def test_a_run_takes_the_choice_from_its_certificate() -> None:
    left = first(choose=False)
    found = certify_text(resolved_yaml(left))
    assert certified_rig(left, found) == first()
    with pytest.raises(ConfigError, match="wave_filter_hz is still auto"):
        standing_offset(left, "lever", command_delays(left))


@pytest.mark.slow
def test_a_run_leaves_the_numbers_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    keep_in_one_process(monkeypatch)
    path = tmp_path / "first.yaml"
    path.write_text(FIRST)
    words = ("run", path, "--clock", "fake", "--duration", "0.05", "--out", "out")
    done = tautwave(*words, cwd=tmp_path)
    assert done.exit_code == 0, done.output
    saved = parse_rig((tmp_path / "out" / "rig.yaml").read_text())
    assert saved.coupling == first().coupling


def test_check_says_what_it_took_and_what_bound_it() -> None:
    facts = dict(check(first()).facts)
    assert facts["wave_impedance auto"] == (
        "0.079 N m s/rad, bound by chatter of master.lever at 1% of its effort limit"
    )
    assert facts["wave_filter_hz auto"] == "50 Hz, ten times what a hand moves by will"
    assert facts["pole_slave auto"] == "0.5, the first that is certified"


@pytest.mark.parametrize(
    ("settings", "impedance", "cause"),
    [
        (
            [*both("position_noise", 0), *both("encoder_quantum", 1e-3)],
            0.035,
            "the rattle of master.lever within its encoder step",
        ),
        (both("position_noise", 1e-7), 0.1, "the impedance of both devices at 5 Hz"),
        (
            [*both("position_noise", 1e-7), LIGHT],
            0.055,
            "the reserve of slave.lever",
        ),
        (
            ["slave.axes.lever.effort_limit=0.1", "slave.axes.lever.position_noise=4e-5"],
            0.013,
            "chatter of slave.lever",
        ),
    ],
    ids=["step", "hand", "reserve", "far end"],
)
def test_each_bound_binds(
    monkeypatch: pytest.MonkeyPatch, settings: list[str], impedance: float, cause: str
) -> None:
    monkeypatch.setattr(Asked, "takes", lambda *_: True)
    found = first(*settings).choices["pairs.lever.wave_impedance"]
    assert found.value == pytest.approx(impedance, rel=0.1)
    assert f"bound by {cause}" in found.reason


@settings(max_examples=tried(25), deadline=None)
@given(st.floats(1.0, 8.0), st.sampled_from(["noise", "step", "mass", "limit", "delay"]))
def test_the_bound_follows_the_devices(factor: float, which: str) -> None:
    """More noise, coarser steps, a longer line: softer. Heavier, stronger devices: stiffer."""
    mass = f"{{value: {1.6e-3 * factor}, lower: {1.1e-3 * factor}, source: maker}}"
    words, sign = {
        "noise": (both("position_noise", 9e-5 * factor), -1),
        "step": (both("encoder_quantum", 1e-3 * factor), -1),
        "mass": (both("inertia", mass), 1),
        "limit": (both("effort_limit", 1.1 * factor), 1),
        "delay": (["coupling.delay_s=%g" % (0.01 * round(factor))], -1),
    }[which]
    plain = bound_of(first(choose=False))
    assert sign * bound_of(first(*words, choose=False)) >= sign * plain - 1e-9


@pytest.mark.parametrize(
    "binds",
    [
        ["slave.axes.lever.effort_limit=0.2", "master.axes.lever.position_noise=0"],
        [*both("position_noise", 1e-7), LIGHT],
    ],
    ids=["chatter", "reserve"],
)
def test_the_units_of_the_slave_are_counted(
    monkeypatch: pytest.MonkeyPatch, binds: list[str]
) -> None:
    """A pair that trades motion for force: the slave's port has half the line's impedance."""
    monkeypatch.setattr(choice, "HAND_HZ", 50.0)
    scaled = [f"{PAIR}.position_scale=2.0", f"{PAIR}.force_scale=1.0"]
    one, two = (bound_of(first(*binds, *more, choose=False)) for more in ([], scaled))
    assert two == pytest.approx(2.0 * one, rel=1e-3)


def certificate(half: float, third: float, plain: float) -> Callable[[Asked, Any, str], bool]:
    """Return one that takes a port up to an impedance, by its pole."""
    limits: dict[object, float] = {0.5: half, 0.3: third, "plain": plain}

    def takes(_: Asked, pair: Any, side: str) -> bool:
        return bool(pair.impedance <= limits.get(getattr(pair, f"pole_{side}"), 0.0))

    return takes


@pytest.mark.parametrize(
    ("limits", "impedance", "pole", "cause"),
    [
        ((1.0, 1.0, 1.0), 0.079, 0.5, "chatter of master.lever"),
        ((0.02, 0.0, 1.0), 0.02, 0.5, "certificate of master.lever"),
        ((0.0, 0.02, 1.0), 0.02, 0.3, "certificate of master.lever"),
        ((0.0, 1.0, 1.0), 0.039, 0.3, "chatter of master.lever"),
        ((0.001, 0.001, 0.02), 0.02, "plain", "certificate of master.lever"),
        ((0.0, 0.0, 0.0), 0.079, "plain", "none is certified"),
    ],
)
def test_poles_in_their_order(
    monkeypatch: pytest.MonkeyPatch,
    limits: tuple[float, float, float],
    impedance: float,
    pole: float | str,
    cause: str,
) -> None:
    """Observers first, the quietest first; a plain port where they would cost an eighth."""
    names = dict(zip(("half", "third", "plain"), limits, strict=True))
    monkeypatch.setattr(Asked, "takes", certificate(**names))
    found = choose_pair(first(choose=False), "lever")
    assert found["wave_impedance"].value == pytest.approx(impedance, rel=0.08)
    assert cause in found["wave_impedance"].reason
    assert found["pole_master"].value == found["pole_slave"].value == pole


@pytest.mark.parametrize(
    ("pole", "reason"),
    [
        (0.5, "0.5, the first that is certified"),
        (0.3, "0.3, the first that is certified, not 0.5"),
        ("plain", "plain, the first that is certified, not 0.5 to 0.0"),
        (None, "plain, because no pole is certified"),
    ],
)
def test_a_pole_beside_a_given_impedance(
    monkeypatch: pytest.MonkeyPatch, pole: float | str | None, reason: str
) -> None:
    taken = {name: 1.0 if value == pole else 0.0 for name, value in
             (("half", 0.5), ("third", 0.3), ("plain", "plain"))}  # fmt: skip
    monkeypatch.setattr(Asked, "takes", certificate(**taken))
    left = first(f"{PAIR}.wave_impedance=0.05", f"{PAIR}.pole_slave=0.4", choose=False)
    found = choose_pair(left, "lever")
    assert found["pole_master"] == (pole or "plain", reason)
    assert "pole_slave" not in found
    assert "wave_impedance" not in found


def taking_velocity(rig: Rig, *sides: str) -> Rig:
    update = {"inertia": None, "causality": "admittance"}
    for side in sides:
        block = getattr(rig, side)
        axes = {name: axis.model_copy(update=update) for name, axis in block.axes.items()}
        rig = rig.model_copy(update={side: block.model_copy(update={"axes": axes})})
    return rig


def test_an_axis_that_takes_velocity_leaves_the_choice_to_the_other(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(Asked, "takes", certificate(1.0, 1.0, 1.0))
    left = first(choose=False)
    found = choose_pair(taking_velocity(left, "slave"), "lever")
    assert found["pole_slave"] == ("plain", "plain, because the axis is velocity-controlled")
    assert found["wave_impedance"].value == pytest.approx(0.05)
    with pytest.raises(ConfigError, match="needs an effort-controlled axis; give a number"):
        choose_pair(taking_velocity(left, "master", "slave"), "lever")


@pytest.mark.slow
def test_stiffer_contacts_get_a_sharper_observer_and_never_a_stiffer_line() -> None:
    found = [
        chosen(first(f"simulation.environment.lever.stiffness={stiffness}"))
        for stiffness in (250, 2500)
    ]
    assert found[0][1] >= found[1][1]
    assert (found[0][3], found[1][3]) == (0.5, 0.3)


@pytest.mark.slow
def test_what_no_pole_bears_is_refused_with_what_would_pass() -> None:
    rig = first("simulation.environment.lever.stiffness=1e6", f"{PAIR}.wave_impedance=0.05")
    assert rig.choices["pairs.lever.pole_slave"].value == "plain"
    found = check(rig)
    assert found.exit_code == 3
    assert "no key of the pair is enough" in " ".join(found.failures)


@pytest.mark.slow
def test_a_lossless_line_has_no_choice_where_there_is_noise(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"needs a wave filter .* set wave_filter_hz to auto"):
        first(f"{PAIR}.wave_filter_hz=null")
    path = tmp_path / "rig.yaml"
    text = FIRST.replace("lever: {}", "lever: {wave_filter_hz: null}")
    path.write_text(text)
    line = 1 + text[: text.index("wave_filter_hz: null")].count("\n")
    with pytest.raises(ConfigError, match=rf"^{path}:{line}: {PAIR}\.wave_filter_hz: "):
        load_rig(path)
    left = load_rig(path, choose=False)  # as a run reads it, whose certificate chooses
    with pytest.raises(ConfigError, match=rf"^{path}: {PAIR}\.wave_filter_hz: "):
        certificate_of(left, {})


def test_without_noise_and_step_there_is_a_filter_where_no_port_is_certified_without(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    silent = [*both("position_noise", 0), *both("encoder_quantum", 0)]
    rig = first(*silent, f"{PAIR}.wave_impedance=0.02")
    found = rig.choices["pairs.lever.wave_filter_hz"]
    said = "50 Hz, ten times what a hand moves by will, without which no port is certified"
    assert found == (50.0, said)
    assert not certify(
        first(*silent, f"{PAIR}.wave_impedance=0.02", f"{PAIR}.wave_filter_hz=null")
    ).passed
    assert certify(rig).passed
    monkeypatch.setattr(Asked, "takes", lambda *_: True)
    found = choose_pair(first(*silent, choose=False), "lever")["wave_filter_hz"]
    assert found == (None, "none, because no noise or encoder step is given")


@pytest.mark.slow
def test_a_coarse_effort_step_raises_the_impedance_as_far_as_the_certificate_goes(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It was refused, with the impedance to give."""
    rig = first(*both("effort_quantum", 0.62), *both("effort_rate_limit", 1300))
    found = rig.choices["pairs.lever.wave_impedance"]
    assert found.value == 0.083  # half of it times 15 rad/s is 0.62 N m
    assert "as much as the effort step of slave.lever needs; else 0.079, bound" in found.reason
    assert certify(rig).passed
    monkeypatch.setattr(choice, "blocked_by", lambda *_: "the certificate of slave.lever")
    refused = first(*both("effort_quantum", 0.62), *both("effort_rate_limit", 1300))
    assert refused.choices["pairs.lever.wave_impedance"].value == 0.079
    assert "raise wave_impedance to 0.0827" in certify(refused).sentences()[0]


@pytest.mark.parametrize("value", [0.0123456, 0.05, 5.09e-3, 0.1, 99.9, 1234.0])
def test_two_digits_are_never_above(value: float) -> None:
    found = two_digits(value)
    assert 0.9 * value < found <= value * (1.0 + 1e-12)
    assert float(f"{found:.1e}") == found
    up = two_digits(value, up=True)
    assert value * (1.0 - 1e-12) <= up < 1.1 * value
    assert float(f"{up:.1e}") == up


@pytest.mark.parametrize("bad", ["0", "-1", "yes", "'0.02'", "[0.02]", "true"])
@pytest.mark.parametrize("key", ["wave_impedance", "wave_filter_hz", "pole_master"])
def test_what_is_neither_auto_nor_a_number_is_refused_in_one_sentence(key: str, bad: str) -> None:
    if (key, bad) == ("pole_master", "0"):
        return
    with pytest.raises(ConfigError, match=rf"{key}=.*: Input should be 'auto'") as found:
        first(f"{PAIR}.{key}={bad}")
    assert len(found.value.problems) == 1


def test_points_of_a_sweep_get_the_choice_of_their_own_rig(tmp_path: Path) -> None:
    """A point is the rig file with its settings: the same as `run --set`."""
    path = tmp_path / "first.yaml"
    path.write_text(FIRST.replace("lever: {}", "lever: {wave_impedance: 0.045}"))
    key = "simulation.environment.lever.stiffness"
    axis = [(Varied(key, value, ()),) for value in (200.0, 2500.0, 250.0)]
    points = Points(path, [Recipe("", (), (tuple(axis),))])
    poles = []
    for number in range(len(points)):
        assert points.rig(number) == points.read_rig(number)
        poles.append(points.rig(number).coupling.pairs["lever"].pole("slave"))
    assert poles == [0.5, 0.2, 0.5]
    assert points.family(0) is not None


def test_a_changed_rig_can_be_asked_again() -> None:
    rig = first()
    limit = rig.master.axes["lever"].model_copy(update={"effort_limit": 0.55})
    weaker = rig.model_copy(
        update={"master": rig.master.model_copy(update={"axes": {"lever": limit}})}
    )
    assert chosen(choose_again(weaker))[1] == pytest.approx(0.5 * chosen(rig)[1], rel=0.05)
    given_numbers = parse_rig(resolved_yaml(rig))
    assert choose_again(given_numbers) is given_numbers


def test_a_quieter_observer_is_worth_a_fifth_of_the_impedance(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """All of it is taken with a sharp observer alone; of 0.5, nothing within a fifth."""
    limits = {0.5: 0.06, 0.2: 0.07, 0.0: 1.0}

    def takes(_: Asked, pair: Any, side: str) -> bool:
        return bool(pair.impedance <= limits.get(getattr(pair, f"pole_{side}"), 0.0))

    monkeypatch.setattr(Asked, "takes", takes)
    found = choose_pair(first(*both("position_noise", 1e-6), choose=False), "lever")
    assert (found["wave_impedance"].value, found["pole_master"].value) == (0.1, 0.0)
    limits[0.2] = 0.085
    found = choose_pair(first(*both("position_noise", 1e-6), choose=False), "lever")
    assert found["pole_master"].value == found["pole_slave"].value == 0.2
    assert found["wave_impedance"].value == pytest.approx(0.085, rel=0.03)
