"""Run the stages of an acceptance in rising risk; one that is not good is asked for again."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from tautwave.config import Rig, load_rig, resolved_yaml
from tautwave.errors import ConfigError, DriverError, SafetyStop
from tautwave.files import make_directory, write_text
from tautwave.rig import bus_ways, real_buses
from tautwave.rig.arms import shared_limits
from tautwave.rig.ways import Way
from tautwave.runtime.interrupts import Interrupted
from tautwave.session.acceptance import guides
from tautwave.session.acceptance.accepted import NEEDED, keep_accepted, refuse_unkept
from tautwave.session.acceptance.day import Acceptance, Day, load_accepted
from tautwave.session.acceptance.document import TRAFFIC, Check
from tautwave.session.acceptance.ladder import COUPLED, FREE, SEEN, touches
from tautwave.session.acceptance.motion import motions
from tautwave.session.acceptance.silence import silences
from tautwave.session.acceptance.waiting import wait_for_place
from tautwave.session.admitting import admit
from tautwave.session.guided.answers import Declined, one_of
from tautwave.session.guided.control import GuidedControl
from tautwave.session.guided.running import (
    Conversation,
    Guided,
    Ways,
    ask_without_devices,
    run_guided,
)
from tautwave.session.running import run as run_rig
from tautwave.traffic import Traffic, recorded

GENTLE = 0.1
TRAFFIC_S = 1.0
"""How much of each stage's traffic is kept, after its first cycle and before its end."""
AGAIN, STOP = "r", "q"
SIGNALLED = 128
"""Exit codes beyond it are those of signals."""


class Accepted(NamedTuple):
    """The sealed document, its checks, and the error of a device refused in the first stage.

    `left` are stages that were not passed; `earlier` those checks that were done again.
    """

    document: Path
    checks: list[Check]
    refused: DriverError | SafetyStop | None
    left: list[str]


def accept(
    asked: Acceptance,
    talk: Conversation,
    *,
    out: Path,
    ways: Ways,
    resume: bool = False,
    redo: Sequence[str] = (),
) -> Accepted:
    """Lead a person through the stages and seal what was found, after each of them.

    Parameters
    ----------
    out : Path
        Directory for the document and the recordings.
    resume : bool
        Take over the stages that were passed in `out`, if it is of the same rig and devices.
    redo : sequence of str
        Of these, stages to do again.

    Raises
    ------
    TautwaveError
        The rig is refused, nothing can be resumed, no device could be asked anything, or none
        answers.
    KeyboardInterrupt
        By a person: all axes are safe, and `out` holds what was passed.
    """
    day = Day(asked, load_accepted(asked), out, ways)
    again = day.resume(redo) if resume else []
    if again:
        talk.say(f"the coupling changed since: {', '.join(again)} done again")
    _refuse_coupled(day, talk)
    real = real_buses(
        bus_ways(day.rig, clock=ways.clock, simulate=ways.simulate, attach=ways.attach)
    )
    ours = [name for name in asked.axes if day.rig.axes[name].bus in real]
    keeps = bool(ours) and set(NEEDED) <= set(asked.stages)
    if keeps:
        refuse_unkept(asked.rig)
    try:
        refused = _climb(day, talk)
    except BaseException:  # nobody answers any more, or Ctrl-C: what was passed stays
        if day.checks:
            day.seal()
            with suppress(OSError):  # the terminal may be what ended
                talk.say(f"\nwhat was passed is kept; {go_on(asked.rig, out)}")
        raise
    document = day.seal()
    if keeps and not day.left:
        devices = {name: day.devices[name] for name in ours if name in day.devices}
        kept = keep_accepted(asked.rig, devices, asked.by, document)
        talk.say(f"{kept}: what a run on these devices compares")
    checks = [check for stage in day.checks.values() for check in stage]
    return Accepted(document, checks, refused, day.left)


def go_on(rig: Path, out: Path) -> str:
    """Return the command that goes on with an acceptance, as a clause."""
    return f"go on with: tautwave accept {rig} --resume {out}"


def _climb(day: Day, talk: Conversation) -> DriverError | SafetyStop | None:
    """Go from stage to stage; return the error of a device that was refused in the first one."""
    stages, resumed = day.asked.stages, bool(day.checks)
    for number, stage in enumerate(stages):
        if day.passed(stage) and stage != "identity":
            talk.say(f"-- {stage}: passed before")
            continue
        while True:
            refused = _try(stage, day, talk, resumed=resumed)
            later = [one for one in stages[number + 1 :] if not day.passed(one)]
            if day.passed(stage) and not (talk.pauses and later):
                break
            day.seal()
            answer = _asked(talk, stage, passed=day.passed(stage), later=later)
            if answer == AGAIN:
                continue
            if not day.passed(stage) or answer == STOP:
                return refused
            break
        day.seal()
    return None


