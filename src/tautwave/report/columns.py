"""What each column of a recording is: unit and meaning; a test holds it to every shipped rig.

Who writes a column declares it; here the declarations are put together: all of them for the
reference, and for a recording those of its rig, its law and its drivers. They are kept with the
rows, so that whoever reads a recording needs none of what wrote it.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple

from tautwave import registry
from tautwave.columns import ACCOUNT, Column, Kinds, under
from tautwave.config import Rig
from tautwave.config.keys.control import SCENE
from tautwave.controller.rows import ACCOUNTS, AXIS, MEASURED, PAIR, WALL
from tautwave.controller.steps import Law
from tautwave.errors import ConfigError
from tautwave.link.columns import ACCOUNTS as OF_SITES
from tautwave.link.columns import LINK_COLUMNS
from tautwave.recordings.recording import described_in
from tautwave.rig.controller import coupling_law, law_over_link
from tautwave.runtime.carrying.side import CHANGED, LOAD, LOADS
from tautwave.runtime.following import FOLLOWED
from tautwave.runtime.loop import TIMING
from tautwave.runtime.operate.led import INTERVENTION, OF_POLICY
from tautwave.runtime.operate.operated import ACCOUNTS as OF_OPERATION
from tautwave.runtime.operate.operated import OPERATION
from tautwave.runtime.tuning.source import TUNED
from tautwave.truth import ARM, OF_HAND, OF_PLACE, PLANT, TRUE

OF_ACCOUNT = "tautwave.couplings.account.law:ACCOUNTS"
"""Elements of a law in an account."""


def _accounts(accounts: Mapping[str, str]) -> tuple[Column, ...]:
    """Return the first column of each element of a pair: its meaning is that of the element."""
    each = [Column(f"{name}.absorbed", "J", meaning) for name, meaning in accounts.items()]
    return under("PAIR", each)


SECTIONS = {
    "The cycle": TIMING,
    "An axis": (
        *under("SIDE.AXIS", (*AXIS, MEASURED, FOLLOWED, WALL)),
        Column(
            "slave.AXIS.target",
            "rad, m",
            "added by `export`: where the pair wants the slave, in the slave's coordinates",
        ),
    ),
    "One of two sites": LINK_COLUMNS,
    "A pair": under("PAIR", PAIR),
    "An operated rig": (*OPERATION, INTERVENTION, *under("policy.PAIR", OF_POLICY)),
    "A rig that is tuned": TUNED,
    "What carries a load": (
        *under("load.SIDE.AXIS", LOAD),
        *under("load.ARM", (*LOADS, CHANGED)),
    ),
    "The truth of a simulated axis": (
        *under("true.SIDE.AXIS", (*TRUE, *OF_HAND, *OF_PLACE)),
        *under("plant.SIDE.AXIS", PLANT),
    ),
    "A simulated arm": under("arm.ARM", ARM),
    "Elements of every pair": _accounts({**ACCOUNTS, **OF_OPERATION, **OF_SITES}),
}
"""What tautwave itself records, whatever the law and the drivers."""

ANY_ELEMENT = under(
    "PAIR.ELEMENT",
    (
        Column("absorbed", "J", "energy that entered it since the start; each element has three"),
        Column("stored", "J", "what it holds now"),
        Column("dissipated", "J", "energy dissipated; negative: created"),
    ),
)


def _of_all(known: Mapping[str, Sequence[Column]]) -> list[Column]:
    return [kind for kinds in known.values() for kind in kinds]


_CORE = Kinds(_of_all(SECTIONS))


def sections() -> dict[str, tuple[Column, ...]]:
    """Return all of them by section, with those of all laws, drivers and scenes installed here."""
    laws = [law for name in registry.coupling_names() for law in _laws(name)]
    drivers = [kind for name in registry.driver_names() for kind in _of_driver(name)]
    accounts = {name: what for law in laws for name, what in law.accounts.items()}
    accounts |= registry.load_named(OF_ACCOUNT)
    return {
        **SECTIONS,
        "A law": _each_once(kind for law in laws for kind in under("SIDE.AXIS", law.signals)),
        "Elements of a law": (*ANY_ELEMENT, *_accounts(accounts)),
        "A driver": _each_once(drivers),
        **_of_scenes(),
    }


def _each_once(kinds: Iterable[Column]) -> tuple[Column, ...]:
    return tuple({kind.name: kind for kind in kinds}.values())


def _laws(name: str) -> Sequence[Law]:
    """Return an installed law as it is on one machine and over a network; none if it is broken."""
    try:
        part = registry.load_coupling(name)
        alone: Law = registry.load_named(part.law)
        return (alone, law_over_link(part)) if part.over_link else (alone,)
    except ConfigError:
        return ()


def _of_driver(name: str) -> Sequence[Column]:
    """Return what an installed driver records; nothing if it is broken."""
    try:
        kinds: Sequence[Column] = registry.load_named(registry.load_driver(name).columns)
    except ConfigError:
        return ()
    return [one if "." in one.name else under("SIDE.AXIS", [one])[0] for one in kinds]


def _of_scenes() -> Mapping[str, tuple[Column, ...]]:
    """Return what the package behind `scene` records, by section; nothing without it."""
    try:
        hooks = registry.control_hooks(SCENE, "report")
        columns: Mapping[str, tuple[Column, ...]] = hooks.columns()
    except ConfigError:
        return {}
    return columns


def kinds_of(rig: Rig) -> Kinds:
    """Return what the recordings of a rig may have: its own law and drivers, and tautwave's."""
    own: list[Column] = [kind for name in rig.buses for kind in _of_driver(rig.buses[name].driver)]
    if rig.scene is None:
        law = coupling_law(rig)
        own += (*under("SIDE.AXIS", law.signals), *_accounts(law.accounts))
    else:
        own += [kind for kinds in _of_scenes().values() for kind in kinds]
    return Kinds([*own, *_of_all(SECTIONS), *ANY_ELEMENT])


