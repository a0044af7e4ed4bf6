"""The model of `summary.json`: what a run left, as types. Units are SI where a key names none.

What is not known is absent from the file, and None or empty here: a run that was killed has little
more than its recording. Not finite numbers are null in the file.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, JsonValue

from tautwave.formats import SUMMARY

Severity = Literal["ok", "note", "bad", "open", "info"]
"""OK, a warning, failed, not evaluated, and a measurement without a judgement."""


def _finite(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value


Number = Annotated[float | None, BeforeValidator(_finite)]
"""A number; None: not known, or not finite."""

Side = Literal["master", "slave"]
ArmName = Annotated[str, Field(pattern=r"^(master|slave)(\.[^.]+)?$")]
Sentences = tuple[str, ...]


class Block(BaseModel):
    """A block of the summary: frozen, and without keys that nobody declared."""

    model_config = ConfigDict(
        extra="forbid", strict=True, frozen=True, allow_inf_nan=False, defer_build=True
    )


class Outcome(Block):
    """How a run ended; one that was stopped says when [s], on which axis, and why in a word."""

    kind: Literal["finished", "interrupted", "safety_stop", "fault", "unknown"] = "unknown"
    sentence: str = ""
    at_s: Number = None
    axis: str | None = None
    reason: str | None = None

    @property
    def severity(self) -> Severity:
        """How serious that is."""
        return _ENDS[self.kind][0]

    @property
    def label(self) -> str:
        """How it ended, in a few words."""
        return _ENDS[self.kind][1]


_ENDS: dict[str, tuple[Severity, str]] = {
    "finished": ("ok", "finished"),
    "interrupted": ("note", "interrupted by the user"),
    "safety_stop": ("bad", "safety stop"),
    "fault": ("bad", "fault"),
    "unknown": ("open", "outcome not recorded"),
}


class Spread(Block):
    """Percentiles and maximum of a time [us]."""

    p50: Number = None
    p99: Number = None
    p999: Number = None
    max: Number = None


class Size(Block):
    """Root mean square and greatest magnitude of a signal."""

    rms: Number = None
    max: Number = None


class DeviceFault(Block):
    """What a device or a bus reported; `axis` is None for a whole bus, or where it is not known.

    One that is not `fatal` was noted, and the run went on.
    """

    text: str
    axis: str | None = None
    fatal: bool | None = None

    @property
    def severity(self) -> Severity:
        """How serious it is."""
        return "note" if self.fatal is False else "bad"


class Axis(Block):
    """Samples of an axis that were missing, that were older than a period, and its faults."""

    lost: int | None = None
    late: int | None = None
    faults: tuple[DeviceFault, ...] = ()


class Unused(Block):
    """An element that a rig runs without, and why."""

    element: str
    reason: str = ""


class CommandDelay(Block):
    """When a command acts: after some periods of its bus, and a rest [s]."""

    periods: int
    remainder_s: float


class Bus(Block):
    """How a bus was run, and what its driver found.

    `words` says what answered; `notes` what was found and set before enabling. By axis:
    `watchdog_s`, after what silence [s] the device acts by itself; `unwatched`, what it does where
    it has no watchdog; `unconfirmed`, why it may still be enabled.
    """

    way: str | None = None
    where: str | None = None
    endpoint: str | None = None
    named: str | None = None
    forced: bool = False
    words: str = ""
    command_delay: CommandDelay | None = None
    notes: Sentences = ()
    watchdog_s: dict[str, Number] = Field(default_factory=dict)
    unwatched: dict[str, str] = Field(default_factory=dict)
    unconfirmed: dict[str, str] = Field(default_factory=dict)

    @property
    def severity(self) -> Severity:
        """Not fine with a device that may be enabled, worth a look with one nobody stops."""
        return "bad" if self.unconfirmed else "note" if self.unwatched else "ok"


class Certified(Block):
    """A verdict of the certificate: its state in a word, why, and on what conditions."""

    passed: bool | None = None
    state: str = "not evaluated"
    reason: str = ""
    conditions: Sentences = ()
    margin: Number = None

    @property
    def severity(self) -> Severity:
        """How serious it is, if it is the one that is required."""
        return certified_severity(self.passed, self.state)


def certified_severity(passed: bool | None, state: str) -> Severity:
    """Return how serious a verdict of a certificate is."""
    if passed is None:
        return "open"
    if not passed:
        return "bad"
    return "note" if state == "conditional" else "ok"


class CertifiedElement(Block):
    """An element of the certificate: its states, sentences, and what a port claims [J, W]."""

    passive: str = ""
    passive_quantised: str = ""
    sentences: Sentences = ()
    true_j: Number = None
    reserve_j: Number = None
    leak_w: Number = None


class RenderedWall(Block):
    """A wall's stiffness as requested, and as rendered after derating [N m/rad or N/m]."""

    asked_stiffness: Number = None
    rendered_stiffness: Number = None
    derate: bool = False

    @property
    def derated(self) -> bool:
        """Whether it was rendered softer than requested."""
        return self.asked_stiffness != self.rendered_stiffness


