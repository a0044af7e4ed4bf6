"""What a coupling gives the controller: its steps, as functions that it gets as arguments."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence, Set
from dataclasses import dataclass
from typing import Any, NamedTuple

from tautwave.columns import Column
from tautwave.contracts import Row
from tautwave.controller.records import AxisParams, AxisState, PairParams, PairView
from tautwave.controller.wrapping import bound

OWN_GUARDS = 100
"""First guard code that a coupling may give away itself."""


@dataclass(slots=True)
class NoState:
    """State of a coupling that has none; compiled records need a field."""

    nothing: int = 0


class NoParams(NamedTuple):
    """Constants of a coupling that has none."""

    nothing: int = 0


def no_start(pair: PairView, gap: float) -> None:
    """Reset nothing."""


def no_engage(pair: PairView) -> None:
    """Prepare nothing: no value is on its way."""


def ignore_acted(s: AxisState, p: AxisParams, tag: float) -> None:
    """Book nothing for a command that acted."""


def no_close(
    s: AxisState, p: AxisParams, displacement: float, count: float, span: float, port: float
) -> None:
    """Book nothing for a sample."""


def ignore_missing(s: AxisState, p: AxisParams) -> None:
    """Do nothing for a missing sample."""


def no_exchange(pair: PairView, here: bool, due_one: bool, due_two: bool) -> None:
    """Pass nothing between the sides."""


def no_effort(s: AxisState, p: AxisParams, free_velocity: float) -> float:
    """Ask for no effort."""
    return 0.0


def no_velocity(
    s: AxisState,
    p: AxisParams,
    pending: float,
    wall_push: float,
    wall_stiffness: float,
    wall_damping: float,
) -> float:
    """Ask for no velocity."""
    return 0.0


def no_brake(s: AxisState, p: AxisParams, effort: float) -> float:
    """Let all of a stop's damping act."""
    return effort


def fill_no_signals(out: Row, at: int, s: AxisState, p: AxisParams) -> int:
    """Write no columns of an axis."""
    return at


def no_value(s: AxisState, p: AxisParams) -> float:
    """Return 0 where a law has no value to give."""
    return 0.0


law_value = law_next = no_value
law_first = law_rest = fill_no_signals


def fill_one(out: Row, at: int, s: AxisState, p: AxisParams) -> int:
    """Write one column of an axis: `law_value`."""
    out[at] = law_value(s, p)
    return at + 1


def fill_two(out: Row, at: int, s: AxisState, p: AxisParams) -> int:
    """Write two: `law_value` and `law_next`."""
    out[at] = law_value(s, p)
    out[at + 1] = law_next(s, p)
    return at + 2


def fill_more(out: Row, at: int, s: AxisState, p: AxisParams) -> int:
    """Write those of `law_first`, then those of `law_rest`."""
    at = law_first(out, at, s, p)
    return law_rest(out, at, s, p)


def fill_each(columns: Sequence[Column]) -> Callable[..., int]:
    """Return what writes columns of an axis in their order, each by its `value(s, p)`.

    Compiled code calls no function from a list, so it is made of functions of one and two columns;
    two at once, since plain Python pays for each call.
    """
    values = [column.value for column in columns]
    if not values:
        return fill_no_signals
    if len(values) == 1:
        return bound(fill_one, {"law_value": values[0]})
    two = bound(fill_two, {"law_value": values[0], "law_next": values[1]})
    if len(values) == 2:
        return two
    return bound(fill_more, {"law_first": two, "law_rest": fill_each(columns[2:])})


def fill_no_elements(out: Row, at: int, pair: PairView) -> int:
    """Write no columns of a pair."""
    return at


def no_elements(q: PairParams, p1: AxisParams, p2: AxisParams) -> Sequence[str]:
    """Return no names."""
    return ()


class Steps(NamedTuple):
    """The steps of a coupling; all but the last two lines run compiled as well.

    The functions work on the state of the axes, whose `end` is the coupling's own record, and on
    that of the pair, whose `link` is; their constants are `p.end` and `q.link`. What they may write
    is that and `tag` and `alarm` of an axis. `start`, `engage`, `exchange` and `fill_elements` get
    the whole pair as one `PairView`.

    `start`: reset all state, the pair begins where it stands; `gap` [rad or m] is how far the
    slave is from where it should be. `engage`: called just before the first command. `on_acted`: a
    command acted for one slot; `tag` is the number that the end had put beside it. `close`: a
    sample came, `displacement` [rad or m] in `count` periods, `span` [s], under the mean resisting
    effort `port` [N m or N]. `on_missing`: none came. `exchange`: advance by one slot what passes
    between the sides; not `here`: a slot that the loop skipped; `due`: this side was read in it.
    `compute_effort`: return the resisting effort for the next period [N m or N], where
    `free_velocity` is its mean velocity without it [rad/s or m/s]. `move`: return the velocity of
    an admittance axis, see `laws.servo.admittance`. `brake`: return what may act of the effort that
    a stop asks for [N m or N]; without a sample nothing of it acts.

    `fill_signals` and `fill_elements` write columns and return the next index: those of an axis,
    which `fill_each` makes of their declarations, and three for each element of a pair.
    """

    start: Callable[..., None] = no_start
    engage: Callable[..., None] = no_engage
    on_acted: Callable[..., None] = ignore_acted
    close: Callable[..., None] = no_close
    on_missing: Callable[..., None] = ignore_missing
    exchange: Callable[..., None] = no_exchange
    compute_effort: Callable[..., float] = no_effort
    move: Callable[..., float] = no_velocity
    brake: Callable[..., float] = no_brake
    fill_signals: Callable[..., int] = fill_no_signals
    fill_elements: Callable[..., int] = fill_no_elements


