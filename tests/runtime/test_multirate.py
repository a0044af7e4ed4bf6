"""Slow buses in the loop: which slot does what, what overruns cost, and the pair in between."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave.controller.records import AxisParams, AxisState, RunParams
from tautwave.controller.stops import AxisName
from tautwave.couplings.wave import law as rates
from tautwave.errors import DriverError
from tautwave.runtime.loop import READ_SHARE, TIMING_COLUMNS, Loop
from tautwave.runtime.sensing import LoopBus, Sensing
from tautwave.types import CommandDelay, Fault, JointState
from tests.rigs.running import ListSink
from tests.runtime.parts import PERIOD_NS, Pair, ScriptedDriver, T, site, state

SCALED = {"scale": 2.0, "sign": -1.0, "power": 1.4}


def multirate(
    divisors: tuple[int, int],
    *,
    line: int = 3,
    filtered: bool = False,
    scaled: bool = False,
    delay: int = 1,
    run: RunParams | None = None,
) -> Pair:
    """Return a pair that goes through the slots of one with a slow side, even if none is slow."""
    gains = (1.0, -math.sqrt(1.4) if scaled else 1.0)
    corner = 8.0 if filtered else None
    sites = [
        site(divisor=n, delay=delay if n > 1 else 0, wave=gain, filter_hz=corner)
        for n, gain in zip(divisors, gains, strict=True)
    ]
    scale = SCALED if scaled else {}
    return Pair(*sites, line=line, rated=True, run=run, **scale)  # type: ignore[arg-type]


# -- the pair ------------------------------------------------------------------------------------

script = st.lists(
    st.tuples(st.floats(-0.01, 0.01), st.floats(-0.01, 0.01), st.booleans(), st.booleans(),
              st.sampled_from([0, 0, 0, 0, 1, 2, 13])),
    min_size=2, max_size=80,
)  # fmt: skip
ratios = st.one_of(st.just(1), st.integers(2, 6), st.integers(1, 50))


def motors(pair: Pair) -> tuple[float, float]:
    """Return what both motors took out of their devices [J, pair], and the flow it is part of."""
    one, two = pair.master, pair.slave
    return (
        one.port_energy + pair.weight * two.port_energy,
        one.gross_flow + pair.weight * two.gross_flow,
    )


@given(
    script, ratios, ratios, st.integers(0, 49), st.sampled_from([0, 1, 4]), st.booleans(),
    st.booleans(), st.integers(1, 2),
)  # fmt: skip
def test_no_ratio_phase_loss_or_motion_opens_the_books(
    moves: list[tuple[float, float, bool, bool, int]],
    first: int,
    second: int,
    phase: int,
    line: int,
    filtered: bool,
    scaled: bool,
    delay: int,
) -> None:
    """Positions, losses and skipped slots at random: no device moves like this, all the better."""
    pair = multirate((first, second), line=line, filtered=filtered, scaled=scaled, delay=delay)
    pair.start(state(), state())
    pair.slot = phase
    pair.engage(1.0)
    lost = {"converter_master": 0.0, "converter_slave": 0.0}
    waves = 0.0
    for one, two, one_valid, two_valid, skipped in moves:
        pair.cycle(state(one, valid=one_valid), state(two, valid=two_valid), skipped, 1.0)
        reported = pair.elements()
        taken, flow = motors(pair)
        waves += sum(T * (s.leaving**2 + s.arrived**2) for s in (pair.master, pair.slave))
        scale = flow + 60.0 * waves + 1e-300
        tanks = 1e-13  # rounding of the reserves, 1 J each
        for name, (absorbed, stored, dissipated) in reported.items():
            assert absorbed == pytest.approx(stored + dissipated, abs=1e-12 * scale + tanks), name
            if name in lost:
                # Passive at every moment: it holds what it has, and never loses less than before.
                assert stored >= 0.0
                assert absorbed >= -1e-13 * scale
                assert dissipated >= lost[name]
                lost[name] = dissipated
        total = sum(stored + dissipated for _, stored, dissipated in reported.values())
        assert taken == pytest.approx(total, abs=1e-11 * scale + tanks)


@given(script, st.integers(2, 50), st.sampled_from([0, 3]), st.booleans())
def test_the_wave_integral_is_exact_across_the_converter(
    moves: list[tuple[float, float, bool, bool, int]], divisor: int, line: int, filtered: bool
) -> None:
    """What the slow side sent and got, times its period, is what the line got and sent."""
    pair = multirate((1, divisor), line=line, filtered=filtered)
    sums = dict.fromkeys(("load_wave", "give_wave", "take_wave", "hand_over_wave"), 0.0)
    size = [0.0]

    def spy(name: str, periods: int) -> Callable[..., float | None]:
        step = getattr(rates, name)

        def counted(s: AxisState, p: AxisParams, *wave: float) -> float | None:
            given: float | None = step(s, p, *wave)
            moved = wave[0] if wave else given
            assert moved is not None
            sums[name] += periods * moved
            size[0] += abs(moved) * periods
            return given

        return counted

    pair.start(state(), state())
    pair.engage(1.0)
    slow = {"load_wave": divisor, "give_wave": 1, "take_wave": 1, "hand_over_wave": divisor}
    with pytest.MonkeyPatch.context() as patch:
        for name, periods in slow.items():
            patch.setattr(rates, name, spy(name, periods))
        for one, two, one_valid, two_valid, skipped in moves:
            pair.cycle(state(one, valid=one_valid), state(two, valid=two_valid), skipped, 1.0)
    converter = pair.slave
    under_way = converter.rate_left * converter.rate_held
    rounding = 1e-12 * size[0] + 1e-300
    assert sums["load_wave"] - sums["give_wave"] == pytest.approx(under_way, abs=rounding)
    block = converter.rate_count * converter.rate_mean
    assert sums["take_wave"] - sums["hand_over_wave"] == pytest.approx(block, abs=rounding)


@given(script, st.sampled_from([0, 1, 4]), st.booleans())
def test_a_ratio_of_one_changes_no_bit(
    moves: list[tuple[float, float, bool, bool, int]], line: int, filtered: bool
) -> None:
    turned = multirate((1, 1), line=line, filtered=filtered)
    corner = 8.0 if filtered else None
    plain = Pair(site(filter_hz=corner), site(filter_hz=corner), line=line)
    for pair in (plain, turned):
        pair.start(state(), state())
        pair.engage(1.0)
    for one, two, one_valid, two_valid, skipped in moves:
        for pair in (plain, turned):
            pair.cycle(state(one, valid=one_valid), state(two, valid=two_valid), skipped, 1.0)
        for a, b in ((plain.master, turned.master), (plain.slave, turned.slave)):
            for name in ("command", "leaving", "account", "gap", "port_energy", "arrived"):
                assert getattr(a, name) == getattr(b, name), name


@given(st.lists(st.floats(-10.0, 10.0), min_size=1, max_size=20))
def test_a_converter_with_nothing_to_convert_hands_on_every_bit(waves: list[float]) -> None:
    axis = site(divisor=1)
    for wave in waves:
        rates.load_wave(axis.state, axis.params, wave)
        assert rates.give_wave(axis.state, axis.params) == wave
        rates.take_wave(axis.state, axis.params, wave)
        assert rates.hand_over_wave(axis.state, axis.params) == wave
        assert rates.stored_in_converter(axis.state, axis.params) == 0.0
    assert axis.rate_dissipated == 0.0


@given(script, st.integers(2, 50), st.sampled_from([0, 4]))
def test_master_and_slave_may_change_places(
    moves: list[tuple[float, float, bool, bool, int]], divisor: int, line: int
) -> None:
    plain, turned = multirate((1, divisor), line=line), multirate((divisor, 1), line=line)
    for pair in (plain, turned):
        pair.start(state(), state())
        pair.engage(1.0)
    for one, two, one_valid, two_valid, skipped in moves:
        first, second = state(one, valid=one_valid), state(two, valid=two_valid)
        plain.cycle(first, second, skipped, 1.0)
        turned.cycle(second, first, skipped, 1.0)
        for a, b in ((plain.master, turned.slave), (plain.slave, turned.master)):
            for name in ("command", "leaving", "account", "gap", "port_energy"):
                assert getattr(a, name) == getattr(b, name), name


# -- the schedule --------------------------------------------------------------------------------


class Slots:
    """A fast and a slow bus in a loop; what was called, in which slot."""

    def __init__(
        self,
        divisor: int,
        cycles: int,
        *,
        away: dict[int, int] | None = None,
        slow: dict[str, object] | None = None,
        missing_limit: int = 100,
        ages: Callable[[int], int] = lambda exchange: 0,
    ) -> None:
        self.now = -1
        self.calls: list[tuple[int, str]] = []
        self.asked: list[float] = []
        rig = self
        away = away or {}

        class Noting(ScriptedDriver):
            def _call(self, method: str) -> int:
                if method in ("request", "read", "write"):
                    rig.calls.append((rig.now, method))
                return super()._call(method)

            def read(self, deadline_ns: int) -> list[JointState]:
                rig.asked.append(deadline_ns)
                age = ages(self.cycle)
                return [it._replace(age_ns=age) for it in super().read(deadline_ns)]

        class Ticking(ScriptedDriver):
            def request(self) -> None:
                rig.now = round(clock.now_ns() / PERIOD_NS)
                super().request()

        from tautwave.clock import FakeClock

        clock = FakeClock(oversleep=lambda at: PERIOD_NS * away.get(round(at / PERIOD_NS), 0))
        self.fast = Ticking("fast")
        self.slow = Noting("slow", **(slow or {}))  # type: ignore[arg-type]
        self.slow.command_delay = CommandDelay(1, 0.0)
        run = RunParams(PERIOD_NS, cycles, 2, 1, 0, 5, missing_limit, 100, 0.1, 5e9)
        self.pair = multirate((1, divisor), run=run)
        self.pair.control.names = [
            AxisName("master.a", "fast", "rad"),
            AxisName("slave.a", "slow", "rad"),
        ]
        source = self.pair.control
        self.columns = [*TIMING_COLUMNS, *source.columns]
        self.sink = ListSink(len(self.columns))
        self.loop = Loop(
            clock,
            [
                LoopBus("fast", self.fast, ["master.a"]),
                LoopBus("slow", self.slow, ["slave.a"], divisor),
            ],
            source,
            [source],
            self.sink,
        )
        self.result = self.loop.run()
        self.calls = [call for call in self.calls if call[0] >= 0]

    def slots(self, method: str) -> list[int]:
        return [slot for slot, called in self.calls if called == method]


@pytest.mark.parametrize("divisor", [2, 3, 10, 50])
def test_a_slow_bus_is_asked_first_and_read_last(divisor: int) -> None:
    run = Slots(divisor, 4 * divisor)
    assert run.result.error is None
    assert run.slots("request") == [0, divisor, 2 * divisor, 3 * divisor]
    last = [divisor - 1, 2 * divisor - 1, 3 * divisor - 1, 4 * divisor - 1]
    assert run.slots("read") == last
    assert run.slots("write")[:-1] == last  # and the safe command after the run
    assert run.asked == [slot * PERIOD_NS + int(READ_SHARE * PERIOD_NS) for slot in last]
    assert run.fast.counts["read"] == 4 * divisor
    assert run.result.lost == (0, 0)


def test_a_skipped_answer_is_thrown_away_and_the_next_exchange_is_on_time() -> None:
    """Slot 5, the last of exchange 1 (n = 3), goes by unseen: read and write make room first."""
    run = Slots(3, 12, away={5: 1})
    assert (6, "request") in run.calls
    at = run.calls.index((6, "request"))
    assert run.calls[at - 2 : at] == [(6, "read"), (6, "write")]
    assert run.asked[1] == 0  # whoever waits for it does so no longer
    assert run.slots("request") == [0, 3, 6, 9]
    assert run.slots("read") == [2, 6, 8, 11]
    # Nobody's sample is missing; the loop was away, and that is counted.
    assert run.result.lost == (0, 0)
    assert run.result.missed_cycles == 1


def test_a_request_is_late_up_to_half_a_period_of_the_bus() -> None:
    """n = 10: begun in slot 14 at the latest, as drives round; in 15 it would be the next one's."""
    assert Slots(10, 40, away={10: 4}).slots("request") == [0, 14, 20, 30]
    run = Slots(10, 40, away={10: 5})
    assert run.slots("request") == [0, 20, 30]
    assert run.slots("read") == [9, 29, 39]
    assert run.slots("write")[:-1] == [9, 19, 29, 39]
    assert run.result.lost == (0, 0)
    invalid = run.columns.index("slave.a.valid")
    assert [row[invalid] for row in run.sink.rows][14] == 0.0  # reported in the row of slot 19


