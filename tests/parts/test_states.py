"""Laws of positions, velocities and efforts: one effort, what is observed, defaults."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave.certificate import certify
from tautwave.certificate.tuning.answers import reads_sensors
from tautwave.certificate.tuning.two_port import tuning
from tautwave.config import Rig, load_rig
from tautwave.controller import seen
from tautwave.controller.records import AxisState, PairState
from tautwave.couplings.states import law as steps
from tautwave.errors import ConfigError, SafetyStop
from tautwave.rig import command_delays, make_control
from tautwave.simulation import simulate
from tests.lab.couplings.measure import run_coupling, stated_bound
from tests.lab.couplings.rigs import bench_rig
from tests.rigs.running import rig_of, tree

BENCH = Path(__file__).parents[2] / "configs" / "bench-1dof-2khz.yaml"
WALL = "simulation.environment.lever={type: wall, position: 0.005, stiffness: 250, damping: 0.02}"
numbers = st.floats(-10.0, 10.0)


def rig(law: str, pair: dict[str, Any], **more: Any) -> Rig:
    data = tree({"coupling.law": law, "coupling.pairs.a": pair})
    data["coupling"].update(more)
    return rig_of(data)


def ends(law: str, pair: dict[str, Any]) -> tuple[Any, list[AxisState], Any]:
    """A pair's controller, its axes at rest, and its pair's constants."""
    built = rig(law, pair)
    control = make_control(built, command_delays(built), 10)
    return control, [AxisState(end=steps.StatesEnd()) for _ in range(2)], control.pairs[0]


@given(numbers, numbers, numbers, numbers, numbers, numbers, st.sampled_from((1, -1)))
def test_four_channels_in_scaled_and_turned_units_are_one_spring_between_two_sides(
    x: float, y: float, v: float, w: float, f: float, g: float, sign: int
) -> None:
    """What acts on the slave is that on the master, turned round: action and reaction."""
    pair = {"stiffness": 7.0, "damping": 0.3, "force_gain": 0.4, "rejection": 0.0, "sign": sign}
    control, (one, two), q = ends("four_channel", {**pair, "position_scale": 2, "force_scale": 3})
    one.position, two.position, one.velocity, two.velocity = x, y, v, w
    one.end.effort, two.end.effort = f, g
    seen.see(PairState(offset=0.5, link=seen.SeenLink()), q, one, two, [])
    p1, p2 = control.params
    master, slave = steps.effort(one, p1, 0.0), steps.effort(two, p2, 0.0)
    far = sign * (y - 0.5) / 2.0
    expected = 7.0 * (x - far) + 0.3 * (v - sign * w / 2.0) - 0.4 * (f + sign * g / 3.0)
    assert master == pytest.approx(expected, abs=1e-9)
    both = 2.0 * 0.4 * (f + sign * g / 3.0)
    assert master + sign * slave / 3.0 == pytest.approx(-both, abs=1e-9)


@given(numbers, st.sampled_from((0.0, 0.25, 1.0)))
def test_rejection_cancels_what_moves_a_device_and_is_not_its_motor(d: float, r: float) -> None:
    pair = {"stiffness": 7.0, "damping": 0.3, "force_gain": 0.4, "rejection": r}
    control, (one, _), _ = ends("four_channel", pair)
    p = control.params[0]
    one.end.push, one.end.effort = d / p.end.outside.mass, 0.5
    assert steps.effort(one, p, 0.0) == pytest.approx(r * d - 0.4 * 0.5)


@given(numbers, numbers)
def test_the_master_of_position_force_feels_the_slave_and_no_spring(x: float, g: float) -> None:
    pair = {"stiffness": 7.0, "damping": 0.3, "force_gain": 1.5, "master_damping": 0.2}
    control, (one, two), q = ends("position_force", pair)
    one.position, one.velocity, two.end.effort = x, 2.0, g
    seen.see(PairState(link=seen.SeenLink()), q, one, two, [])
    assert steps.effort(one, control.params[0], 0.0) == pytest.approx(0.4 - 1.5 * g)
    expected = -7.0 * x - 0.3 * 2.0
    assert steps.effort(two, control.params[1], 0.0) == pytest.approx(expected)


def test_what_is_believed_of_a_held_device_is_what_pushes_it() -> None:
    """A slave against a spring, at rest: the observer finds the spring's force, friction apart."""
    held = "{type: multisine, ramp_s: 0.1, components: [[0.001, 0.1, 1.5707963]]}"
    built = bench_rig(
        "four_channel", 0.0, account=True, contact="rigid", reference=held, seconds=0.6
    )
    pairs = {
        name: pair.model_copy(update={"rejection": 0.0})
        for name, pair in built.coupling.pairs.items()
    }
    coupling = built.coupling.model_copy(update={"pairs": pairs})
    built = built.model_copy(update={"coupling": coupling})
    run = simulate(built, engine="python")
    at = {name: run.data[-100:, place] for place, name in enumerate(run.columns)}
    believed = float(np.mean(at["slave.lever.believed_effort"]))
    pushed = float(np.mean(at["true.slave.lever.environment_effort"]))
    assert pushed < -0.04
    assert believed == pytest.approx(pushed, rel=0.05, abs=5e-3)


