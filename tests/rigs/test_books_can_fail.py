"""Defects planted in ports, lines and drivers: the books of a run say so."""

from __future__ import annotations

from typing import Any

import pytest

from tautwave.controller import rows
from tautwave.couplings.wave import law, port
from tautwave.errors import SafetyStop
from tautwave.laws.port import port_close
from tautwave.rig import Assembly
from tests.rigs.closing import CLOSED, EXACT, MOTION, WALLS, line, port_bound
from tests.rigs.running import Run, books, run_rig, tree

LOSSLESS = tree(MOTION, line(2), {"duration_s": 2.0})


def fails(run: Run) -> bool:
    """Return whether the books say that something is wrong."""
    found = books(run)
    line_made = found.generated.get("line", 0.0)
    return (
        found.residual > CLOSED * found.gross_flow
        or line_made > EXACT * found.gross_flow
        or abs(found.sensing_gap) > CLOSED * found.gross_flow
        or any(found.generated[f"port_{s}"] > port_bound(run, s) for s in ("master", "slave"))
    )


def test_the_sound_run_passes() -> None:
    assert not fails(run_rig(LOSSLESS))


def test_defect_a_wave_that_nobody_paid_for(monkeypatch: pytest.MonkeyPatch) -> None:
    def defect(p: Any, *rest: Any) -> Any:
        leaving, *books = port_close(p, *rest)
        return 1.02 * leaving, *books

    monkeypatch.setattr(port, "port_close", defect)
    assert fails(run_rig(LOSSLESS))


def test_defect_a_wave_duplicated_on_the_line(monkeypatch: pytest.MonkeyPatch) -> None:
    exchange = law.exchange_waves
    last = [0.0]

    def defect(*given: Any) -> tuple[float, float]:
        at_master, at_slave = exchange(*given)
        last.append(at_slave)
        return at_master, last[-2] if len(last) % 50 == 0 else at_slave

    monkeypatch.setattr(law, "exchange_waves", defect)
    assert fails(run_rig(LOSSLESS))


def test_defect_another_effort_than_was_booked() -> None:
    def tamper(built: Assembly) -> None:
        device = built.simulators[0].axes[0]
        take = device.command
        device.command = lambda value: take(1.001 * value)

    assert fails(run_rig(LOSSLESS, change=tamper))


def test_defect_a_command_that_acts_later_than_declared() -> None:
    late = {"simulation.axes": {"master.a": {"command_delay_s": 0.001}}}
    assert fails(run_rig(tree(late, base=LOSSLESS)))


def test_defect_a_forgotten_wall(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rows, "stored_in_wall", lambda s, p: 0.0)
    assert fails(run_rig(tree(WALLS, {"duration_s": 1.3}, base=LOSSLESS)))


def test_the_naive_port_fails_the_same_books(monkeypatch: pytest.MonkeyPatch) -> None:
    """F = b vhat - root w, u = root vhat - w: its own identity holds, and its tank ends the run."""

    def naive_effort(
        p: Any, account: float, velocity: float, outside: float, pending: float, arriving: float
    ) -> float:
        effort: float = p.impedance * velocity - p.root * arriving
        return effort

    def naive_close(
        p: Any, account: float, gap: float, filtered: float, moved: float, advance: float,
        periods: float, effort: float, wave_sum: float, wave_energy: float, cut: bool,
    ) -> tuple[float, ...]:  # fmt: skip
        # The estimate that the effort was made of, not the velocity it met; kept in `filtered`.
        leaving = p.root * filtered - wave_sum
        sent = 0.5 * p.period * leaving * leaving
        income = effort * moved + wave_energy
        velocity = moved / p.period
        return leaving, account + income - sent, 0.0, velocity, income - sent, 0.0, 0.0

    def believe_infinite_mass(built: Assembly) -> None:
        control = built.control
        control.params = [
            p._replace(
                site=p.site._replace(half_mobility=0.0),
                end=p.end._replace(
                    port=p.end.port._replace(half_mobility=1e-300),
                    observer=p.end.observer._replace(inverse_mass=0.0),
                ),
            )
            for p in control.params
        ]

    quiet = tree(
        line(2),
        {
            "coupling.pairs.a.wave_impedance": 10.0,
            "slave.axes.a.inertia": {"value": 1e6, "lower": 1e6, "source": "x"},
            "duration_s": 4.0,
        },
    )

    def push(built: Assembly) -> None:
        believe_infinite_mass(built)
        built.simulators[0].axes[0].physics.v = 0.1

    def only_push(built: Assembly) -> None:
        built.simulators[0].axes[0].physics.v = 0.1

    start = 0.5 * 0.5 * 0.1**2
    sound = run_rig(quiet, change=only_push)
    assert not fails(sound)
    assert sound["plant.master.a.kinetic"].max() <= 1.1 * start  # the tank lends some
    monkeypatch.setattr(port, "port_effort", naive_effort)
    monkeypatch.setattr(port, "port_close", naive_close)
    naive = run_rig(quiet, change=push, raises=False)
    assert isinstance(naive.result.error, SafetyStop)
    assert naive["plant.master.a.kinetic"].max() > 2.0 * start
