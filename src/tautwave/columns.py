"""What a column of a recording is: name, unit, meaning.

Who writes a column declares it, beside what fills it: the loop, the controller, a simulated axis.
The reference, exports and reports read the declarations (`report.columns`).
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import NamedTuple


class Column(NamedTuple):
    """A kind of column: SIDE is master or slave, AXIS, PAIR and others are names of the rig.

    ARM is a side or, of several arms, a full name such as `master.left`.
    """

    name: str
    unit: str
    meaning: str

    def matches(self, column: str) -> bool:
        """Return whether a recorded column is of this kind."""
        pattern = re.escape(self.name).replace("SIDE", "(?:master|slave)")
        return (
            re.fullmatch(
                re.sub(
                    "AXIS|PAIR|PORT|NODE|JOINT|BUS|WALL|ARM", "[A-Za-z_][A-Za-z0-9_.-]*", pattern
                ),
                column,
            )
            is not None
        )


def under(prefix: str, columns: Iterable[Column]) -> tuple[Column, ...]:
    """Return columns as those of one axis or pair are called: `PREFIX.name`."""
    return tuple(one._replace(name=f"{prefix}.{one.name}") for one in columns)


def names(columns: Iterable[Column]) -> list[str]:
    """Return what columns are called."""
    return [one.name for one in columns]
