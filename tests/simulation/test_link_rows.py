"""A pair over a network: live, in Python and compiled, row by row to the bit; with real packets."""

from __future__ import annotations

from pathlib import Path

import pytest

from tautwave.config import load_rig
from tautwave.link import packet
from tests.rigs.running import Tree, rig_of, tree
from tests.simulation.live import assert_equal, assert_same, live_run
from tests.simulation.test_live_engine import assert_alike

pytest.importorskip("numba")

BAD: Tree = {
    "link": {
        "delay_s": 0.003,
        "jitter_s": 0.004,
        "loss": 0.2,
        "burst": 3,
        "duplicate": 0.1,
        "outage_at_s": 0.1,
        "outage_s": 0.05,
        "depth_s": 0.004,
        "silence_s": 0.02,
        "lost_s": 0.2,
    },
    "duration_s": 0.4,
    "simulation.hand.a": {
        "reference": {"type": "minimum_jerk", "waypoints": [[0.02, 0.0], [0.2, 0.1]]}
    },
}
KINDS: dict[str, Tree] = {
    "fixed depth": {},
    "auto depth": {"link.depth_s": "auto", "link.deepest_s": 0.02},
    "newest": {"link.play_out": "newest"},
    "a slow slave": {"buses.arm.divisor": 4},
    "both slow": {"buses.arm.divisor": 3, "buses.hand.divisor": 2},
    "scaled and mirrored": {
        "coupling.pairs.a": {
            "wave_impedance": 10.0,
            "position_scale": 2.0,
            "force_scale": 3.0,
            "sign": -1,
            "wall_slave": {"position": 0.1, "stiffness": 50.0, "side": "above"},
        },
        "slave.axes.a.damping": 2.0,
        "master.axes.a.damping": 2.0,
    },
    "a slave that takes velocity": {
        "slave.axes.a": {
            "bus": "arm",
            "id": 1,
            "kind": "linear",
            "causality": "admittance",
            "effort_limit": 100.0,
            "velocity_limit": 20.0,
            "environment_stiffness_upper": 500.0,
        },
        "simulation.environment.a": {"type": "spring", "stiffness": 300.0, "position": 0.0},
    },
    "missing and skipped": {
        "simulation.faults": {
            "missing_probability": 0.05,
            "overrun_probability": 0.02,
            "overrun_slots": 3,
        }
    },
    "lost": {"link.outage_s": 1.0, "link.lost_s": 0.05},
}


@pytest.mark.sparse(3)
@pytest.mark.parametrize("kind", KINDS)
def test_python_and_live_are_equal(kind: str) -> None:
    live = assert_equal(rig_of(tree(BAD, KINDS[kind])), "python")
    assert len(live.table) > 50
    assert live["slave.a.link_lost"][-1] > 0.0
    if kind == "lost":
        assert "lost the other side" in str(live.result.error)


@pytest.mark.slow
@pytest.mark.nightly
@pytest.mark.timeout(900)  # numba compiles for half a minute, and shares the processor
@pytest.mark.parametrize("kind", KINDS)
def test_compiled_is_equal(kind: str) -> None:
    rig = rig_of(tree(BAD, KINDS[kind]))
    assert_equal(rig, "compiled")
    assert_alike(rig, 0.4)


def test_what_arrives_has_been_a_packet(monkeypatch: pytest.MonkeyPatch) -> None:
    """A codec that loses the lowest bit of a counter changes the rows."""
    rig = rig_of(tree(BAD))
    honest = live_run(rig)
    write = packet.write_packet

    def careless(given: packet.Packet) -> bytes:
        data = bytearray(write(given))
        data[packet.HEADER.size + 3 * 8 - 1] &= 0xFE
        return bytes(data)

    monkeypatch.setattr("tautwave.runtime.wire.write_packet", careless)
    spoilt = live_run(rig)
    assert (spoilt.table[:, 4:] != honest.table[:, 4:]).any()


def test_a_seed_of_its_own() -> None:
    rig, same, other = (
        rig_of(tree(BAD, {"seed": seed, "link.seed": own}))
        for seed, own in ((1, 5), (2, 5), (1, 6))
    )
    rows = [live_run(one) for one in (rig, same, other)]
    lost = [run["slave.a.link_lost"].tolist() for run in rows]
    assert lost[0] == lost[1] != lost[2]


def test_a_recorded_network(tmp_path: Path) -> None:
    trace = tmp_path / "path.csv"
    trace.write_text("time_s,delay_s,lost\n0,0.002,0\n0.01,0.02,0\n0.02,0,1\n0.03,0.002,0\n")
    data = tree(BAD, {"link": {"trace": str(trace), "depth_s": 0.02}})
    rig = rig_of(data)
    live = live_run(rig)
    from tautwave.simulation import simulate

    assert_same(live, simulate(rig, engine="python"))
    assert live["slave.a.link_lost"][-1] == pytest.approx(0.25 * 400, abs=12)
    assert live["slave.a.link_delay"][300:].max() <= 0.025


def test_the_shipped_rig_is_loaded() -> None:
    rig = load_rig(Path(__file__).parents[2] / "configs" / "network-loopback.yaml")
    assert rig.link is not None
    assert rig.link.loss == 0.3