class HeldWall(Block):
    """A wall after a run: for how long its effort was held [s], what that takes, and whether it is.

    `needed_damping` of the device's `damping` [N m s/rad or N s/m]; `balance_j` the least that a
    contact had taken, `claim_j` what it may owe [J].
    """

    held_s: Number = None
    balance_j: Number = None
    claim_j: Number = None
    needed_damping: Number = None
    damping: Number = None
    passed: bool | None = None
    sentence: str = ""


class End(Block):
    """What an end of a pair supplied at most, in impacts, and what it claimed [J].

    Both as its encoder saw it; `true_j` is what it claims in fact, with noise as declared. `gap_s`
    is the longest gap between two of its samples, `stalled` whether that was longer than its claim
    assumes. `passed` is None in a run that was not judged.
    """

    given_j: Number = None
    blow_j: Number = None
    claim_j: Number = None
    true_j: Number = None
    gap_s: Number = None
    stalled: bool | None = None
    passed: bool | None = None


class Generated(Block):
    """What a coupling without claims generated, and by which rule it was judged."""

    rule: str
    given_j: Number = None
    damping_j: Number = None
    claim_j: Number = None
    floor_j: Number = None
    share_of_seconds: Number = None
    passed: bool | None = None
    sentence: str = ""


class Receiver(Block):
    """The least that a receiver held [J]."""

    least_j: Number = None


class AfterRun(Block):
    """What the measurements of a run made of its certificate.

    `invalidated`: they break it, or the run did what no certificate allows.
    """

    passed: bool | None = None
    invalidated: bool = False
    error: str = ""
    sentences: Sentences = ()
    notes: Sentences = ()
    broken_conditions: Sentences = ()
    judged: str = ""
    period_s: Number = None
    worst_period_s: Number = None
    missed_cycles: int | None = None
    lost: dict[str, int] = Field(default_factory=dict)
    late: dict[str, int] = Field(default_factory=dict)
    verdicts: dict[str, Certified] = Field(default_factory=dict)
    walls: dict[str, HeldWall] = Field(default_factory=dict)
    ends: dict[str, End] = Field(default_factory=dict)
    generated: dict[str, Generated] = Field(default_factory=dict)
    receivers: dict[str, Receiver] = Field(default_factory=dict)


class Certificate(Block):
    """The certificate of the rig before its run, and `after_run` what that made of it.

    `passed` is None while it is not evaluated.
    """

    passed: bool | None = None
    state: str = "not evaluated"
    require: str = ""
    verdicts: dict[str, Certified] = Field(default_factory=dict)
    sentences: Sentences = ()
    walls: dict[str, RenderedWall] = Field(default_factory=dict)
    elements: dict[str, CertifiedElement] = Field(default_factory=dict)
    loops: dict[str, Certified] = Field(default_factory=dict)
    allowed_uncertified: bool = False
    after_run: AfterRun = AfterRun()

    @property
    def severity(self) -> Severity:
        """How serious it is, after the run."""
        if self.after_run.invalidated:
            return "bad"
        return "note" if self.before == "ok" and self.after_run.broken_conditions else self.before

    @property
    def before(self) -> Severity:
        """How serious it was, before the run."""
        return certified_severity(self.passed, self.state)


