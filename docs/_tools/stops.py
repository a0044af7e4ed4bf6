"""What each kind of axis is sent once something failed: one table, of the docs and of the tests."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

KEEP, LET_GO, STAND, DAMP = "keep", "let go", "stand", "damp"
NOTHING, LEAVE, GO_ON = "nothing", "leave", "go on"

RULES = {
    KEEP: "the last command: its driver holds it",
    LET_GO: "the effort goes to 0, by `effort_rate_limit` for every slot that went by; without a "
    "rate limit at once",
    STAND: "velocity 0 at once; the goal of a follower stays where it is",
    DAMP: "`damping.lower`, less what its load takes of it, times the velocity, as long as tank or "
    "account answers for it, within `effort_rate_limit` and the ceiling that falls over "
    "`release_ramp_s`",
    NOTHING: "0 at once; its load is not carried either",
    LEAVE: "the safe command on every axis, then the devices are disabled",
    GO_ON: "no stop",
}

LIMIT, AT_ONCE, NEVER = "missing_limit", "at once", ""

KINDS = {
    "effort": "effort",
    "velocity": "velocity",
    "follower": "follower",
    "tip": "tip, joints take efforts",
    "velocity tip": "tip, joints take velocities",
    "scene": "port of a scene",
    "excited": "moved by `identify`",
}

FAILURES = {
    "gap": "no sample for fewer than `missing_limit` periods",
    "silent": "no sample",
    "late": "no sample, and the host skips slots",
    "position": "position not a number",
    "effort": "effort not a number",
    "velocity": "velocity not a number",
    "fault": "its device in fault",
    "bus fault": "its bus in fault",
    "stall": "the host stalls for `overrun_limit` slots, then samples come",
    "lost": "its bus lost: the driver raises an error",
}


class Sent(NamedTuple):
    """What an axis is sent after its last good sample.

    `begins`: the stop, after `missing_limit` periods or at once; until then the axis gets its last
    command, and then what `rule` says. `others`: what every other axis gets, seen as it is, in the
    terms of an axis that takes effort.
    """

    begins: str
    rule: str
    others: str = DAMP


GAP = Sent(NEVER, GO_ON, GO_ON)
LOST = Sent(AT_ONCE, LEAVE, LEAVE)
FED = "effort, fed"
"""The failure `effort` where the law is fed by the effort sensor of the axis."""

UNSEEN_EFFORT = {
    "gap": GAP,
    "silent": Sent(LIMIT, LET_GO),
    "late": Sent(LIMIT, LET_GO),
    "position": Sent(AT_ONCE, LET_GO),
    "effort": GAP,
    FED: Sent(LIMIT, LET_GO),
    "velocity": GAP,
    "fault": Sent(AT_ONCE, NOTHING),
    "bus fault": Sent(AT_ONCE, DAMP),
    "stall": Sent(AT_ONCE, DAMP),
    "lost": LOST,
}
UNSEEN_VELOCITY = {
    "gap": GAP,
    "silent": Sent(LIMIT, STAND),
    "late": Sent(LIMIT, STAND),
    "position": Sent(AT_ONCE, STAND),
    "effort": Sent(AT_ONCE, STAND),
    "velocity": GAP,
    "fault": Sent(AT_ONCE, NOTHING),
    "bus fault": Sent(AT_ONCE, STAND),
    "stall": Sent(AT_ONCE, STAND),
    "lost": LOST,
}
NO_SENSOR = {failure: sent for failure, sent in UNSEEN_EFFORT.items() if failure != FED}
TABLE: dict[str, dict[str, Sent]] = {
    "effort": UNSEEN_EFFORT,
    "velocity": UNSEEN_VELOCITY,
    "follower": {**UNSEEN_VELOCITY, "effort": GAP},  # what it feels is its spring's
    # A joint that is not seen leaves no coordinate to be seen, whatever it lacks.
    "tip": {**NO_SENSOR, "position": UNSEEN_EFFORT["silent"]},
    "velocity tip": {
        **UNSEEN_VELOCITY,
        "position": UNSEEN_VELOCITY["silent"],
        "effort": UNSEEN_VELOCITY["silent"],
    },
    "scene": NO_SENSOR,
    # The others get no effort before either.
    "excited": {
        failure: sent._replace(others=NOTHING if sent.others == DAMP else sent.others)
        for failure, sent in NO_SENSOR.items()
    },
}

LAWS = {
    "wave": "",
    "position": "",
    "pd_damping": "",
    "position_force": "",
    "four_channel": "",
    "mediated": "",
    "position_force measured": "slave",
    "four_channel measured": "master, slave",
    "mediated measured": "slave",
}
"""Laws, with `effort: measured` where they have it, and the sides whose sensors feed them."""
ALONE = "no law"

PLACES = {
    "plain": "an ordinary run",
    "operated": "an operated rig, which then holds",
    "link": "a simulated network between the sides",
    "sites": "two sites",
    "slow": "the bus of the slave on a `divisor`",
    "operated sites": "two operated sites",
}
SITES = ("sites", "operated sites")
ENGINES = ("python", "compiled", "simulate")


class Cell(NamedTuple):
    """One case: what fails, of which axis, under which law, where, and what runs it."""

    kind: str
    failure: str
    law: str
    account: bool
    place: str
    engine: str

    @property
    def name(self) -> str:
        """Its name."""
        shown = f"{self.law} in an account" if self.account else self.law
        return f"{self.kind}: {self.failure}: {shown}: {self.place}, {self.engine}"


TIPS = ("tip", "velocity tip")
OWN = ("scene", "excited")
MEASURED = tuple(law for law, sides in LAWS.items() if sides)
UNMEASURED = tuple(law for law, sides in LAWS.items() if not sides)
BY_LIVE = ("pd_damping", "position_force", "mediated")
STEPPED = "the simulation steps it by the functions that the loop has compiled: see there"
NOT_THERE: tuple[tuple[dict[str, tuple[Any, ...]], str], ...] = (
    ({"law": (ALONE,), "kind": ("effort", "velocity", "follower", *TIPS)}, "a law couples it"),
    ({"law": tuple(LAWS), "kind": OWN}, "no law couples it"),
    ({"law": (ALONE, "wave"), "account": (True,)}, "it keeps books of its own"),
    (
        {"law": tuple(LAWS)[1:], "kind": ("velocity", "follower", "velocity tip")},
        "this law needs an axis that takes effort",
    ),
    ({"law": MEASURED, "kind": TIPS}, "a coordinate of a tip has no effort sensor"),
    ({"law": UNMEASURED, "failure": (FED,)}, "this law takes no measured effort"),
    ({"law": MEASURED, "failure": ("effort",)}, "this law is fed by it: see there"),
    ({"kind": tuple(KINDS)[1:], "failure": (FED,)}, "no sensor of it feeds a law"),
    ({"kind": OWN, "place": tuple(PLACES)[1:]}, "it has one side, and nobody operates it"),
    (
        {"place": ("slow",), "law": tuple(LAWS)[1:]},
        "this law needs buses that are served each cycle",
    ),
    (
        {"kind": TIPS, "place": ("link", *SITES, "slow")},
        "to the controller it is an effort or a velocity axis: see there",
    ),
    (
        {"kind": ("follower",), "place": (*SITES, "slow")},
        "to the controller it is a velocity axis",
    ),
    (
        {"place": SITES, "failure": ("lost",)},
        "its loop leaves before it asks the controller: as in an ordinary run",
    ),
    (
        {"place": SITES, "account": (False,), "law": tuple(LAWS)[1:]},
        "without an account this law runs in one process only",
    ),
    ({"kind": ("velocity",), "place": SITES}, "as with a simulated network"),
    (
        {"place": ("operated sites",), "law": tuple(LAWS)[2:]},
        "in an account a hold asks no law: as `position`",
    ),
    ({"kind": ("excited",), "engine": ("compiled",)}, "`identify` runs in plain Python"),
    (
        {"place": ("operated", *SITES), "engine": ("compiled", "simulate")},
        "operated rigs and sites run in plain Python",
    ),
    (
        {"engine": ("simulate",), "kind": (*OWN, *TIPS, "follower")},
        "the loop itself simulates it: see there",
    ),
    (
        {
            "engine": ("simulate",),
            "failure": (*tuple(FAILURES)[3:], FED),
        },
        "simulated devices lose samples and the host skips slots, and nothing else fails",
    ),
    ({"engine": ("simulate",), "law": (*BY_LIVE, *MEASURED)}, STEPPED),
    ({"engine": ("simulate",), "law": ("position", "four_channel"), "account": (False,)}, STEPPED),
    ({"engine": ("simulate",), "law": ("position",), "place": ("plain",)}, STEPPED),
    ({"engine": ("simulate",), "law": ("four_channel",), "place": ("link",)}, STEPPED),
)
"""Cases that cannot be, each with its reason."""


def reason(cell: Cell) -> str:
    """Return why a case cannot be, '' where it can."""
    for fields, why in NOT_THERE:
        if all(getattr(cell, field) in values for field, values in fields.items()):
            return why
    if cell.failure not in TABLE[cell.kind]:
        return "it has no such field"
    return ""


def cells() -> Iterator[Cell]:
    """Yield every case, also those that cannot be."""
    for kind in KINDS:
        for law in (*LAWS, ALONE):
            for account in (False, True):
                for place in PLACES:
                    for engine in ENGINES:
                        for failure in (*FAILURES, FED):
                            yield Cell(kind, failure, law, account, place, engine)


def stops_page() -> str:
    """Return the page."""
    shown = [failure for failure in (*FAILURES, FED) if failure not in ("gap", "lost")]
    says = {**FAILURES, FED: "no effort from the sensor that feeds its law"}
    lines = [
        "# What a stopping axis is sent",
        "",
        "An axis without samples is not driven. This page is made from a table by which the tests "
        "run every case, and check each",
        'cycle after the last good sample. "Not a number" is what a driver passes on as NaN or '
        "infinite in a sample that it calls valid.",
        "",
        "| word | what is sent in each cycle |",
        "|---|---|",
        *(f"| {rule} | {text} |" for rule, text in RULES.items()),
        "",
        "Without a sample an axis first **keeps** its last command, for fewer than "
        "`loop.missing_limit` of its periods, those of its bus; slots that a stalled",
        'host skipped count. A gap shorter than that is no stop. Where the stop begins "at once" '
        "nothing is kept. An axis in a stop that",
        "loses its samples later lets go, or stands, from that cycle on.",
        "",
        "| what failed | " + " | ".join(KINDS.values()) + " |",
        "|---|" + "---|" * len(KINDS),
    ]
    for failure in shown:
        row = [_cell(kind, failure) for kind in KINDS]
        lines.append(f"| {says[failure]} | " + " | ".join(row) + " |")
    lines += [
        "",
        "Meanwhile every other axis of the run **damps** if it takes effort and **stands** if it "
        "takes velocity; those that `identify` does",
        "not move get nothing, as before. Where the driver of a bus raises an error, all leave. "
        "An operated rig does not end but holds:",
        "its axes are sent the same, under a ceiling that stays, and damping ends with the joules "
        "of the hold. At two sites the other one holds as soon as it hears of the stop, and its "
        "axis is sent what that says. Coordinates of a tip are",
        "unseen together, whatever one of its joints lacks; where a joint is in fault, no joint is "
        "sent anything of the tip's effort.",
        "",
        "Laws that an effort sensor feeds: "
        + "; ".join(f"`{law.split()[0]}` ({sides})" for law, sides in LAWS.items() if sides)
        + ", each with `effort: measured`. All other",
        "laws are sent the same, in an account or not, over a simulated network and at two sites, "
        "in plain Python and compiled.",
        "",
        "| these cases cannot be | because |",
        "|---|---|",
        *(f"| {_fields(fields)} | {why} |" for fields, why in NOT_THERE),
        "",
    ]
    return "\n".join(lines)


def _cell(kind: str, failure: str) -> str:
    sent = TABLE[kind].get(failure)
    if sent is None:
        return "-"
    if sent.rule == GO_ON:
        return GO_ON
    return f"keep, then {sent.rule}" if sent.begins == LIMIT else f"{sent.rule}, at once"


def _fields(fields: dict[str, tuple[Any, ...]]) -> str:
    account = {(True,): "in an account", (False,): "without an account"}
    parts = [
        account[values] if field == "account" else f"{field}: {', '.join(map(str, values))}"
        for field, values in fields.items()
    ]
    return "; ".join(parts)