def test_a_whole_exchange_may_go_by() -> None:
    run = Slots(4, 24, away={7: 6})  # away from slot 7 to slot 12
    assert run.slots("request") == [0, 4, 13, 16, 20]
    assert run.slots("read") == [3, 13, 15, 19, 23]
    assert run.calls[run.calls.index((13, "request")) - 1] == (13, "write")


def test_missing_and_late_count_exchanges_of_the_bus() -> None:
    n = 5
    run = Slots(n, 200, slow={"valid": lambda axis, k: k < 3}, missing_limit=4)
    assert isinstance(run.result.error, DriverError)
    assert "slave.a on bus 'slow': no sample in 4 exchanges in a row" in str(run.result.error)
    assert run.result.cycles == 7 * n + 5  # exchanges 3 to 6 were missed; then the release ramp
    late = Slots(n, 50, ages=lambda k: n * PERIOD_NS + (1 if k >= 8 else 0))
    assert late.result.late == (0, 2)


def test_faults_of_a_slow_bus_end_the_run_when_it_is_read() -> None:
    run = Slots(4, 40, slow={"faults": {2: Fault("slave.a", "too hot", True)}})
    assert "too hot" in str(run.result.error)
    assert run.slots("read")[2] == 11


def test_enabling_steps_a_slow_bus_at_its_own_period() -> None:
    run = Slots(10, 10, slow={"enable_steps": 3})
    assert run.slow.counts["enable_step"] == 3
    assert run.fast.counts["enable_step"] == 21  # every cycle of 20, while the slow one is not on