class Recording(Block):
    """Rows that the recorder was offered, wrote and lost, and as they were read back."""

    rows_offered: int | None = None
    rows_written: int | None = None
    rows_dropped: int | None = None
    bytes: int | None = None
    error: str | None = None
    rows_read: int | None = None
    truncated: bool = False


class Account(Block):
    """The energy account of an element of the controller [J].

    `generated`: the most it ever supplied beyond what it had received; `held`: the most it stored.
    """

    absorbed: Number = None
    stored: Number = None
    dissipated: Number = None
    generated: Number = None
    held: Number = None


class Motors(Block):
    """What the motors of a pair gave, net and at the worst moment [J, s], and may have given."""

    net: Number = None
    worst: Number = None
    worst_at_s: Number = None
    stated_debt: Number = None


class LinkEnd(Block):
    """What came over a network to one side: shares of packets and cycles, times [s].

    `backlog` is the motion owed at most [rad or m].
    """

    loss: Number = None
    cut: Number = None
    backlog: Number = None
    held_s: Number = None
    holds: int = 0
    delay_p50_s: Number = None
    delay_p99_s: Number = None
    link_s: Number = None
    play_out_s: Number = None


class StatedClaim(Block):
    """What was stated of an axis before the run [J, s] (`tautwave.analysis.claim.Stated`).

    `judged` is the verdict on it in a word.
    """

    claim_j: Number = None
    prompt_j: Number = None
    stall_j: Number = None
    let_go_j: Number = None
    dead_j: Number = None
    kinetic_j: Number = None
    gap_s: Number = None
    safe_gap_s: Number = None
    judged: str = ""


class Pair(Block):
    """A coupled pair: its statics, what its ends claim, how far apart it was, and its energies.

    Errors are in the master's units; `delayed_error` is the slave's against where the master was a
    line's delay ago. `claim_j` is by side, `fast_share` too: of the motion's power, the share above
    8 Hz.
    """

    kind: Literal["rotary", "linear"] | None = None
    coupling_delay_s: Number = None
    offset_per_effort: Number = None
    power_ratio: Number = None
    held_share: Number = None
    claim_j: dict[Side, Number] = Field(default_factory=dict)
    claims: dict[Side, StatedClaim] = Field(default_factory=dict)
    receiver_j: Number = None
    delay_budget_s: dict[str, Number] = Field(default_factory=dict)
    position_error: Size | None = None
    effort_error: Size | None = None
    delayed_error: Size | None = None
    expected_offset: Number = None
    elements: dict[str, Account] = Field(default_factory=dict)
    link: dict[Side, LinkEnd] = Field(default_factory=dict)
    motors: Motors | None = None
    fast_share: dict[Side, Number] = Field(default_factory=dict)


class Energy(Block):
    """Totals of the books [J]."""

    gross_flow: Number = None
    residual: Number = None
    generated: Number = None
    motors_net: Number = None
    motors_worst: Number = None
    stated_debt: Number = None
    sensing_gap: Number = None
    uncertainty: Number = None
    plant_residual: Number = None


class Entry(Block):
    """An entry of the journal: at a time [s] a word from a source, the state after it, a sentence.

    `refused`: it had no effect.
    """

    at_s: float
    word: str
    source: str
    state: str
    text: str = ""
    refused: bool = False

    @property
    def severity(self) -> Severity:
        """How serious it is."""
        return "note" if self.refused or self.word == "fault" else "info"


class Episode(Block):
    """An episode: its number from 1, name, task, times [s], and what was said of it.

    `discarded`: it was to be recorded again.
    """

    number: int
    name: str
    task: str = ""
    begin_s: float
    end_s: float
    success: bool | None = None
    discarded: bool = False


