"""A rig that is played with the pointer of its page: the hand it leads, who may, and the sound."""

from __future__ import annotations

import base64
import itertools
import json
import math
import time
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from websockets.sync.client import connect

from tautwave.clock import MonotonicClock, PacedClock
from tautwave.config import Pointer, load_rig
from tautwave.errors import ConfigError, RecordingError
from tautwave.laws.lead import LeadParams
from tautwave.models.hand import PAPER_HAND as GRIP
from tautwave.models.plant import PlantParams, plant_cache, plant_step
from tautwave.rig import build_rig
from tautwave.rig.led import led_by_pointer, pointed_hands
from tautwave.rig.ways import bus_ways
from tautwave.runtime.operate.lead import LOOK_S, Leads, Pointed
from tautwave.runtime.operate.mailbox import Mailbox
from tautwave.session.engine import scene_devices
from tautwave.session.viewing.pointing import refuse_pointers
from tautwave.simulation.memory import run_in_memory
from tautwave.view.watched import Watched
from tautwave_scenes.session.pace import use_engine
from tests.view.served import served

CONFIGS = Path(__file__).parents[2] / "configs"
PLAYED = ("bench-1dof-loopback", "scene-resonator", "scene-granular", "scene-string")
PERIOD, TIMEOUT = 1e-3, 0.3
PARAMS = LeadParams(frame=1 / 60, velocity=2.0, reach=0.1, low=-0.4, high=0.4)


@given(
    st.lists(st.tuples(st.floats(-3.0, 3.0), st.integers(0, 400)), min_size=1, max_size=8),
    st.floats(-0.4, 0.4),
)
def test_the_spring_of_a_pointed_hand_is_bounded_and_goes_with_the_pointer(
    moves: list[tuple[float, int]], place: float
) -> None:
    hand = Pointed(PARAMS, place, PERIOD, TIMEOUT)
    for goal, slots in moves:
        hand.want(goal)
        for k in range(slots):
            reference, rate = hand.aim(place)
            assert abs(reference - place) <= PARAMS.reach + 1e-12
            assert abs(rate) <= max(PARAMS.velocity, PARAMS.reach / PERIOD) + 1e-9
            assert PARAMS.low <= reference <= PARAMS.high
            if k * PERIOD > TIMEOUT + 2 * PERIOD:  # no word of it any more
                assert (reference, rate) == (place, 0.0)


def test_a_hand_holds_until_a_pointer_comes_and_where_it_rests_and_then_pulls_nowhere() -> None:
    hand = Pointed(PARAMS, 0.0, PERIOD, TIMEOUT)
    for _ in range(round(3 * TIMEOUT / PERIOD)):
        assert hand.aim(0.05) == (0.0, 0.0)
    leads = Leads({"lever": hand})
    assert leads.obey("lever=0.25")
    for _ in range(200):
        reference, _ = hand.aim(0.2)
    assert reference == pytest.approx(0.25)
    hand.let_go()
    assert hand.aim(0.21) == (0.21, 0.0)


@given(st.floats(-0.6, 0.6), st.floats(-3.0, 3.0))
def test_a_hand_that_let_go_gives_nothing_and_is_an_end_stop_at_its_range(
    place: float, speed: float
) -> None:
    hand = Pointed(PARAMS, place, PERIOD, TIMEOUT)
    hand.want(0.0)
    hand.let_go()
    plant = PlantParams(0.1, 0.0, 0.0, GRIP.stiffness, GRIP.damping, *[0.0] * 6)
    cache = plant_cache(plant, PERIOD)
    x, v, mode = place, speed, 0
    before = math.inf
    for _ in range(300):
        reference, rate = hand.aim(x)
        assert (reference, rate) == (max(PARAMS.low, min(PARAMS.high, x)), 0.0)
        energy = 0.5 * plant.mass * v * v + 0.5 * plant.grip_stiffness * (x - reference) ** 2
        assert energy <= before * (1.0 + 1e-9) + 1e-15
        before = energy
        x, v, mode = plant_step(plant, cache, x, v, mode, 0.0, reference, rate, PERIOD)[:3]
    assert abs(v) < 0.01
    assert PARAMS.low - 0.01 < x < PARAMS.high + 0.01