def _asked(talk: Conversation, stage: str, *, passed: bool, later: Sequence[str]) -> str:
    """Return whether to do a stage again, to stop, or neither; where nobody answers, to stop."""
    question = f"{stage} was not passed. Enter: end here. {AGAIN}: do it again"
    if passed:
        question = f"Enter: go on to {later[0]}. {AGAIN}: {stage} again. {STOP}: stop here for now"
    if not talk.answers.more():
        return STOP
    try:
        return ask_without_devices(talk, question, one_of("", AGAIN, STOP))
    except (Declined, ConfigError):  # the second: the end of the input
        return STOP


def _try(
    stage: str, day: Day, talk: Conversation, *, resumed: bool
) -> DriverError | SafetyStop | None:
    """Do a stage once and keep what it found; return the error of a device that was refused."""
    talk.say(f"-- {stage}: {SEEN[stage]}")
    first, refused = not day.tries, None
    out, traffic = day.begin(stage), Traffic(TRAFFIC_S)
    try:
        checks = [] if stage in FREE else _place(day, talk, out / "place", coupled=stage in COUPLED)
        with recorded(TRAFFIC_S) as traffic:
            checks = checks or list(_stage(stage, day, talk, out, resumed=resumed))
    except (DriverError, SafetyStop) as err:
        if resumed and stage == "identity":
            raise  # what was passed before stays as it is
        if first:
            if not traffic.events and not talk.pauses:
                raise
            refused = err
            make_directory(out)
            if not (out / "rig.yaml").exists():
                write_text(out / "rig.yaml", resolved_yaml(day.rig))
        checks = [Check(stage, day.rig.name, {"said": str(err)}, "no fault and no stop", False)]
    _keep_traffic(out, traffic)
    for check in checks:
        numbers = ", ".join(
            f"{key} {value:.4g}" if isinstance(value, float) else f"{key} {value}"
            for key, value in check.measured.items()
        )
        verdict = "good" if check.good else f"FAILED, expected {check.expected}"
        line = ": ".join(filter(None, (f"{check.stage} {check.what}", numbers, verdict)))
        talk.say(f"  {line}")
    day.checks[stage] = checks
    return refused


def _keep_traffic(folder: Path, traffic: Traffic) -> None:
    """Write the traffic of a stage, from which `tautwave replay-bus` plays its devices."""
    if traffic.events and folder.is_dir():
        write_text(folder / TRAFFIC, "".join(f"{one.line()}\n" for one in traffic.events))


def _stage(
    stage: str, day: Day, talk: Conversation, out: Path, *, resumed: bool
) -> Iterator[Check]:
    """Run a stage and yield its checks; what devices report is put into `day`."""
    rig, asked, ways = day.rig, day.asked, day.ways
    if stage in COUPLED:
        yield from _coupled(stage, asked, talk, out, ways)
        return
    if stage == "watchdog":
        yield from _watchdog(rig, talk, out, ways)
        return
    made: Mapping[str, Callable[[GuidedControl], Any]] = {
        "identity": lambda control: control.ask("are these your devices? Press Enter"),
        "hand": lambda control: guides.sign_and_scale(rig, asked.axes, control),
        "limits": lambda control: guides.ranges(rig, asked.axes, control),
        "noise": lambda control: guides.noise(rig, asked.axes, control),
        "silence": lambda control: silences(rig, asked.axes, control),
        "touch": lambda control: touches(rig, asked.axes, control),
        "motion": lambda control: motions(rig, asked.axes, control),
        "delay": lambda control: guides.delays(rig, asked.axes, control),
        "effort": lambda control: guides.efforts(rig, asked.axes, control),
    }
    free = stage in FREE
    done = run_guided(rig, made[stage], talk, out=out, torque=not free, guarded=not free, ways=ways)
    if resumed and stage == "identity":
        day.compare(done.identities)
    day.devices.update(done.identities)
    day.unwatched.update(done.unwatched)
    day.notes[stage] = done.notes
    if stage == "identity":
        yield from _identity(asked, done, talk)
        return
    yield from done.result


def _place(day: Day, talk: Conversation, out: Path, *, coupled: bool) -> list[Check]:
    """Wait until devices that outlast a stage stand where it may begin; nothing has torque."""
    rig, ways = day.rig, day.ways
    taken = bus_ways(rig, clock=ways.clock, simulate=ways.simulate, attach=ways.attach)
    if all(way.way in (Way.MEMORY, Way.SERVED) for way in taken.values()):
        return []  # each stage has its own, which begin in their place
    waited: list[Check] = run_guided(
        rig,
        lambda control: wait_for_place(rig, tuple(rig.axes), control, coupled=coupled),
        talk,
        out=out,
        torque=False,
        guarded=False,
        ways=ways,
    ).result
    return waited


