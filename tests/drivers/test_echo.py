"""An adapter's echo that a disturbance changes: never an answer, and over with the next write."""

from __future__ import annotations

import pytest

from tautwave_drivers.echo import Unechoed

PING = bytes.fromhex("ffff010201fb")
"""Of protocol 1.0 to servo 1; the answer has a status of 0 instead of the instruction 1."""
ANSWER = bytes.fromhex("ffff010200fc")


class Line:
    """A port that returns what the test put there."""

    def __init__(self) -> None:
        self.incoming = b""

    def write(self, data: bytes) -> None:
        pass

    def read(self) -> bytes:
        data, self.incoming = self.incoming, b""
        return data

    def close(self) -> None:
        pass


def disturbed() -> list[bytes]:
    """Return echoes of which a byte is another, lost, or one too many, at every place."""
    flipped = [PING[:i] + bytes([PING[i] ^ 0x10]) + PING[i + 1 :] for i in range(len(PING))]
    lost = [PING[:i] + PING[i + 1 :] for i in range(len(PING))]
    more = [PING[:i] + b"\x55" + PING[i:] for i in range(len(PING) + 1)]
    return [*flipped, *lost, *more, b"", PING[:3]]


@pytest.mark.parametrize("echo", disturbed(), ids=bytes.hex)
@pytest.mark.parametrize("pieces", [1, 2, 3])
def test_a_disturbed_echo_is_no_answer_and_costs_one_exchange(echo: bytes, pieces: int) -> None:
    line = Line()
    port = Unechoed(line)
    port.echoes = True
    port.write(PING)
    heard = b""
    whole = echo + ANSWER
    size = -(-len(whole) // pieces)
    for at in range(0, len(whole), size):
        line.incoming = whole[at : at + size]
        heard += port.read()
    assert PING not in heard
    assert PING[1:] not in heard  # nor with a header that noise completes
    for _ in range(2):
        port.write(PING)
        line.incoming = PING + ANSWER
        assert port.read() == ANSWER


def test_an_echo_in_pieces_and_two_writes_are_taken_out() -> None:
    line = Line()
    port = Unechoed(line)
    port.echoes = True
    port.write(PING)
    port.write(PING[:4])
    line.incoming = PING[:5]
    assert port.read() == b""
    line.incoming = PING[5:] + PING[:4] + ANSWER
    assert port.read() == ANSWER
