"""Real masters that a policy leads: each by its own motor, until a person takes over.

The hand is an effort beside the coupling's, as a load's is. The coupling sees one device that
moves on from where it is, whoever leads it: nothing jumps, and nothing is switched but the grip.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

from tautwave.columns import Column, names, under
from tautwave.contracts import Driver, Row
from tautwave.controller.records import AxisParams, AxisState
from tautwave.laws.lead import HandParams, LeadParams, hand_effort, hand_room
from tautwave.laws.rest.alignment import is_spent
from tautwave.runtime.operate.commands import TAKE_OVER
from tautwave.runtime.operate.lead import Lead, Leads
from tautwave.types import SAFE_COMMAND, AxisCommand
from tautwave.wrapper import DriverWrapper

PERSON, POLICY = "person", "policy"

INTERVENTION = Column(
    "operation.intervention",
    "0, 1",
    "with `operate.policy`: whether a person leads instead of the policy",
)
OF_POLICY = (
    Column("reference", "rad, m", "where the policy leads the master to"),
    Column("effort", "N m, N", "of the hand that the master's own motor plays"),
    Column(
        "given",
        "J",
        "energy that this hand gave beyond what its reference brought; negative: it took",
    ),
)
"""What is recorded of a master that is led: `policy.PAIR.name`."""


class LedAxis(NamedTuple):
    """One master that is led: the pair's name, the axis' place among all, and its constants.

    The limit of speed rises with `acceleration` [rad/s2 or m/s2] from 0 when the policy begins to
    lead: its actions may be far from where the master is. `delay` is the command's, in whole
    periods, and `late` the remainder as a share of one; `period` [s] is one slot. `fastest` is the
    device's greatest speed [rad/s or m/s]: how it went between two samples is not seen.
    """

    pair: str
    which: int
    lead: LeadParams
    hand: HandParams
    acceleration: float
    delay: int
    late: float
    period: float
    fastest: float


class MotorHand(Lead):
    """The hand that one master's motor plays, and its books.

    Attributes
    ----------
    effort : float
        On the device in the present period, along its position [N m or N].
    given : float
        Given to the device beyond what the reference has brought, so far [J].
    """

    def __init__(self, axis: LedAxis) -> None:
        super().__init__(axis.lead, 0.0, axis.period)
        self.axis = axis
        self.effort = 0.0
        self.given = 0.0
        self._since = 0.0  # `given` when this engagement began
        self._grip = 0.0
        self._rate = 0.0
        self._loose = 0  # periods since the grip was gone
        self._leads = False
        self._waiting = deque([0.0] * axis.delay)
        self._acted = 0.0
        self._acts: list[float] = []  # by slot since the last sample
        self._seen: tuple[float, float] | None = None
        self._armed = False
        self._beside = 0.0  # the controller's own effort in the period before

    @property
    def reference(self) -> float:
        """Reference [rad or m]."""
        return self._reference

    @property
    def stale(self) -> bool:
        """Whether it leads, and actions have stopped coming or its allowance is spent."""
        p = self.axis.hand
        spent = is_spent(p.law, self.given - self._since, p.allowance)
        return self._leads and (super().stale or spent)

    def want(self, position: float) -> None:
        """Take an action [rad or m]; it is ignored while a person leads, or nobody does."""
        if self._leads:
            super().want(position)

    def begin(self) -> None:
        """Begin another engagement, with the allowance of one."""
        self._since = self.given

    def decide(self, s: AxisState, p: AxisParams, skipped: int, *, leads: bool) -> None:
        """Book what acted until this slot, and decide the effort of the next period."""
        self._close(s, skipped + 1)
        if leads and not self._leads:  # it takes hold where the device is, so without strain
            self._reference = self._goal = s.position
            self._age, self._left, self._grip = None, 0.0, 1.0
            self._params = self.axis.lead._replace(velocity=0.0)
        self._leads = leads
        if leads:
            if self._age is not None:
                self._quicken(skipped + 1)
            _, self._rate = self.aim(s.position)
            self._loose = 0
        else:
            self._let_go(s)
        if s.dead:
            self.effort = 0.0
        elif s.valid:
            hand = self.axis.hand
            bound = max(p.site.limit.effort, abs(s.command))
            self.effort = hand_effort(
                hand,
                self._grip,
                self._reference,
                self._rate,
                s.position,
                s.velocity,
                self.given - self._since,
                hand_room(hand, bound, s.command, self._beside, self.effort),
            )
        self._beside = s.command
        self._armed = True

    def _let_go(self, s: AxisState) -> None:
        """Lower the grip and come to rest with it; without a grip, be where the device is.

        It goes there at a sample, which has booked what acted before: else the way there would
        count as brought by efforts that were over.
        """
        release = self.axis.hand.release
        if self._grip > release:
            self._rate *= 1.0 - release / self._grip
            self._grip -= release
            self._reference += self._rate * self._period
        else:
            self._grip = self._rate = 0.0
        self._loose = 0 if self._grip or self.effort else self._loose + 1
        if s.valid and self._loose > self.axis.delay + 1:
            self._reference = s.position

    def _quicken(self, slots: int) -> None:
        """Raise the reference's speed limit, up to its own."""
        lead, now = self.axis.lead, self._params.velocity
        if now < lead.velocity:
            now += self.axis.acceleration * slots * self._period
            self._params = lead._replace(velocity=min(now, lead.velocity))

    def send(self) -> float:
        """Return the effort to send in this slot; each decided effort is sent once."""
        armed, self._armed = self._armed, False
        return self.effort if armed else 0.0

    def rest(self) -> None:
        """Note that nothing is sent to the device: it gets its safe command."""
        self.effort = 0.0
        self._armed = False

    def _close(self, s: AxisState, slots: int) -> None:
        """Take the energy of the periods since the last sample from effort and displacement.

        Of more than one, only the whole way is known. The effort's mean does the work of that; by
        going to and fro meanwhile a device takes at most its greatest way in a period, times how
        far each period's effort is off the mean. That is counted as given.
        """
        late = self.axis.late
        for _ in range(slots):
            effort = self.effort
            if self._waiting:
                self._waiting.append(effort)
                effort = self._waiting.popleft()
            self._acts.append(late * self._acted + (1.0 - late) * effort)
            self._acted = effort
        if not s.valid:
            return
        if self._seen is not None:
            moved, brought = s.position - self._seen[0], self._reference - self._seen[1]
            mean = sum(self._acts) / len(self._acts)
            off = sum(abs(act - mean) for act in self._acts)
            self.given += mean * (moved - brought) + off * self.axis.fastest * self._period
        self._seen = s.position, self._reference
        self._acts.clear()