def test_a_slow_side_engages_with_its_first_sample() -> None:
    run = Slots(10, 40, slow={"positions": lambda axis, k: 0.25})
    position = [row[run.columns.index("slave.a.position")] for row in run.sink.rows]
    assert position[8] == 0.0
    assert position[9:] == [0.25] * 31


def test_sensing_without_slow_buses_asks_all_before_it_reads_any() -> None:
    log: list[tuple[str, str]] = []
    drivers = [ScriptedDriver(name, log=log) for name in ("one", "two")]
    buses = [LoopBus(it.name, it, [f"{it.name}.a"]) for it in drivers]
    Sensing(buses, Pair(site(), site()).control).sense(7, 0)
    assert [call for call in log if call[1] != "faults"] == [
        ("one", "request"), ("two", "request"), ("one", "read"), ("two", "read"),
    ]  # fmt: skip


def test_a_driver_is_polled_while_its_exchange_is_under_way(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    slots: list[int] = []
    monkeypatch.setattr(
        ScriptedDriver, "poll", lambda self: slots.append(self.cycle), raising=False
    )
    run = Slots(3, 12, away={5: 1})
    assert run.result.error is None
    # Of the slow bus alone, in every slot that the loop saw: slot 5 of exchange 1 went by.
    assert slots == [0, 0, 0, 1, 1, 2, 2, 2, 3, 3, 3]
