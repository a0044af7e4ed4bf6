"""Recorded networks: read with the line that is wrong, and replayed by time."""

from __future__ import annotations

import pytest

from tautwave.errors import ConfigError
from tautwave.link.trace import parse_trace, replayed
from tautwave.models.network import LOST

GOOD = "time_s,delay_s,lost\n0.5,0.010,0\n0.501,0,1\n0.503,0.030,0\n"
MS = 1_000_000


def test_a_trace_is_read() -> None:
    table = parse_trace(GOOD, "t.csv")
    assert table == [500 * MS, 10 * MS, 501 * MS, LOST, 503 * MS, 30 * MS]


def test_each_packet_gets_what_the_trace_has_at_its_time_and_then_again() -> None:
    table = [7.0, *parse_trace(GOOD, "t.csv")]
    whole = 5 * MS  # from 500 to 503, and the last lasts two as the one before
    for round_ in (0, 1, 7):
        for at, delay in ((0.0, 10), (0.9, 10), (1.0, None), (2.9, None), (3.0, 30), (4.9, 30)):
            now = round_ * whole + round(at * MS)
            expected = LOST if delay is None else now + delay * MS
            assert replayed(table, 1, 3, now) == expected


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "t.csv: the first line of a trace is time_s,delay_s,lost"),
        ("time,delay\n", "t.csv: the first line"),
        (GOOD + "0.6,0.1\n", "t.csv:5: a line has three numbers"),
        (GOOD + "0.6,x,0\n", "t.csv:5: a line has three numbers"),
        (GOOD + "0.6,-0.1,0\n", "t.csv:5: a time is 9e+06 s at most, a delay 0 to 60 s"),
        (GOOD + "0.6,nan,0\n", "t.csv:5: a time is"),
        (GOOD + "inf,0.1,0\n", "t.csv:5: a time is"),
        (GOOD + "nan,0.1,0\n", "t.csv:5: a time is"),
        (GOOD + "1e300,0.1,0\n", "t.csv:5: a time is"),
        (GOOD + "0.6,0.1,2\n", "a delay 0 to 60 s, and lost 0 or 1 (got 0.6,0.1,2)"),
        (GOOD + "0.503,0.1,0\n", "t.csv:5: times must increase"),
        ("time_s,delay_s,lost\n0,0,0\n", "t.csv: a trace needs at least two packets"),
    ],
)
def test_what_is_wrong_is_said_with_its_line(text: str, said: str) -> None:
    with pytest.raises(ConfigError) as caught:
        parse_trace(text, "t.csv")
    assert said in str(caught.value)