@pytest.mark.parametrize("law", ["position_force", "four_channel", "pd_damping"])
@pytest.mark.parametrize("delay", [0.0, 0.01])
def test_gains_left_to_the_law_come_from_the_devices_and_the_delay(law: str, delay: float) -> None:
    pair = rig(law, {}, delay_s=delay).coupling.pairs["a"]
    swing = math.sqrt(pair.gain("stiffness") / 0.5)  # of the lighter mass
    assert swing <= 100.0 + 1e-2
    if law == "position_force":  # its spring closes no loop over the line
        assert swing == pytest.approx(62.83, rel=1e-3)
    else:
        assert swing * (2.0 * delay + 1e-3) <= 1.0 + 1e-4
    assert pair.gain("damping") == pytest.approx(1.4 * 0.5 * swing, rel=1e-3)
    if law == "pd_damping":
        # Nuno: 4 B B > (T_m + T_s)^2 K K, half a period of hold at either end included
        both = 2.0 * delay + 1e-3
        assert 2.0 * pair.gain("injection") > both * pair.gain("stiffness")


def test_a_slave_with_friction_is_fed_by_a_leader_that_its_law_leaves_alone() -> None:
    """Slow and free on the bench: without, the account starves and the slave stays behind."""

    def error(account: str) -> float:
        slow = "{type: multisine, ramp_s: 0.2, components: [[0.5, 0.1, 0.0]]}"
        keys = f"coupling={{law: position_force, account: {account}, pairs: {{lever: {{}}}}}}"
        free = "simulation.environment.lever={type: free}"
        hand = f"simulation.hand.lever.reference={slow}"
        found = load_rig(BENCH, [keys, free, hand, "duration_s=1.2"])
        return run_coupling(found, engine="python").error

    assert error("{}") < 5e-3
    assert error("{level_friction: 0}") > 30e-3


SENSOR = {"slave.axes.a.effort_sensor": {"noise": 0.1}}
FALSE = {"simulation.axes": {"slave.a": {"effort_sensor": {"offset": 31.0, "noise": 0.1}}}}


def test_a_coupling_does_not_engage_on_a_sensor_that_shows_what_friction_cannot_balance() -> None:
    """With 1000 N as the limit friction may be 20 N; a motor that is off explains no more."""
    fed = {"coupling.law": "position_force", "coupling.pairs.a": {"effort": "measured"}}
    slow = {"rate_hz": 100.0, "duration_s": 6.0}
    with pytest.raises(SafetyStop) as refused:
        simulate(rig_of(tree(fed, slow, SENSOR, FALSE)), engine="python")
    said = str(refused.value)
    assert "slave.a: its effort sensor reads +3" in said
    assert "at most 20.4 N" in said
    assert "set effort_sensor.offset to about 3" in said


