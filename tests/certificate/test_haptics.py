"""What a rig can show a hand: stiffest walls, felt impedance, limit cycles of walls that fail."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from tautwave.analysis.ports.loop_modes import least_damped
from tautwave.analysis.ports.sampled_loop import LinearEnd
from tautwave.analysis.walls.limit_cycle import REST
from tautwave.certificate import haptics as room
from tautwave.certificate.belief import declared_delays
from tautwave.certificate.haptics import haptics
from tautwave.certificate.haptics.cycles import wall_cycles
from tautwave.certificate.haptics.pictures import cycle_figure, felt_figure, width_figure
from tautwave.certificate.haptics.transparency import Felt, pair_felt
from tautwave.certificate.haptics.width import AxisWidth, axis_width
from tautwave.certificate.loops import believed_end
from tautwave.config import Rig, load_rig
from tautwave.registry import load_coupling

CONFIGS = Path(__file__).parents[2] / "configs"


def rig(name: str, *overrides: str) -> Rig:
    return load_rig(CONFIGS / f"{name}.yaml", overrides)


def felt(name: str, *overrides: str) -> Felt:
    one = rig(name, *overrides)
    found = pair_felt(one, next(iter(one.coupling.pairs)), declared_delays(one))
    assert isinstance(found, Felt)
    return found


def test_the_stiffest_passive_wall_is_colgate_and_schenkels() -> None:
    one = rig("bench-1dof-loopback")
    found = axis_width(one, "slave.lever", declared_delays(one))
    # b = K T / 2 + B
    reported = np.maximum(0.0, 2.0 * (0.002 - found.dampings) / 1e-3)
    assert found.passive == pytest.approx(reported, abs=1e-6)
    assert found.best() == pytest.approx((4.0, 0.0))
    assert np.all(found.stable >= found.passive * (1.0 - 1e-9))
    assert found.firmest()[0] > 100.0 * found.best()[0]
    assert found.wall == (3.0, 0.0004)
    assert "K = 4 N m/rad with B = 0" in found.sentence()


def test_low_frequencies_show_mass_damping_and_spring_of_a_position_pair() -> None:
    found = felt("bench-position-coupling")
    assert found.stiffness == pytest.approx(1.5, rel=1e-3)  # the coupler's K
    assert found.damping == pytest.approx(0.004 + 2 * 0.0005 + 1.5 * 0.005, rel=0.5)
    assert found.ideal is not None
    assert found.touching is not None
    # Two springs in series: 1.5 and the wall's.
    wall = float(-found.ideal[0].imag * 2.0 * math.pi * found.hertz[0])
    both = float(-found.touching[0].imag * 2.0 * math.pi * found.hertz[0])
    assert both == pytest.approx(1.0 / (1.0 / 1.5 + 1.0 / wall), rel=5e-3)


def test_hand_and_environment_that_are_named_make_the_exact_loop_unstable() -> None:
    found = felt("bench-position-coupling", "coupling.delay_s=0.05")
    assert not found.stable
    assert found.ends is not None
    assert min(*found.ends.hand, *found.ends.environment) >= 0.0
    assert "together are unstable" in found.sentences()[-1]
    prompt = felt("bench-position-coupling", "coupling.delay_s=0")
    assert prompt.stable
    assert prompt.ends is None


def test_a_margin_within_the_hold_is_not_a_failure_without_ends() -> None:
    found = felt("bench-1dof-loopback")
    assert found.stable
    short = found._replace(margin=found.margin - found.margin.min() - 0.5 * found.blur.max())
    at = np.full_like(found.margin, 1.0)
    at[-1] = -0.5 * found.blur[-1]
    assert found._replace(margin=at).stable
    at[-1] = -2.0 * found.blur[-1]
    assert not found._replace(margin=at).stable
    assert not short.stable


@pytest.mark.slow
def test_what_cannot_be_said_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    found = haptics(rig("bench-multirate-loopback"))
    assert not found.felt
    assert "different rates" in found.silent[-1]
    found = haptics(rig("bench-admittance-loopback"))
    assert [one.axis for one in found.widths] == ["master.lever"]
    assert "slave.lever: it is velocity-controlled" in found.silent[0]
    assert haptics(rig("scene-resonator")).sentences() == [
        ("Not said", ["the hand touches a scene; see its certificate"])
    ]
    one = rig("bench-1dof-loopback")
    from tautwave.certificate.haptics import transparency

    def mute(*args: object, **keys: object) -> LinearEnd:
        return believed_end(*args, **keys)._replace(push=None)  # type: ignore[arg-type]

    monkeypatch.setattr(transparency, "believed_end", mute)
    assert "has no force inputs" in str(pair_felt(one, "lever", declared_delays(one)))
    monkeypatch.setattr(
        transparency, "coupling_part", lambda rig: load_coupling("wave")._replace(linear="")
    )
    assert "has no linear model" in str(pair_felt(one, "lever", declared_delays(one)))


@pytest.mark.slow
def test_limit_cycles_are_of_walls_that_fail_only() -> None:
    def cycles(*overrides: str) -> tuple[room.WallCycle, ...]:
        one = rig("bench-1dof-loopback", *overrides)
        return wall_cycles(one, declared_delays(one))

    key = "coupling.pairs.lever.wall_slave"
    assert cycles() == ()
    [found] = cycles(f"{key}.stiffness=40")
    assert found.predicted is not None
    assert found.predicted.frequency == pytest.approx(found.simulated.frequency, rel=0.03)
    assert "predicted limit cycle" in found.sentences()[0]
    assert cycles(f"{key}.stiffness=40", f"{key}.passivity_control=true") == ()
    # Not passive, but stable: some hand finds its limit cycle, a constant force does not.
    [rest] = cycles(f"{key}.stiffness=5", f"{key}.damping=0.0015")
    assert "comes to rest" in " ".join(rest.sentences())
    none = ["slave.axes.lever.damping=0", "simulation.axes.slave.lever.damping=0"]
    [boundless] = cycles(f"{key}.stiffness=40", *none)
    assert "unbounded" in boundless.sentences()[0]
    assert boundless.as_dict()["predicted"]["depth"] is None


@pytest.mark.sparse(3)
@pytest.mark.parametrize(
    ("change", "named"), [({}, True), ({"predicted": None}, False), ({"predicted": REST}, False)]
)
def test_a_prediction_is_drawn_where_there_is_one(change: dict[str, object], named: bool) -> None:
    one = rig("bench-1dof-loopback", "coupling.pairs.lever.wall_slave.stiffness=40")
    [found] = wall_cycles(one, declared_delays(one))
    figure = cycle_figure("bench", (found._replace(**change),))  # type: ignore[arg-type]
    [panel] = [axes for axes in figure.axes if axes.axison]
    labels = panel.get_legend_handles_labels()[1]
    assert any(label.startswith("simulated, ") for label in labels)
    assert any(label.startswith("predicted, ") for label in labels) == named


@pytest.mark.slow
def test_pictures_name_every_axis_pair_and_wall() -> None:
    found = haptics(rig("bench-1dof-loopback", "coupling.pairs.lever.wall_slave.stiffness=40"))
    for figure, count in (
        (width_figure("bench", found.widths), 2),
        (felt_figure("bench", found.felt), 2),
        (cycle_figure("bench", found.cycles), 1),
    ):
        drawn = [axes for axes in figure.axes if axes.axison]
        assert len(drawn) == count
        assert all(axes.get_xlabel() and axes.get_ylabel() for axes in drawn)


def test_the_ends_of_a_pair_are_those_of_the_certificate() -> None:
    # One extra line in an end must not change what stability is judged by.
    one = rig("bench-1dof-loopback")
    delays = declared_delays(one)
    ends = [believed_end(one, f"{side}.lever", delays, "lower") for side in ("master", "slave")]
    assert least_damped(ends[0], ends[1], one.delay_samples, one.period_s).radius < 1.0
    assert all(end.push is not None and len(end.push.state) == len(end.b) for end in ends)


@pytest.mark.parametrize(
    ("stiff", "says"),
    [
        (0.0, "no wall is passive at 1000 Hz, its damping is 0.02"),
        (0.5, "the stiffest passive wall is K = 0.5 N m/rad with B = 0.1 "),
    ],
)
def test_what_walls_an_axis_bears_is_said(stiff: float, says: str) -> None:
    two = np.array([0.0, stiff])
    found = AxisWidth("slave.a", True, 1e-3, 0.02, 1e-3, 0.0, None, two / 5.0, two, two, None)
    assert found.sentence().startswith(f"slave.a: {says}")
