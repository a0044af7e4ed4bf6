"""The operator's two figures of a pair: felt stiffness of a wall, drag of free motion."""

from __future__ import annotations

from pathlib import Path

import pytest

from tautwave.certificate.haptics.feel import Feel, rig_feel
from tautwave.config import load_rig, simulation_of
from tautwave.rig import command_delays, one_way_delay
from tautwave.session.facts import pair_facts

CONFIGS = Path(__file__).parents[2] / "configs"
POSITION = (
    "coupling={{law: position, delay_s: {0}, pairs: {{lever: {{stiffness: 20, damping: .07}}}}}}"
)


def feel(name: str, *overrides: str) -> dict[str, Feel]:
    found, silent = rig_feel(load_rig(CONFIGS / f"{name}.yaml", overrides))
    assert silent == ()
    return {one.pair: one for one in found}


def friction(name: str, pair: str, speed: float, ratio: float = 1.0) -> float:
    """Friction of both devices as the master has it [N m or N]; `ratio` of their motion."""
    rig = load_rig(CONFIGS / f"{name}.yaml")
    one, two = (simulation_of(rig, f"{side}.{pair}") for side in ("master", "slave"))
    return one.coulomb + one.damping * speed + ratio * (two.coulomb + two.damping * ratio * speed)


def test_a_spring_is_felt_in_series_with_the_wall() -> None:
    one = feel("bench-position-coupling", "coupling.delay_s=0")["lever"]
    assert one.stiffness == pytest.approx(1.0 / (1.0 / 1.5 + 1.0 / 250.0), rel=0.03)
    assert one.wall == 250.0
    assert one.law == "position"
    assert not one.ended
    # Both devices' friction, and a spring that follows some periods late.
    least = friction("bench-position-coupling", "lever", one.speed)
    assert one.drag is not None
    assert least < one.drag < least + 1.5 * 2.5e-3 * one.speed
    assert "250 N m/rad feels like" in one.sentences()[0]


@pytest.mark.slow
@pytest.mark.parametrize("delay", [0.0, 0.005, 0.02, 0.1])
def test_a_line_is_felt_as_its_standing_offset_and_drags_with_the_friction_of_both_devices(
    delay: float,
) -> None:
    name, change = "bench-1dof-2khz", f"coupling.delay_s={delay}"
    one = feel(name, change)["lever"]
    rig = load_rig(CONFIGS / f"{name}.yaml", [change])
    delays = command_delays(rig)
    offset = pair_facts(rig, "lever", delays).offset_per_effort
    assert one_way_delay(rig, "lever", delays) >= delay == pytest.approx(one.delay_s)
    assert one.stiffness == pytest.approx(1.0 / (offset + 1.0 / 250.0), rel=0.15)
    # What echoes in the line is paid for as well: more with a delay.
    least = friction(name, "lever", one.speed)
    assert one.drag is not None
    assert 0.97 * least < one.drag < (1.03 + 3.0 * delay) * least
    assert one.own == pytest.approx(0.025 + 0.015 * one.speed)


@pytest.mark.slow
def test_scales_and_units_are_the_masters() -> None:
    both = feel("bench-2axis-loopback")
    rig = load_rig(CONFIGS / "bench-2axis-loopback.yaml")
    for pair, one in both.items():
        keys = rig.coupling.pairs[pair]
        offset = pair_facts(rig, pair, command_delays(rig)).offset_per_effort
        assert one.stiffness == pytest.approx(1.0 / (offset + 1.0 / one.wall), rel=0.1), pair
        assert one.rotary == (rig.master.axes[pair].kind == "rotary")
        least = friction("bench-2axis-loopback", pair, one.speed, keys.position_scale)
        assert one.drag == pytest.approx(least, rel=0.35), pair
    assert both["slide"].wall > 1e4


@pytest.mark.slow
def test_what_cannot_be_felt_is_said() -> None:
    lost = feel("bench-1dof-2khz", POSITION.format(0.02))["lever"]
    assert lost.drag is None
    assert lost.ended
    assert lost.sentences()[-1].startswith("pair lever: ")
    found, silent = rig_feel(load_rig(CONFIGS / "arms-loopback.yaml"))
    assert not found
    assert "arm" in silent[0]
    assert rig_feel(load_rig(CONFIGS / "scene-resonator.yaml")) == ((), ())
    found, silent = rig_feel(load_rig(CONFIGS / "arms" / "six-seven.yaml"))
    assert not found
    assert "tip of an arm" in silent[0]
    # Mirrored, at the lower end of both ranges: neither way is open to both.
    mirrored = [f"{side}.axes.lever.position_range=[0.0, 0.7]" for side in ("master", "slave")]
    changes = [*mirrored, "coupling.pairs.lever.sign=-1"]
    found, silent = rig_feel(load_rig(CONFIGS / "bench-1dof-2khz.yaml", changes))
    assert not found
    assert "starts at its range" in silent[0]
    # A real rig has no simulation: its devices are as it believes them.
    real = feel("epos4-pair")["lever"]
    assert real.stiffness is not None
    assert 0.0 < real.own < real.drag  # type: ignore[operator]


@pytest.mark.slow
def test_a_pair_that_swings_has_no_drag() -> None:
    swings = feel("bench-1dof-2khz", POSITION.format(0.1))["lever"]
    assert swings.drag is None
    assert "swings by itself in free motion" in swings.ended[0]
    pushed = feel(
        "bench-1dof-2khz", "coupling={law: position_force, delay_s: 0, pairs: {lever: {}}}"
    )["lever"]
    assert pushed.stiffness is None
    assert "swings by itself against a wall" in pushed.ended[0]
