"""The last step of a calibration: each axis is excited, and what could be measured is kept."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from tautwave.config import Rig
from tautwave.errors import DriverError, RecordingError, SafetyStop
from tautwave.rig.rates import at_axis_rate, at_full_rate
from tautwave.runtime.unwatched import MayBeEnabledError
from tautwave.session.guided.running import Conversation, Ways
from tautwave.session.identification.identifying import (
    DeviceResult,
    beliefs,
    identify_together,
)

TRIES = ((0.3, 1.0), (0.6, 2.0), (1.0, 4.0))
"""Share of the effort limit with which an axis is shaken, and for how many times the time that was
asked for: more where friction holds it for most of the time."""
RETRIES = 2
"""After a gap in the samples, a fault or a stop; then an axis is left out."""

Believed = Mapping[str, Mapping[str, Any]]


class Shaking(NamedTuple):
    """How axes are excited: for how long [s], where recordings go, on which devices."""

    seconds: float
    out: Path
    ways: Ways
    progress: Callable[[float, str], None] | None


def rounds(rig: Rig, names: Sequence[str]) -> list[list[str]]:
    """Return which axes are excited together: a master and its slave, which are two machines.

    Joints of one machine move each other, and one of a slow bus needs a loop of its own.
    """
    together: dict[str, list[str]] = {}
    for name in names:
        slow = rig.axis_divisor(name) > 1
        together.setdefault(name if slow else name.partition(".")[2], []).append(name)
    if any(bus.divisor > 1 for bus in rig.buses.values()):
        return [[name] for name in names]
    return list(together.values())


def identify_axes(
    rig: Rig,
    names: Sequence[str],
    talk: Conversation,
    how: Shaking,
    keep: Callable[[str, Believed], None],
) -> dict[str, str]:
    """Measure inertia and friction of axes; `keep` takes those of each at once.

    A gap in the samples or a stop is tried again, then with each axis alone, then left out.

    Returns
    -------
    dict of str to str
        Why axes were left out.

    Raises
    ------
    MayBeEnabledError
        A device may still be on: nothing else is tried.
    """
    failed: dict[str, str] = {}
    counter = _Folders(how.out)
    for group in rounds(rig, names):
        for name, result in _measured(rig, group, talk, how, counter):
            if isinstance(result, str):
                failed[name] = result
                talk.say(f"  {name}: left out: {result}")
                continue
            believed = beliefs(result.fit)
            keep(name, believed)
            numbers = ", ".join(f"{key} {one['value']:.3g}" for key, one in believed.items())
            talk.say(f"  {name}: {numbers}; explains {result.fit.explained:.0%}")
    return failed


class _Folders:
    """A fresh folder for each excitation."""

    def __init__(self, out: Path) -> None:
        self._out, self._made = out, set[str]()

    def of(self, names: Sequence[str], share: float) -> Path:
        stem = f"identify-{'-'.join(names)}-{share:g}"
        name = next(one for one in _numbered(stem) if one not in self._made)
        self._made.add(name)
        return self._out / name


def _numbered(stem: str) -> Iterator[str]:
    yield stem
    count = 2
    while True:
        yield f"{stem}-{count}"
        count += 1


def _measured(
    rig: Rig, names: Sequence[str], talk: Conversation, how: Shaking, folders: _Folders
) -> Iterator[tuple[str, DeviceResult | str]]:
    """Identify axes with as little effort and time as suffices; yield each, or why not."""
    pending = list(names)
    for number, (share, longer) in enumerate(TRIES):
        last = number == len(TRIES) - 1
        try:
            results = _retried(rig, pending, share, longer, talk, how, folders)
        except (DriverError, SafetyStop) as err:
            if isinstance(err, MayBeEnabledError):
                raise
            if len(pending) == 1:
                yield pending[0], str(err)
                return
            talk.say("  each of them alone")
            for name in pending:
                yield from _measured(rig, [name], talk, how, folders)
            return
        for name, result in results.items():
            if isinstance(result, RecordingError):
                if last:
                    yield (
                        name,
                        (
                            "cannot be identified even at its full effort limit; free it, or raise "
                            f"effort_limit: {result.__cause__ or result}"
                        ),
                    )
                    continue
                talk.say(
                    f"  {name}: {share:.0%} of its effort limit does not move it enough; increasing"
                )
            elif last or result.fit.damping.lower > 0.0:
                pending.remove(name)
                yield name, result
            else:
                talk.say(
                    f"  {name}: its damping cannot be distinguished from its friction yet; "
                    "exciting longer"
                )
        if not pending:
            return


def _retried(
    rig: Rig,
    names: Sequence[str],
    share: float,
    longer: float,
    talk: Conversation,
    how: Shaking,
    folders: _Folders,
) -> dict[str, DeviceResult | RecordingError]:
    """Excite axes; once more after a gap, a fault or a stop, and then once more."""
    first = names[0]
    if any(bus.divisor > 1 for bus in rig.buses.values()):
        rig = at_full_rate(at_axis_rate(rig, first))
    for left in reversed(range(RETRIES + 1)):
        try:
            return identify_together(
                rig,
                names,
                out=folders.of(names, share),
                clock=how.ways.clock,
                duration_s=longer * how.seconds,
                share=share,
                allow_unwatched=how.ways.allow_unwatched,
                simulate=how.ways.simulate,
                attach=how.ways.attach,
                progress=how.progress,
            )
        except (DriverError, SafetyStop) as err:
            if isinstance(err, MayBeEnabledError) or not left:
                raise
            talk.say(f"  {', '.join(names)}: {err}; trying again")
    raise AssertionError