class LedMasters(Leads):
    """All masters of a rig that a policy leads, and who does; a row source.

    As a dead-man, it is let go when actions stop coming while the policy leads.

    Parameters
    ----------
    axes : sequence of LedAxis
        The masters.
    leader : str
        Who leads first: `policy` or `person`.
    """

    def __init__(self, axes: Sequence[LedAxis], leader: str) -> None:
        self.hands = [MotorHand(axis) for axis in axes]
        super().__init__({hand.axis.pair: hand for hand in self.hands})
        self._person = leader == PERSON
        self._coupled = False
        self.columns = [INTERVENTION.name]
        for axis in axes:
            self.columns += names(under(f"policy.{axis.pair}", OF_POLICY))

    def held(self) -> bool:
        """Return whether a person leads, or every hand that was led still is."""
        return self._person or super().held()

    def switch(self, word: str) -> str:
        """Hand the lead to the person or to the policy; return why not, or ''."""
        person = word == TAKE_OVER
        if person == self._person:
            return leads_already(word)
        self._person = person
        return ""

    def decide(
        self,
        axes: Sequence[AxisState],
        params: Sequence[AxisParams],
        skipped: int,
        *,
        engaged: bool,
    ) -> None:
        """Decide the efforts of the next period; a policy leads only an `engaged` rig."""
        for hand in self.hands:
            if engaged and not self._coupled:
                hand.begin()
            which = hand.axis.which
            leads = engaged and not self._person
            hand.decide(axes[which], params[which], skipped, leads=leads)
        self._coupled = engaged

    def fill(self, row: Row, at: int) -> None:
        """Write who leads; by master where it is led to, the effort, and what was given."""
        row[at] = float(self._person)
        at += 1
        for hand in self.hands:
            row[at] = hand.reference
            row[at + 1] = hand.effort
            row[at + 2] = hand.given
            at += 3


def leads_already(word: str) -> str:
    """Return why `take_over` or `hand_back` is refused where it changes nothing."""
    return f"{word}: the {PERSON if word == TAKE_OVER else POLICY} leads already"


def switched(led: LedMasters | None, word: str) -> str:
    """Do what `take_over` or `hand_back` asks for; return why not, or ''."""
    if led is None:
        return f"{word}: no policy leads this rig's master; add `operate.policy` to the rig"
    return led.switch(word)


class LedDriver(DriverWrapper):
    """A driver whose axes are led: the hands' efforts go beside the controller's.

    Parameters
    ----------
    driver : Driver
        The driver.
    hands : sequence
        Per axis of the driver its hand, None without one.
    """

    def __init__(self, driver: Driver, hands: Sequence[MotorHand | None]) -> None:
        super().__init__(driver)
        self._hands = hands

    def write(self, commands: Sequence[AxisCommand]) -> None:
        """Add the hands to the commands; a safe command stays what it is."""
        sent = []
        for command, hand in zip(commands, self._hands, strict=True):
            if hand is None:
                sent.append(command)
            elif command is SAFE_COMMAND:
                hand.rest()
                sent.append(command)
            else:
                effort = command.effort + hand.send()
                sent.append(
                    AxisCommand(effort, command.velocity, command.position, command.damping)
                )
        self._driver.write(sent)