def test_a_sensor_that_feeds_no_law_or_is_off_by_less_than_friction_stops_nothing() -> None:
    fed, observed = ({"coupling.pairs.a": keys} for keys in ({"effort": "measured"}, {}))
    less = {"simulation.axes": {"slave.a": {"effort_sensor": {"offset": 19.0, "noise": 0.1}}}}
    slow = {"coupling.law": "position_force", "rate_hz": 100.0, "duration_s": 6.0}
    for change, truth in ((fed, less), (observed, FALSE)):
        run = simulate(rig_of(tree(slow, change, SENSOR, truth)), engine="python")
        assert "not engaged" not in str(run.error)


def test_a_gain_nobody_has_chosen_is_refused() -> None:
    from tautwave.couplings.states.keys import PdDampingPair

    with pytest.raises(ConfigError, match="stiffness is still auto"):
        PdDampingPair().gain("stiffness")


LIAR = "{scale: 40}"
MEASURED = (
    "coupling={law: four_channel, account: %s, pairs: {lever: {stiffness: 20, damping: 0.1, "
    "rejection: %s, effort: %s}}}"
)


def four_channels(effort: str, *more: str, account: str = "{}", rejection: float = 1.0) -> Rig:
    return load_rig(
        BENCH,
        [MEASURED % (account, rejection, effort), "duration_s=0.4", WALL]
        + [f"{side}.axes.lever.effort_sensor={{}}" for side in ("master", "slave")]
        + list(more),
    )


def test_four_channels_may_take_what_the_sensors_of_both_sides_show() -> None:
    """Against a wall at once, where an observer of 30 Hz is late."""
    late = {}
    for effort in ("observed", "measured"):
        run = simulate(four_channels(effort), engine="python")
        met = run["true.slave.lever.environment_effort"]
        believed = run["slave.lever.believed_effort"]
        assert np.abs(met).max() > 0.05
        late[effort] = np.sqrt(np.mean((believed - met)[200:] ** 2))
        for side in ("master", "slave"):
            same = run[f"{side}.lever.believed_effort"] == run[f"{side}.lever.measured_effort"]
            assert np.all(same[1:]) == (effort == "measured")
    assert late["measured"] < 0.2 * late["observed"]


def test_sensors_that_lie_cost_no_more_than_the_account_states() -> None:
    lies = [f"simulation.axes.{side}.lever.effort_sensor={LIAR}" for side in ("master", "slave")]
    kept = four_channels("measured", *lies)
    found = run_coupling(kept, bound=stated_bound(kept), engine="python")
    assert found.excess <= 0.0
    bare = run_coupling(four_channels("measured", *lies, account="null"), engine="python")
    assert bare.made > 50.0 * found.made


def test_of_a_law_that_reads_sensors_nothing_is_known_by_tuning() -> None:
    """Its spring and damper alone, which the encoder sees, would pass with that much damping."""
    damped = [f"{side}.axes.lever.damping=1" for side in ("master", "slave")]
    damped += [f"simulation.axes.{side}.lever.damping=1" for side in ("master", "slave")]
    rig = four_channels("measured", *damped, account="null", rejection=0.0)
    assert reads_sensors(rig, "lever", command_delays(rig))
    assert tuning(rig, "lever", command_delays(rig)) is None
    observed = four_channels("observed", *damped, account="null", rejection=0.0)
    assert not reads_sensors(observed, "lever", command_delays(observed))
    assert not certify(rig).verdicts["passive"].passed
    spring = "{law: position, engage_ramp_s: 0.02, pairs: {lever: {stiffness: 20, damping: 0.1}}}"
    plain = load_rig(BENCH, [f"coupling={spring}", *damped])
    assert certify(plain).verdicts["passive"].passed


@pytest.mark.parametrize("side", ["master", "slave"])
def test_four_channels_without_a_sensor_say_which_side_has_none(side: str) -> None:
    with pytest.raises(ConfigError, match=f"the {side} has no effort_sensor"):
        simulate(
            four_channels("measured", f"{side}.axes.lever.effort_sensor=null"), engine="python"
        )
