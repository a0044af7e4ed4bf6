"""What one drive is asked in one exchange: questions in a row, and what came back."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tautwave.contracts import BytePort
    from tautwave_drivers.modbus.frames import Question

Opener = Callable[[], "BytePort"]
"""Opens a line or begins to connect; raises `DriverError` where that fails at once."""


class Errand:
    """Questions for one drive; each is asked once the one before is answered.

    Attributes
    ----------
    answers : list of bytes
        One PDU per question answered so far; a refused one is an exception response.
    under_way : bool
        It has not ended yet: neither answered whole nor given up.
    asked_ns : list of int
        When each question went out.
    """

    __slots__ = ("answers", "asked_ns", "came_ns", "questions", "under_way", "unit")

    def __init__(self, unit: int) -> None:
        self.unit = unit
        self.questions: Sequence[Question] = ()
        self.answers: list[bytes] = []
        self.asked_ns: list[int] = []
        self.came_ns = 0
        self.under_way = False

    def begin(self, questions: Sequence[Question]) -> None:
        """Start over with these."""
        self.questions = questions
        self.answers = []
        self.asked_ns = []
        self.under_way = bool(questions)

    @property
    def question(self) -> Question:
        """What is to be asked, or is waited for."""
        return self.questions[len(self.answers)]

    @property
    def whole(self) -> bool:
        """Whether every question was answered."""
        return len(self.answers) == len(self.questions)

    def take(self, pdu: bytes, now_ns: int) -> None:
        """Take the answer to the question."""
        self.answers.append(pdu)
        self.came_ns = now_ns
        if len(self.answers) == len(self.questions):
            self.under_way = False

    def give_up(self) -> None:
        """End it without an answer."""
        self.under_way = False