@pytest.mark.slow
def test_a_bar_that_is_let_go_stays_inside_its_range_while_grains_push_it() -> None:
    rig = led_by_pointer(load_rig(CONFIGS / "scene-granular.yaml"))
    devices = scene_devices(rig, "compiled")
    built = use_engine(build_rig(rig, clock="fake", duration_s=4.0, devices=devices), "compiled")
    (hand,) = [axis.lead for world in built.simulators for axis in world.axes]
    looks = itertools.count()

    def look() -> None:
        at = next(looks) * LOOK_S
        if at < 0.6:  # down onto the grains
            hand.want(-0.018)
        elif not hand.stale:
            hand.let_go()

    hand.look = look
    result, rows = run_in_memory(built)
    assert result.error is None
    position = rows[:, list(built.columns).index("true.master.bar.position")]
    low, high = hand.range
    assert position.min() < -0.01
    late = position[len(position) // 2 :]
    assert low - 5e-3 < late.min() <= late.max() < high + 5e-3


@pytest.mark.parametrize("name", PLAYED)
def test_shipped_rigs_are_played_inside_their_ranges(name: str) -> None:
    given_rig = load_rig(CONFIGS / f"{name}.yaml")
    rig = led_by_pointer(given_rig)
    assert pointed_hands(rig) == list(rig.master.axes)
    assert pointed_hands(led_by_pointer(rig)) == list(rig.master.axes)
    assert rig.simulation is not None
    assert given_rig.simulation is not None
    assert rig.loop == given_rig.loop
    assert isinstance(build_rig(rig, duration_s=0.01).clock, PacedClock)
    assert isinstance(build_rig(given_rig, duration_s=0.01).clock, MonotonicClock)
    for axis_name, axis in rig.master.axes.items():
        hand: Any = rig.simulation.hand[axis_name]
        before: Any = given_rig.simulation.hand[axis_name]
        assert isinstance(hand.reference, Pointer)
        assert hand.stiffness == before.stiffness  # the grip stays what it was
        assert hand.reference.range is not None
        assert axis.position_range is not None
        low, high = hand.reference.range
        assert axis.position_range[0] < low < high < axis.position_range[1]
        places = [place for _, place in before.reference.waypoints]
        assert high - low >= 0.9 * (max(places) - min(places))
    refuse_pointers(rig, bus_ways(rig, clock="real"), "real")
    with pytest.raises(ConfigError, match="needs the real clock"):
        refuse_pointers(rig, bus_ways(rig, clock="fake"), "fake")


def test_a_pointer_moves_no_hardware() -> None:
    rig = load_rig(CONFIGS / "bench-modbus-tcp-sim.yaml")
    pointed = led_by_pointer(rig)
    for simulate in (False, True):
        ways = bus_ways(pointed, clock="real", simulate=simulate)
        with pytest.raises(ConfigError, match="a pointer moves nothing but devices"):
            refuse_pointers(pointed, ways, "real")
    bare = rig.model_copy(update={"simulation": None})
    with pytest.raises(ConfigError, match="a pointer moves no hardware"):
        led_by_pointer(bare)


def test_places_come_to_the_run_from_who_may_and_wrong_ones_are_refused(tmp_path: Path) -> None:
    with Mailbox() as mailbox:
        pointer = {"mailbox": mailbox.address, "ranges": {"lever": [-0.4, 0.4]}}
        with served(tmp_path, plain=True, pointer=pointer) as (_, door):
            origin: Any = f"http://127.0.0.1:{door.port}"
            with connect(f"ws://127.0.0.1:{door.port}/live", origin=origin) as socket:

                def ask(**fields: Any) -> str:
                    socket.send(json.dumps(fields))
                    while True:
                        said = json.loads(str(socket.recv(60)))
                        if said["op"] in ("note", "may"):
                            return str(said.get("text", said.get("may")))

                assert "token" in ask(op="pointer", places={"lever": 0.1})
                assert ask(op="hello", token=door.token) == "True"
                for wrong in ({}, {"lever": "x"}, {"lever": True}, [1], 3, {"lever": 1e999}):
                    assert "a pointer is places by name" in ask(op="pointer", places=wrong)
                assert "wrist: no hand" in ask(op="pointer", places={"wrist": 0.1})
                socket.send(json.dumps({"op": "pointer", "places": {"lever": 0.125}}))
                socket.send(json.dumps({"op": "pointer", "places": None}))
                assert "there is no such request" in ask(op="nonsense")
                orders = mailbox.source.take(0)
                assert [(one.word, one.argument) for one in orders] == [
                    ("lead", "lever=0.125"),
                    ("release", ""),
                ]
        with pytest.raises(RecordingError, match="follows a pointer"):
            Watched(tmp_path, _live(), object()).point({"lever": 0.1})  # type: ignore[arg-type]


def _live() -> Any:
    from tautwave.runtime.tap import Live

    return Live(0, 0, (), 1, 1.0, {})


def test_the_sound_of_a_played_scene_comes_to_the_page_once_it_is_there(tmp_path: Path) -> None:
    text = (CONFIGS / "scene-resonator.yaml").read_text()
    with Mailbox() as mailbox:
        pointer = {"mailbox": mailbox.address, "ranges": {"stylus": [-0.01, 0.01]}}
        with served(tmp_path, text, plain=True, pointer=pointer, units={}) as (run, door):
            origin: Any = f"http://127.0.0.1:{door.port}"
            with connect(f"ws://127.0.0.1:{door.port}/live", origin=origin) as socket:
                run.commit(3)
                (tmp_path / "output.wav").write_bytes(b"RIFF of a run")
                run.close()
                sound = None
                until = time.monotonic() + 60.0
                while sound is None and time.monotonic() < until:
                    data = socket.recv(60)
                    said = json.loads(data) if isinstance(data, str) else {}
                    sound = said.get("wav") if said.get("op") == "sound" else None
                assert sound is not None
                assert base64.b64decode(sound) == b"RIFF of a run"