class Operation(Block):
    """What people did with an operated rig: its journal, its episodes, how long it was engaged."""

    engagements: int = 0
    engaged_s: Number = None
    journal: tuple[Entry, ...] = ()
    episodes: tuple[Episode, ...] = ()


class Tuned(Block):
    """A change that was made during a run: when [s], its number, values by path."""

    at_s: float
    number: int
    values: dict[str, Number]


class Camera(Block):
    """What became of a camera's pictures."""

    frames: int | None = None
    lost: int | None = None
    timed_by: str | None = None
    error: str = ""


class Scene(Block):
    """What stepped a scene, and the account of each of its elements [J]."""

    engine: str = ""
    elements: dict[str, dict[str, Number]] = Field(default_factory=dict)


class Silence(Block):
    """When a site held [s], why, and for how long, where it went on."""

    at_s: float
    why: str
    for_s: Number = None


class Session(Block):
    """A session of two sites: when it was joined and engaged [s], where its axes began [rad, m].

    `slots_ahead`: of the other's slots, this one's.
    """

    id: str
    joined_s: Number = None
    engaged_s: Number = None
    began_at: dict[str, Number] = Field(default_factory=dict)
    offsets: dict[str, Number] = Field(default_factory=dict)
    silences: tuple[Silence, ...] = ()
    slots_ahead: Number = None
    notes: Sentences = ()


class Clocks(Block):
    """The other site's clock: its offset and the doubt [s], and its rate."""

    offset_s: Number = None
    rate: Number = None
    unknown_s: Number = None


class Site(Block):
    """The link of one of two sites: its sessions, and datagrams that were refused, by reason."""

    site: Side
    shared: str = ""
    peer: str = ""
    sessions: tuple[Session, ...] = ()
    ended: str | None = None
    lost: str | None = None
    granted_j: dict[str, Number] = Field(default_factory=dict)
    packets: int | None = None
    refused: dict[str, int] = Field(default_factory=dict)
    unread: int | None = None
    clocks: Clocks | None = None


class Load(Block):
    """What carrying the loads of a side, or of one of its several arms, did [J]."""

    potential_j: Number = None
    leak_j: Number = None
    given_j: Number = None
    changed_j: Number = None


class Summary(Block):
    """The result of a run.

    `format` is the version of the file (`tautwave.formats`). `warnings` are what a person should
    know beside how it ended, `incomplete` what could not be saved. `operation` is that of an
    operated rig, `link` that of one of two sites; `rebuilt`: from the recording alone.
    """

    format: Literal[2] = SUMMARY
    rig: str = ""
    version: str | None = None
    outcome: Outcome = Outcome()
    started_utc: str | None = None
    command: str | None = None
    clock: str | None = None
    asked_s: Number = None
    duration_s: Number = None
    rate_hz: Number = None
    cycles: int | None = None
    missed_cycles: int | None = None
    wall_time_s: Number = None
    period_us: Spread = Spread()
    lateness_us: Spread = Spread()
    compute_us: Spread = Spread()
    realtime: Sentences = ()
    axes: dict[str, Axis] = Field(default_factory=dict)
    faults: tuple[DeviceFault, ...] = ()
    certificate: Certificate = Certificate()
    left_out: tuple[Unused, ...] = ()
    recording: Recording = Recording()
    buses: dict[str, Bus] = Field(default_factory=dict)
    pairs: dict[str, Pair] = Field(default_factory=dict)
    energy_j: Energy = Energy()
    loads: dict[ArmName, Load] = Field(default_factory=dict)
    operation: Operation | None = None
    cameras: dict[str, Camera] = Field(default_factory=dict)
    tuning: tuple[Tuned, ...] = ()
    scene: Scene | None = None
    link: Site | None = None
    precision: dict[str, JsonValue] = Field(default_factory=dict)
    warnings: Sentences = ()
    incomplete: str | None = None
    report_error: str | None = None
    rebuilt: bool = False


def summary_schema() -> dict[str, Any]:
    """Return the JSON schema of `summary.json`."""
    schema = Summary.model_json_schema(mode="validation")
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}