class Guard(NamedTuple):
    """A coupling's reason to stop: a word for programs, and the rest of a sentence.

    Such as `port_overdrawn` and `drew more energy than its port had`, before the time; `detail`
    comes after it. Both may name the axis' `found` and `allowed`, and `effort`, the unit of one.
    """

    word: str
    sentence: str
    detail: str = ""


class Holding(NamedTuple):
    """What a law holds of its own at an end, for an account to cover and keep there.

    `cover(s, p, funds)`: change what is held, of which there may be at most the funds [J];
    `held(s)`: what that is [J]. The effort's change with the newest sample [N m/rad or N/m] is at
    most `gain(end, tracker's gain, period)`. The master's is booked.
    Were all of it covered, the effort would be `whole(s, p, effort)` [N m or N], now `effort`.
    """

    cover: Callable[..., None]
    held: Callable[..., float]
    gain: Callable[[Any, float, float], float]
    whole: Callable[..., float]


class Rescaling(NamedTuple):
    """How running ends of a law change to the constants of another scale, those of both sides.

    `ratio` [1] is the device's energy per energy of the pair, the new over the old. `hindrance(s,
    p, new end's constants, ratio)`: why it cannot now, as a clause, or ''. `keep(old constants,
    new)`: the new ones with what was tuned. `carry(s, p, ratio, table)`: change the state; what it
    gives up is booked as dissipated, and the device's books are then in the new scale's energy.
    """

    hindrance: Callable[..., str]
    keep: Callable[[Any, Any], Any]
    carry: Callable[..., None]


class Law(NamedTuple):
    """A coupling as the controller runs it: its steps, its state, its columns.

    `end` and `link` make the state of an axis' end and of a pair: slotted dataclasses of numbers
    with defaults. `signals` are the columns of an axis, as they are written; `elements(q, p1, p2)`
    names a pair's elements, and `accounts` says what each is, SIDE for master or slave in its name.
    `guards` are by the code that a step leaves in `alarm`, from `OWN_GUARDS` on.
    `rings`: places of the delay line in the table per slot of delay. `spring`: of a law that
    `controller.seen` makes, its stiffness for the books, and what a side shows for position and
    velocity; None for any other. `holding`: of a law that renders something by itself. `rescaling`:
    of one whose scale may change while it runs. `alike`: its ends are those of one spring, and what
    they send is clipped at one constant.
    """

    name: str = ""
    steps: Steps = Steps()
    end: Callable[[], Any] = NoState
    link: Callable[[], Any] = NoState
    signals: Sequence[Column] = ()
    elements: Callable[[PairParams, AxisParams, AxisParams], Sequence[str]] = no_elements
    accounts: Mapping[str, str] = {}
    guards: dict[int, Guard] = {}  # noqa: RUF012
    rings: int = 4
    spring: Callable[[PairParams, AxisParams, AxisParams], float] | None = None
    shown: Callable[[AxisState], tuple[float, float]] | None = None
    holding: Holding | None = None
    rescaling: Rescaling | None = None
    alike: bool = False


class SiteLaw(NamedTuple):
    """A law at one of two sites that a network joins.

    `law` passes waves of the own end only. `patient(constants)` are those of a link that never
    gives up by itself; `ends(link)` are its master's and its slave's; `begin(link)`: the next
    start is that of a new session. `take(end, constants, table, slot, line)`: a line of a packet
    came; `said(constants of the other end, table)` returns the last slot and its line; `owed(end,
    constants, table, axis, its constants)` the motion that was not given out, or not sent, yet
    [rad or m, master]. `debts`: guards that end a session which has known a silence, and not the
    run.
    """

    law: Law
    patient: Callable[..., Any]
    ends: Callable[..., tuple[Any, Any]]
    begin: Callable[..., None]
    take: Callable[..., None]
    said: Callable[..., Any]
    owed: Callable[..., float]
    debts: Set[int]


ALONE = Law()
"""An axis that no coupling holds: that of a scene."""
