"""What happens on a simulated line: in the order of its times, up to and with the time reached."""

from __future__ import annotations

from tautwave_sim.wire.schedule import Schedule


def test_everything_due_happens_in_order_with_what_it_adds() -> None:
    line = Schedule()
    seen: list[tuple[str, int]] = []

    def note(name: str) -> None:
        seen.append((name, line._now_ns))

    def again() -> None:
        note("again")
        line.call_at(30, lambda: note("added, due at once"))
        line.call_at(5, lambda: note("added, late"))

    assert line.next_event_ns() is None
    line.call_at(50, lambda: note("later"))
    line.call_at(30, again)
    line.call_at(10, lambda: note("one"))
    line.call_at(10, lambda: note("two"))
    line.advance(9)
    assert seen == []
    line.advance(10)  # what is due at the very time happens
    assert seen == [("one", 10), ("two", 10)]
    assert line.next_event_ns() == 30
    line.advance(30)
    assert seen[2:] == [("again", 30), ("added, late", 30), ("added, due at once", 30)]
    line.advance(20)  # time never goes back
    assert line._now_ns == 30
    line.advance(50)
    assert seen[5:] == [("later", 50)]
    assert line.next_event_ns() is None
