"""Facts that joints have alike are one line; what differs keeps its name."""

from __future__ import annotations

from tautwave.cli.terminal.alike import folded_alike


def test_numbers_span_what_joints_have_alike() -> None:
    facts = [
        ("rate", "1000 Hz"),
        *((f"j{n}.pole_slave auto", f"0.{n}, the first for slave.j{n}") for n in (1, 2, 3)),
        ("j9.pole_slave auto", "plain, because slave.j9 has none"),
        ("hint on slave.j1", "leaves 4 N m"),
        ("hint on slave.j2", "leaves -2.5e-3 N m"),
        ("hint on slave.j3", "leaves 4.0 N m"),
        ("hint on claims", "a stall gives 19 times"),
    ]
    assert folded_alike(facts) == [
        ("rate", "1000 Hz"),
        ("pole_slave auto", "0.1 to 0.3, the first for slave (3 alike)"),
        ("j9.pole_slave auto", "plain, because slave.j9 has none"),
        ("hints on slave", "leaves -2.5e-3 to 4 N m (3 alike)"),
        ("hint on claims", "a stall gives 19 times"),
    ]


def test_one_or_two_are_left_as_they_are() -> None:
    facts = [(f"offset of j{n}", f"{n} rad per N m") for n in (1, 2)]
    assert folded_alike(facts) == facts


def test_each_joint_keeps_its_load() -> None:
    facts = [
        (f"load of slave.j{n}", f"joint k{n}, up to {n} N m; carried, else {n} rad apart")
        for n in (1, 2, 3)
    ]
    assert folded_alike(facts) == [
        ("load of slave.j1", "joint k1, up to 1 N m"),
        ("loads of slave", "carried, else 1 to 3 rad apart (3 alike)"),
        ("load of slave.j2", "joint k2, up to 2 N m"),
        ("load of slave.j3", "joint k3, up to 3 N m"),
    ]