def is_own(column: str) -> bool:
    """Return whether a column is a law's or a driver's own, and no account of an element."""
    ours = column.startswith(f"{SCENE}.") or column.endswith(tuple(f".{one}" for one in ACCOUNT))
    return not ours and _CORE.of(column) is None


class Described(NamedTuple):
    """What a recorded column is: SI unit, "" for counts and states, and meaning."""

    unit: str
    meaning: str


def describe(
    columns: Iterable[str], kinds: Kinds, axis_of: Callable[[str], tuple[str, str]]
) -> dict[str, Described]:
    """Return what columns are, of those that are known.

    Parameters
    ----------
    columns : iterable of str
        Their names.
    kinds : Kinds
        What they may be.
    axis_of : callable
        Returns kind and causality of the axis or pair that a column is about.
    """
    found = {}
    for column in columns:
        kind = kinds.of(column)
        if kind is not None:
            found[column] = Described(kind.unit_on(*axis_of(column)), kind.meaning)
    return found


def described(
    columns: Sequence[str], metadata: Mapping[str, str], axes: Mapping[str, tuple[str, str]]
) -> dict[str, Described]:
    """Return what the columns of a recording are, as it says itself.

    A recording of before 0.3 says nothing: then what is installed here tells. Columns that an
    export adds are described as well.

    Parameters
    ----------
    columns : sequence of str
        Of the recording, and added ones.
    metadata : mapping
        Of the recording.
    axes : mapping
        Kind and causality of its axes by full name.
    """
    told = {name: Described(*of) for name, of in described_in(metadata).items() if name in columns}
    kinds = _CORE if told else Kinds(_of_all(sections()))
    return told | describe([one for one in columns if one not in told], kinds, about(axes))


def described_text(rig: Rig, columns: Iterable[str]) -> str:
    """Return what the columns of a rig's recording are, for its metadata."""
    axes = {name: (axis.kind, axis.causality) for name, axis in rig.axes.items()}
    return json.dumps(describe(columns, kinds_of(rig), about(axes)))


def about(axes: Mapping[str, tuple[str, str]]) -> Callable[[str], tuple[str, str]]:
    """Return what finds kind and causality of a column's axis among some by full name.

    A pair is in its master's units.
    """

    def find(column: str) -> tuple[str, str]:
        parts = column.split(".")
        for k in range(len(parts) - 1):
            if (axis := ".".join(parts[k : k + 2])) in axes:
                return axes[axis]
        return axes.get(f"master.{parts[0]}", ("rotary", "impedance"))

    return find
