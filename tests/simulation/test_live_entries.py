"""Machine code of the live loop as Python calls it: arguments, and slots of its devices."""

from __future__ import annotations

import inspect
from typing import Any

import pytest

from tautwave.contracts import AxisSpec, BusSpec
from tautwave.truth import AxisModel
from tests.sim.truths import truth

pytest.importorskip("numba")
from tautwave.simulation.live import entry
from tautwave.simulation.live.devices import CompiledDevices


def takes_arrays_then_whole_numbers(what: entry.Entry) -> bool:
    kinds = [one.annotation for one in inspect.signature(what.function).parameters.values()]
    return kinds == ["Any"] * len(what.arrays) + ["int"] * what.wholes


@pytest.mark.parametrize(
    "what",
    [entry.STEP_CONTROL, entry.END_CONTROL, entry.STEP_DEVICES],
    ids=["control", "end", "devices"],
)
def test_an_entry_takes_its_arrays_and_then_whole_numbers(what: entry.Entry) -> None:
    assert takes_arrays_then_whole_numbers(what)


def test_devices_pass_to_the_slot_that_is_nearest(monkeypatch: pytest.MonkeyPatch) -> None:
    taken: list[tuple[int, int]] = []

    def step_devices(*given: Any) -> None:
        taken.append(given[-2:])

    monkeypatch.setattr(entry, "entry", lambda *_: step_devices)
    model: AxisModel = truth()
    bus = BusSpec("arm", (AxisSpec("slave.a", 1, "linear", "impedance", 1.0),), 1000.0)
    devices = CompiledDevices(bus, [model], 10)
    period, start = round(1e9 * model.period), 7_000_000
    devices.advance(start)
    devices.advance(start + period + period // 3)
    devices.command([0.5])
    devices.advance(start + 3 * period - period // 3)
    devices.advance(start + 2 * period)  # never back
    assert taken == [(0, 0), (1, 0), (3, 1), (3, 0)]  # a command goes with the next step
    assert devices.values[0] == 0.5