def _identity(asked: Acceptance, done: Guided, talk: Conversation) -> Iterator[Check]:
    for note in done.notes:
        talk.say(f"  {note}")
    for name in asked.axes:
        told = dict(done.identities.get(name, {}))
        yield Check("identity", name, dict(told), "opened, and compared with the rig", True)


def _watchdog(rig: Rig, talk: Conversation, out: Path, ways: Ways) -> Iterator[Check]:
    """The loss of a bus is noticed, and the devices have stopped by themselves."""
    sentence = ""
    try:
        run_guided(
            rig, guides.unplugging, talk, out=out / "unplugged", torque=True, guarded=True,
            ways=ways,
        )  # fmt: skip
    except DriverError as err:
        sentence = str(err)
    lost: dict[str, float | str] = {"said": sentence or "nothing was lost"}
    yield Check("watchdog", "loss", lost, "the loss is noticed", bool(sentence))
    if not sentence:
        return
    back: dict[str, float | str]
    try:
        ask_without_devices(talk, "plug it in again; does every axis move freely? Press Enter")
        again = run_guided(
            rig, guides.coming_back, talk, out=out / "back", torque=False, guarded=False, ways=ways
        )
    except (Declined, DriverError) as err:
        back = {"devices": "not back", "said": str(err)}
    else:
        tripped = [note for note in again.notes if "watchdog" in note]
        back = {"devices": "back", "said": "; ".join(tripped) or "nothing"}
    good = back["devices"] == "back"
    yield Check("watchdog", "back", back, "axes move freely, and all devices come back", good)


def _coupled(
    stage: str, asked: Acceptance, talk: Conversation, out: Path, ways: Ways
) -> Iterator[Check]:
    """The coupling at a tenth of every effort limit, then with walls, then as the rig has it."""
    rig = coupled_rig(stage, asked)
    if rig is None:
        yield Check(stage, asked.rig.stem, {"walls": "none"}, "nothing to feel", True)
        return
    talk.say(f"  the rig engages for {asked.run_s:g} s: hold the master loosely")
    result = run_rig(
        rig, out=out, clock=ways.clock, simulate=ways.simulate, attach=ways.attach,
        allow_unwatched=ways.allow_unwatched, configure=ways.configure, warn=talk.say,
        accepting=True,
    )  # fmt: skip
    if result.exit_code > SIGNALLED:
        raise Interrupted(result.exit_code - SIGNALLED)
    energy = result.summary.energy_j
    numbers: dict[str, float | str] = {
        "exit_code": float(result.exit_code),
        "outcome": result.why,
    }
    books = {"residual": energy.residual, "generated": energy.generated}
    numbers |= {key: value for key, value in books.items() if value is not None}
    for pair, figures in result.summary.pairs.items():
        if (
            figures.position_error is not None and figures.position_error.rms is not None
        ):  # it engaged
            numbers[f"{pair}.position_error_rms"] = figures.position_error.rms
    yield Check(stage, rig.name, numbers, "a run that ends well", result.exit_code == 0)


def coupled_rig(stage: str, asked: Acceptance) -> Rig | None:
    """Return the rig of a coupled stage, None where there is nothing to run: it has no walls.

    Before `full` each axis has the effort that carries its load, and `GENTLE` of what is left.
    """
    keys = [f"duration_s={asked.run_s}"]
    rig = load_rig(asked.rig, choose=False)
    walls = [
        f"coupling.pairs.{name}.{wall}"
        for name, pair in rig.coupling.pairs.items()
        for wall in ("wall_master", "wall_slave")
        if getattr(pair, wall) is not None
    ]
    if stage == "walls" and not walls:
        return None
    if stage == "gentle":
        keys += [f"{wall}=null" for wall in walls]
    if stage != "full":
        keys += [
            f"{name.replace('.', '.axes.')}.effort_limit={limit}"
            for name, limit in shared_limits(rig, GENTLE).items()
        ]
    rig = load_rig(asked.rig, keys, choose=False)
    if rig.operate is not None:
        rig = load_rig(asked.rig, [*keys, "operate.start=engaged"], choose=False)
    return rig


def _refuse_coupled(day: Day, talk: Conversation) -> None:
    """Refuse now what a coupled stage would refuse at the end of the day.

    Raises
    ------
    TautwaveError
        The rig of such a stage may not run.
    """
    asked, ways = day.asked, day.ways
    stages = [stage for stage in day.left if stage in COUPLED]
    others = ",".join(stage for stage in asked.stages if stage not in COUPLED)
    leave = f", or leave what is coupled out: --stages {others}" if others else ""
    if stages:
        talk.say("looking whether the coupled stages may run")
    for stage in stages:
        rig = coupled_rig(stage, asked)
        if rig is not None:
            admit(
                rig, clock=ways.clock, simulate=ways.simulate, attach=ways.attach,
                remedy=f"Stage {stage} cannot run so: mend the rig first{leave}.",
            )  # fmt: skip
